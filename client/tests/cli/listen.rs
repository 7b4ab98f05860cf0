//! `hook listen`, called as the service calls it and as others might.
#![cfg(unix)]
use std::time::{SystemTime, UNIX_EPOCH};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use hmac::{Hmac, KeyInit, Mac};
use serde_json::json;
use sha2::{Digest, Sha256};

use super::posts::Receiver;
use super::run::TestEnvironment;

const SECRET: [u8; 32] = [7; 32];
const JOB: &str = "0190a5d0-0000-7000-8000-00000000000e";

fn secret() -> String {
    format!("whsec_{}", STANDARD.encode(SECRET))
}

fn now() -> i64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs() as i64
}

fn signed(id: &str, time: i64, secret: &[u8], body: &[u8]) -> Vec<(&'static str, String)> {
    let mut mac = Hmac::<Sha256>::new_from_slice(secret).unwrap();
    mac.update(format!("{id}.{time}.").as_bytes());
    mac.update(body);
    let signature = STANDARD.encode(mac.finalize().into_bytes());
    vec![
        ("webhook-id", id.into()),
        ("webhook-timestamp", time.to_string()),
        ("webhook-signature", format!("v1,{signature}")),
        ("content-type", "application/cloudevents+json".into()),
    ]
}

fn event(id: &str, state: &str, scene: Option<(&str, &[u8])>) -> Vec<u8> {
    let artifact = |(name, bytes): (&str, &[u8])| {
        let sha256 = hex::encode(Sha256::digest(bytes));
        json!({"role": "scene", "name": name, "display_name": "marked.ply", "sha256": sha256, "size_bytes": bytes.len()})
    };
    let data = json!({
        "job": format!("jobs/{JOB}"), "display_name": "asset 7", "kind": "embed", "state": state, "request_id": "r-7",
        "artifacts": scene.map(artifact).into_iter().collect::<Vec<_>>(),
    });
    let event = json!({
        "specversion": "1.0", "id": id, "source": "/guardsplat/projects/default", "data": data,
        "type": format!("guardsplat.job.{state}.v1"), "subject": format!("jobs/{JOB}"),
    });
    event.to_string().into_bytes()
}

fn send(receiver: &Receiver, id: &str, body: &[u8]) -> u16 {
    receiver.post(&signed(id, now(), &SECRET, body), body)
}

#[test]
fn a_marked_scene_is_fetched_and_a_program_told() {
    let environment = TestEnvironment::new();
    environment.file("secret", format!("{}\n", secret()).as_bytes());
    std::fs::create_dir(environment.path("out")).unwrap();
    // It fails the first time.
    environment.file(
        "publish.sh",
        b"cat >last.json; echo \"$GUARDSPLAT_STATE $GUARDSPLAT_REQUEST_ID $GUARDSPLAT_SCENE\" >>log\n\
          [ -e again ] || { touch again; exit 7; }\n",
    );
    let line = "hook listen --listen 127.0.0.1:0 --secret-file secret --folder out -- sh publish.sh";
    let receiver = Receiver::start(&environment, line, &[]);
    let scene = environment.fake.store("marked.ply", b"marked");
    let body = event("e-1", "succeeded", Some((&scene, b"marked")));
    assert_eq!(send(&receiver, "e-1", &body), 500, "the program failed");
    assert_eq!(
        std::fs::read(environment.path(&format!("out/{JOB}.ply"))).unwrap(),
        b"marked"
    );
    for _ in 0..2 {
        assert_eq!(send(&receiver, "e-1", &body), 204);
    }
    assert_eq!(std::fs::read(environment.path("last.json")).unwrap(), body);
    assert_eq!(
        std::fs::read(environment.path(&format!("out/{JOB}.json"))).unwrap(),
        body
    );
    let log = std::fs::read_to_string(environment.path("log")).unwrap();
    let expected = format!("succeeded r-7 out/{JOB}.ply\n");
    assert_eq!(
        log,
        expected.repeat(2),
        "once for each call but the last, which was done already"
    );
    assert_eq!(environment.fake.state().offsets.len(), 1, "fetched once");

    // What failed has no scene.
    let failed = event("e-2", "failed", None);
    assert_eq!(send(&receiver, "e-2", &failed), 204);
    assert!(
        std::fs::read_to_string(environment.path("log"))
            .unwrap()
            .ends_with("failed r-7 \n")
    );
    let said = receiver.end();
    assert!(
        said.contains("publish") || said.contains("sh: exit status: 7"),
        "{said}"
    );
    assert!(!said.contains("whsec"), "{said}");
}

#[test]
fn what_is_not_the_service_s_is_refused() {
    let environment = TestEnvironment::new();
    let variables = [("GUARDSPLAT_HOOK_SECRET", secret())];
    let variables = variables.each_ref().map(|(name, value)| (*name, value.as_str()));
    let receiver = Receiver::start(&environment, "hook listen --listen 127.0.0.1:0", &variables);
    let body = event("e-1", "cancelled", None);
    for (headers, why) in [
        (Vec::new(), "nothing is signed"),
        (signed("e-1", now(), &[8; 32], &body), "another secret"),
        (signed("e-1", now(), &SECRET, b"{}"), "another body"),
        (signed("e-1", now() - 400, &SECRET, &body), "too old"),
        (signed("e-1", now() + 400, &SECRET, &body), "of the future"),
    ] {
        assert_eq!(receiver.post(&headers, &body), 401, "{why}");
    }
    let long = vec![b' '; (1 << 20) + 1];
    assert_eq!(receiver.post(&signed("e-1", now(), &SECRET, &long), &long), 413);
    assert_eq!(
        receiver.send(b"GET / HTTP/1.1\r\nhost: x\r\nconnection: close\r\n\r\n"),
        405
    );
    // Signed, and nothing that can be worked with.
    for nonsense in [&b"nonsense"[..], b"{}"] {
        assert_eq!(send(&receiver, "e-1", nonsense), 500);
    }
    assert_eq!(send(&receiver, "e-1", &body), 204);
    let said = receiver.end();
    // Without anything else to do it prints what came.
    assert!(said.contains(std::str::from_utf8(&body).unwrap()), "{said}");
    assert!(
        said.contains("the signature is wrong") && said.contains("five minutes"),
        "{said}"
    );
}

#[test]
fn a_scene_that_is_not_the_one_told_of_is_not_acknowledged() {
    let environment = TestEnvironment::new();
    environment.file("secret", secret().as_bytes());
    let line = "hook listen --listen 127.0.0.1:0 --secret-file secret --folder .";
    let receiver = Receiver::start(&environment, line, &[]);
    let scene = environment.fake.store("marked.ply", b"other bytes");
    let body = event("e-1", "succeeded", Some((&scene, b"marked")));
    assert_eq!(send(&receiver, "e-1", &body), 500);
    assert!(!environment.path(&format!("{JOB}.json")).exists());
    // Names in an event lead nowhere else.
    let text = String::from_utf8(body).unwrap();
    for (from, to) in [(JOB, "../../x"), (scene.as_str(), "artifacts/../x")] {
        let body = text.replace(from, to).into_bytes();
        assert_eq!(send(&receiver, "e-1", &body), 500, "{to}");
    }
    receiver.end();
    let ran = environment.run("hook listen --listen 127.0.0.1:0");
    assert!(
        ran.code == 1 && ran.err.contains("GUARDSPLAT_HOOK_SECRET"),
        "{}",
        ran.err
    );
}

/// The example of a program.
#[test]
fn the_example_publishes_marked_scenes_only() {
    let environment = TestEnvironment::new();
    environment.file("secret", secret().as_bytes());
    for folder in ["marked", "public"] {
        std::fs::create_dir(environment.path(folder)).unwrap();
    }
    let script = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../deploy/hooks/publish.sh");
    let line = format!(
        "hook listen --listen 127.0.0.1:0 --secret-file secret --folder marked -- bash {} public",
        script.display()
    );
    let receiver = Receiver::start(&environment, &line, &[]);
    let scene = environment.fake.store("marked.ply", b"marked");
    for (id, state, scene) in [
        ("e-1", "failed", None),
        ("e-2", "succeeded", Some((scene.as_str(), &b"marked"[..]))),
        ("e-3", "succeeded", Some((scene.as_str(), &b"marked"[..]))),
    ] {
        assert_eq!(send(&receiver, id, &event(id, state, scene)), 204, "{id}");
    }
    let said = receiver.end();
    assert!(said.contains("has failed; asset: asset 7"), "{said}");
    let public: Vec<_> = std::fs::read_dir(environment.path("public"))
        .unwrap()
        .map(|e| e.unwrap().file_name())
        .collect();
    assert_eq!(public, [format!("{JOB}.ply").as_str()]);
    assert_eq!(
        std::fs::read(environment.path(&format!("public/{JOB}.ply"))).unwrap(),
        b"marked"
    );
}
