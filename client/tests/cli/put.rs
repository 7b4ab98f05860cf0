//! Artifacts that are sent to a store, at addresses that the server gives.
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpListener;
use std::sync::{Arc, Mutex};

use tonic::Status;

use super::fake::Fake;
use super::run::TestEnvironment;

/// What a store does with what it is sent.
#[derive(Clone)]
enum How {
    Takes,
    /// Something else arrives.
    Damages,
    /// Closes the connection after half of it.
    BreaksOff,
    /// Answers with this, all of it read or none.
    Answers(&'static str, bool),
}

/// Heads of the requests that a store had.
type Heads = Arc<Mutex<Vec<String>>>;

/// Starts a store behind a server, and says where it is.
fn store(fake: &Fake, how: How) -> (String, Heads) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}", listener.local_addr().unwrap());
    let (fake, heads) = (fake.clone(), Heads::default());
    let noted = heads.clone();
    std::thread::spawn(move || {
        for mut socket in listener.incoming().map_while(Result::ok) {
            let mut reader = BufReader::new(socket.try_clone().unwrap());
            let mut head = String::new();
            while !head.ends_with("\r\n\r\n") && reader.read_line(&mut head).is_ok_and(|read| read > 0) {}
            head.make_ascii_lowercase();
            let length = head
                .split("content-length: ")
                .nth(1)
                .and_then(|rest| rest.lines().next());
            let length: usize = length.map_or(0, |length| length.parse().unwrap());
            noted.lock().unwrap().push(head);
            let (wanted, status) = match how {
                How::BreaksOff => (length / 2, ""),
                How::Answers(status, true) => (length, status),
                How::Answers(status, false) => (0, status),
                How::Takes | How::Damages => (length, "200 OK"),
            };
            let mut body = vec![0; wanted];
            reader.read_exact(&mut body).unwrap();
            if matches!(how, How::Damages) {
                body[0] ^= 1;
            }
            if matches!(how, How::Takes | How::Damages) {
                fake.state().put = body;
            }
            let answer = format!("HTTP/1.1 {status}\r\ncontent-length: 0\r\nconnection: close\r\n\r\n");
            if !status.is_empty() {
                let _ = socket.write_all(answer.as_bytes());
            }
        }
    });
    (address, heads)
}

fn bytes() -> Vec<u8> {
    (0..700_000_u32)
        .map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8)
        .collect()
}

/// Has the client send a file, with an address for it: how often it went to the server itself, and how often that was
/// to finish what went to the store.
fn send(environment: &TestEnvironment, address: &str) -> (usize, usize) {
    environment.fake.state().addresses_to_write = Some(address.to_owned());
    environment.file("scene.ply", &bytes());
    let ran = environment.run("artifact put scene.ply --json");
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert!(
        !format!("{}{}", ran.out, ran.err).contains(address),
        "an address is a secret"
    );
    let name = ran.json()["name"].as_str().unwrap_or_default().to_owned();
    let state = environment.fake.state();
    let (artifact, stored) = &state.artifacts[&name];
    assert_eq!(artifact.display_name, "scene.ply");
    assert!(*stored == bytes());
    assert_eq!(state.artifacts.len(), 1);
    (state.uploads, state.finishes)
}

#[test]
fn bytes_go_to_the_store_and_not_through_the_server() {
    let environment = TestEnvironment::new();
    let (address, heads) = store(&environment.fake, How::Takes);
    assert_eq!(send(&environment, &address), (0, 1));
    let heads = heads.lock().unwrap();
    assert_eq!(heads.len(), 1);
    assert!(heads[0].starts_with("put /uploads/"), "{}", heads[0]);
    // Stores take nothing whose length they don't know.
    assert!(!heads[0].contains("transfer-encoding"), "{}", heads[0]);
    for header in ["content-length: 700000\r\n", "x-ms-blob-type: blockblob\r\n"] {
        assert_eq!(heads[0].matches(header).count(), 1, "{}", heads[0]);
    }
}

#[test]
fn a_lost_answer_is_asked_for_again() {
    let environment = TestEnvironment::new();
    let lost = Status::unavailable("going down");
    environment.fake.state().finish_errors.push_back(lost);
    let (address, heads) = store(&environment.fake, How::Takes);
    assert_eq!(send(&environment, &address), (0, 2));
    assert_eq!(heads.lock().unwrap().len(), 1);
}

#[test]
fn where_the_store_does_not_take_it_the_server_does() {
    for (how, finishes) in [
        (How::Damages, 1),
        (How::BreaksOff, 0),
        (How::Answers("403 Forbidden", true), 0),
        (How::Answers("403 Forbidden", false), 0),
    ] {
        let environment = TestEnvironment::new();
        let (address, heads) = store(&environment.fake, how);
        assert_eq!(send(&environment, &address), (1, finishes));
        assert_eq!(heads.lock().unwrap().len(), 1);
    }
    // Nobody is there; and what is no address of a store.
    for address in ["http://127.0.0.1:1", "file:///etc"] {
        assert_eq!(send(&TestEnvironment::new(), address), (1, 0));
    }
}

/// What the server named as the store is the only place that bytes go to.
#[test]
fn nobody_sends_it_elsewhere() {
    let environment = TestEnvironment::new();
    let (elsewhere, heads) = store(&environment.fake, How::Takes);
    let status = format!("307 Temporary Redirect\r\nlocation: {elsewhere}/uploads/1");
    let (address, _) = store(&environment.fake, How::Answers(status.leak(), true));
    assert_eq!(send(&environment, &address), (1, 0));
    assert!(heads.lock().unwrap().is_empty());
}
