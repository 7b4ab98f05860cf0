//! Receivers as a user runs them, and what is posted to them.
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::Child;
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

use super::run::TestEnvironment;

/// A receiver that runs; it is ended with this.
pub struct Receiver {
    child: Child,
    address: String,
    said: Arc<Mutex<String>>,
    reading: Vec<JoinHandle<()>>,
}

impl Receiver {
    /// Starts a line that listens, and waits until it does.
    pub fn start(environment: &TestEnvironment, line: &str, variables: &[(&str, &str)]) -> Self {
        let mut command = environment.command(line);
        for name in ["GUARDSPLAT_HOOK_SECRET", "GUARDSPLAT_HOOK_TOKEN"] {
            command.env_remove(name);
        }
        command.env("GUARDSPLAT_SERVER", environment.fake.url());
        let mut child = command.envs(variables.iter().copied()).spawn().unwrap();
        let mut stderr = BufReader::new(child.stderr.take().unwrap());
        let mut first = String::new();
        stderr.read_line(&mut first).unwrap();
        let address = first.trim().strip_prefix("listening on http://");
        let address = address.unwrap_or_else(|| panic!("it said {first}")).to_owned();
        let said = Arc::new(Mutex::new(String::new()));
        let stdout = BufReader::new(child.stdout.take().unwrap());
        let reading = vec![keep(stderr, &said), keep(stdout, &said)];
        Self {
            child,
            address,
            said,
            reading,
        }
    }

    /// Posts a body, and gives the status of the answer.
    pub fn post(&self, headers: &[(&str, String)], body: &[u8]) -> u16 {
        let head: String = headers
            .iter()
            .map(|(name, value)| format!("{name}: {value}\r\n"))
            .collect();
        let length = body.len();
        let head =
            format!("POST /hook HTTP/1.1\r\nhost: x\r\ncontent-length: {length}\r\nconnection: close\r\n{head}\r\n");
        self.send(&[head.as_bytes(), body].concat())
    }

    /// Sends bytes, and gives the status of the answer.
    pub fn send(&self, bytes: &[u8]) -> u16 {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        // It may answer, and hang up, before it has read all.
        let _ = stream.write_all(bytes);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        let answer = String::from_utf8_lossy(&answer).into_owned();
        let status = answer.split(' ').nth(1).and_then(|status| status.parse().ok());
        status.unwrap_or_else(|| panic!("answered {answer:?}"))
    }

    /// Ends it; all that it said after the first line.
    pub fn end(mut self) -> String {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
        for reading in self.reading {
            reading.join().unwrap();
        }
        self.said.lock().unwrap().clone()
    }
}

fn keep(mut from: impl BufRead + Send + 'static, said: &Arc<Mutex<String>>) -> JoinHandle<()> {
    let said = said.clone();
    std::thread::spawn(move || {
        let mut line = String::new();
        while from.read_line(&mut line).is_ok_and(|read| read > 0) {
            said.lock().unwrap().push_str(&line);
            line.clear();
        }
    })
}
