//! `hook s3`, told of uploads as stores tell of them.
#![cfg(unix)]
use std::io::{Read, Write};

use guardsplat_proto::v1::job::Spec;
use serde_json::json;

use super::fake::KEY;
use super::posts::Receiver;
use super::run::TestEnvironment;

const TOKEN: &str = "a token of the store's own";

fn notification(event: &str, bucket: &str, keys: &[(&str, &str)]) -> Vec<u8> {
    let record = |(key, etag): &(&str, &str)| json!({"eventName": event, "s3": {"bucket": {"name": bucket}, "object": {"key": key, "eTag": etag, "size": 3}}});
    json!({"Records": keys.iter().map(record).collect::<Vec<_>>()})
        .to_string()
        .into_bytes()
}

fn send(receiver: &Receiver, body: &[u8]) -> u16 {
    let token = format!("Bearer {}", TOKEN.replace(' ', "-"));
    receiver.post(&[("authorization", token)], body)
}

fn start(environment: &TestEnvironment, more: &str) -> Receiver {
    std::fs::create_dir_all(environment.path("uploads/red flower")).unwrap();
    environment.file("uploads/red flower/a.ply", b"ply");
    environment.file("token", format!("{}\n", TOKEN.replace(' ', "-")).as_bytes());
    let line = format!(
        "hook s3 --listen 127.0.0.1:0 --store-token-file token --bucket uploads --folder uploads --key {KEY} {more}"
    );
    Receiver::start(environment, &line, &[])
}

#[test]
fn an_upload_is_one_job_however_often_it_is_told_of() {
    let environment = TestEnvironment::new();
    let receiver = start(&environment, "--message c0ffee42 --preset draft");
    let body = notification("s3:ObjectCreated:Put", "uploads", &[("red+flower%2Fa.ply", "1")]);
    for _ in 0..3 {
        assert_eq!(send(&receiver, &body), 204);
    }
    {
        let state = environment.fake.state();
        assert_eq!((state.jobs.len(), state.created.len(), state.deleted.len()), (1, 3, 2));
        let job = state.created[0].job.as_ref().unwrap();
        assert_eq!(job.display_name, "red flower/a.ply");
        let Some(Spec::Embed(spec)) = &job.spec else {
            panic!("{job:?}")
        };
        assert_eq!((spec.message.as_str(), spec.key.as_str()), ("c0ffee42", KEY));
        let ids: Vec<_> = state
            .created
            .iter()
            .map(|request| request.request_id.as_str())
            .collect();
        assert!(ids.iter().all(|id| *id == ids[0]) && !ids[0].is_empty(), "{ids:?}");
    }
    // Another version is another job.
    let next = notification("ObjectCreated:Copy", "uploads", &[("red+flower/a.ply", "2")]);
    assert_eq!(send(&receiver, &next), 204);
    assert_eq!(environment.fake.state().jobs.len(), 2);
    let said = receiver.end();
    assert_eq!(
        said.lines()
            .filter(|line| line.ends_with("uploads/red flower/a.ply"))
            .count(),
        4,
        "{said}"
    );
}

/// A store that gives one object.
fn store(path: &'static str, bytes: &'static [u8]) -> std::net::SocketAddr {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            let mut head = Vec::new();
            while !head.ends_with(b"\r\n\r\n") {
                let mut byte = [0];
                stream.read_exact(&mut byte).unwrap();
                head.extend(byte);
            }
            let found = String::from_utf8(head)
                .unwrap()
                .starts_with(&format!("GET {path} HTTP/1.1\r\n"));
            let (status, body) = if found {
                ("200 OK", bytes)
            } else {
                ("404 Not Found", &b""[..])
            };
            let length = body.len();
            write!(stream, "HTTP/1.1 {status}\r\ncontent-length: {length}\r\n\r\n").unwrap();
            stream.write_all(body).unwrap();
        }
    });
    address
}

#[test]
fn objects_are_fetched_from_a_store() {
    let environment = TestEnvironment::new();
    let store = store("/uploads/red%20flower/a%2B1.ply", b"ply of a store");
    environment.file("token", TOKEN.replace(' ', "-").as_bytes());
    let line = format!(
        "hook s3 --listen 127.0.0.1:0 --store-token-file token --bucket uploads --prefix http://{store}/uploads/ \
         --key {KEY} --message c0ffee42"
    );
    let receiver = Receiver::start(&environment, &line, &[]);
    let body = notification("ObjectCreated:Put", "uploads", &[("red+flower/a%2B1.ply", "1")]);
    assert_eq!(send(&receiver, &body), 204);
    let missing = notification("ObjectCreated:Put", "uploads", &[("b.ply", "1")]);
    assert_eq!(send(&receiver, &missing), 500);
    let said = receiver.end();
    assert!(said.contains("/uploads/b.ply: the store answered 404"), "{said}");
    let state = environment.fake.state();
    let (artifact, bytes) = state.artifacts.values().next().unwrap();
    assert_eq!(
        (artifact.display_name.as_str(), bytes.as_slice()),
        ("a+1.ply", &b"ply of a store"[..])
    );
    assert_eq!(state.jobs.len(), 1);
}

#[test]
fn what_is_no_upload_of_a_scene_is_left_alone() {
    let environment = TestEnvironment::new();
    let receiver = start(&environment, "--message c0ffee42");
    environment.file("outside.ply", b"ply");
    environment.file("uploads/diary.ply", b"Dear diary");
    environment.file("uploads/notes.txt", b"ply");
    std::os::unix::fs::symlink(environment.path("outside.ply"), environment.path("uploads/link.ply")).unwrap();
    for key in [
        "..%2Foutside.ply",
        "/etc/passwd.ply",
        "red/../../outside.ply",
        "link.ply",
        "diary.ply",
        "notes.txt",
    ] {
        let body = notification("ObjectCreated:Put", "uploads", &[(key, "1")]);
        assert_eq!(send(&receiver, &body), 204, "{key}");
    }
    for body in [
        notification("ObjectCreated:Put", "others", &[("red+flower/a.ply", "1")]),
        notification("ObjectRemoved:Delete", "uploads", &[("red+flower/a.ply", "1")]),
        br#"{"Event":"s3:TestEvent"}"#.to_vec(),
    ] {
        assert_eq!(send(&receiver, &body), 204);
    }
    assert_eq!(environment.fake.state().created.len(), 0);
    // A folder that is behind, and what is no notification: the store is to try again.
    let missing = notification(
        "ObjectCreated:Put",
        "uploads",
        &[("red+flower/a.ply", "1"), ("late.ply", "1")],
    );
    assert_eq!(send(&receiver, &missing), 500);
    assert_eq!(environment.fake.state().jobs.len(), 1, "the other one has its job");
    assert_eq!(send(&receiver, b"nonsense"), 500);
    let said = receiver.end();
    assert!(
        said.contains("lead to another folder") && said.contains("a link to another folder"),
        "{said}"
    );
}

#[test]
fn only_the_store_may_tell() {
    let environment = TestEnvironment::new();
    let receiver = start(&environment, "--message c0ffee42");
    let body = notification("ObjectCreated:Put", "uploads", &[("red+flower/a.ply", "1")]);
    for shown in ["", "Bearer ", "Bearer another", "Basic a-token-of-the-store's-own"] {
        let headers = match shown {
            "" => Vec::new(),
            shown => vec![("authorization", shown.to_owned())],
        };
        assert_eq!(receiver.post(&headers, &body), 401, "{shown}");
    }
    assert_eq!(environment.fake.state().created.len(), 0);
    receiver.end();
    let line = format!("hook s3 --bucket b --folder . --key {KEY} --message c0ffee42");
    let ran = environment.run(&line);
    assert!(
        ran.code == 1 && ran.err.contains("GUARDSPLAT_HOOK_TOKEN"),
        "{}",
        ran.err
    );
}

#[test]
fn a_program_says_what_an_object_is_marked_with() {
    let environment = TestEnvironment::new();
    environment.file(
        "message.sh",
        b"read -r line; case $line in *'\"size\":3'*) echo C0FFEE07 ;; esac\n",
    );
    let receiver = start(&environment, "-- sh message.sh");
    let body = notification("ObjectCreated:Put", "uploads", &[("red+flower/a.ply", "1")]);
    assert_eq!(send(&receiver, &body), 204);
    {
        let state = environment.fake.state();
        let Some(Spec::Embed(spec)) = &state.created[0].job.as_ref().unwrap().spec else {
            panic!()
        };
        assert_eq!(spec.message, "c0ffee07");
    }
    // Another answer for the same object is refused by the server, and telling again would not help.
    environment.file("message.sh", b"cat >/dev/null; echo 00000000\n");
    assert_eq!(send(&receiver, &body), 204);
    assert_eq!(environment.fake.state().jobs.len(), 1);
    // What it says nothing of is left alone.
    environment.file("message.sh", b"cat >/dev/null\n");
    assert_eq!(send(&receiver, &body), 204);
    // One that fails is asked again.
    environment.file("message.sh", b"exit 1\n");
    assert_eq!(send(&receiver, &body), 500);
    let said = receiver.end();
    assert!(
        said.contains("left alone") && said.contains("sh: exit status: 1"),
        "{said}"
    );
}

/// The example of a program.
#[test]
fn the_example_reads_the_owner_from_the_key() {
    let environment = TestEnvironment::new();
    let script = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy/hooks/message.sh");
    let receiver = start(&environment, &format!("-- bash {}", script.display()));
    for folder in ["0004711", "99999999999", "4294967296"] {
        std::fs::create_dir(environment.path(&format!("uploads/{folder}"))).unwrap();
        environment.file(&format!("uploads/{folder}/a.ply"), b"ply");
        let key = format!("{folder}%2Fa.ply");
        let body = notification(
            "ObjectCreated:Put",
            "uploads",
            &[(&key, "1"), ("red+flower/a.ply", "1")],
        );
        assert_eq!(send(&receiver, &body), 204);
    }
    let said = receiver.end();
    let state = environment.fake.state();
    assert_eq!(state.created.len(), 1, "{said}");
    let Some(Spec::Embed(spec)) = &state.created[0].job.as_ref().unwrap().spec else {
        panic!()
    };
    assert_eq!(spec.message, "00001267");
    assert!(
        said.contains("there is no owner 4294967296") && said.contains("in no owner's folder"),
        "{said}"
    );
}
