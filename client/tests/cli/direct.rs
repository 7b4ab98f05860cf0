//! Artifacts that are fetched from a store, by addresses that the server gives.
use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::sync::{Arc, Mutex};

use super::run::TestEnvironment;

/// What a store has, how it answers, and what it was asked.
#[derive(Clone, Default)]
struct Store {
    bytes: Vec<u8>,
    /// After how many bytes the first answer ends.
    end: Option<usize>,
    /// Status of answers that are none.
    refuses: Option<u16>,
    asked: Arc<Mutex<Vec<Option<u64>>>>,
}

impl Store {
    /// Starts it, and says where it is.
    fn start(&self) -> String {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("http://{}", listener.local_addr().unwrap());
        let store = self.clone();
        std::thread::spawn(move || {
            for mut socket in listener.incoming().map_while(Result::ok) {
                let lines = BufReader::new(socket.try_clone().unwrap()).lines();
                let mut offset = None;
                for line in lines.map_while(Result::ok).take_while(|line| !line.is_empty()) {
                    let range = line.to_lowercase();
                    offset = offset.or(range
                        .strip_prefix("range: bytes=")
                        .map(|rest| rest.trim_end_matches('-').parse().unwrap()));
                }
                let first = store.asked.lock().unwrap().is_empty();
                store.asked.lock().unwrap().push(offset);
                let rest = &store.bytes[offset.unwrap_or(0) as usize..];
                let status = store.refuses.unwrap_or(if offset.is_some() { 206 } else { 200 });
                let sent = &rest[..store.end.filter(|_| first).unwrap_or(rest.len())];
                let head = format!(
                    "HTTP/1.1 {status} x\r\ncontent-length: {}\r\nconnection: close\r\n\r\n",
                    rest.len()
                );
                let _ = socket.write_all(head.as_bytes()).and_then(|()| socket.write_all(sent));
            }
        });
        address
    }

    fn asked(&self) -> Vec<Option<u64>> {
        self.asked.lock().unwrap().clone()
    }
}

fn bytes() -> Vec<u8> {
    (0..300_000_u32)
        .map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8)
        .collect()
}

/// Has the client fetch an artifact, with an address for it; the offsets at which the server itself was asked then.
fn fetch(address: &str) -> Vec<i64> {
    let environment = TestEnvironment::new();
    let name = environment.fake.store("scene.ply", &bytes());
    environment.fake.state().addresses = Some(address.to_owned());
    let ran = environment.run(&format!("artifact get {name} -o out.ply --json"));
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert!(std::fs::read(environment.path("out.ply")).unwrap() == bytes());
    assert_eq!(ran.json()["size_bytes"], 300_000);
    assert!(
        !format!("{}{}", ran.out, ran.err).contains(address),
        "an address is a secret"
    );
    assert_eq!(environment.files(), ["out.ply"]);
    environment.fake.state().offsets.clone()
}

#[test]
fn bytes_come_from_the_store_and_not_through_the_server() {
    let store = Store {
        bytes: bytes(),
        ..Store::default()
    };
    assert_eq!(fetch(&store.start()), Vec::<i64>::new());
    assert_eq!(store.asked(), [None]);
}

#[test]
fn an_answer_that_broke_off_is_gone_on_with() {
    let store = Store {
        bytes: bytes(),
        end: Some(123_456),
        ..Store::default()
    };
    assert_eq!(fetch(&store.start()), Vec::<i64>::new());
    assert_eq!(store.asked(), [None, Some(123_456)]);
}

#[test]
fn where_the_store_does_not_serve_the_server_does() {
    let damaged = Store {
        bytes: bytes().into_iter().rev().collect(),
        ..Store::default()
    };
    let refusing = Store {
        bytes: bytes(),
        refuses: Some(403),
        ..Store::default()
    };
    let another = Store {
        bytes: b"<html>please log in</html>".to_vec(),
        ..Store::default()
    };
    for store in [damaged, refusing, another] {
        assert_eq!(fetch(&store.start()), [0]);
        assert_eq!(store.asked(), [None]);
    }
    // Nobody is there; and what is no address of a store.
    for address in ["http://127.0.0.1:1", "file:///etc"] {
        assert_eq!(fetch(address), [0]);
    }
}
