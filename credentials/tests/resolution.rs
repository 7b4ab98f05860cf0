//! The resolution API as callers see it, over a socket.
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use serde_json::Value as Json;
use tempfile::TempDir;

/// What names a mark.
const VALUE: &str = "ABEiM0RVZneImaq7zN3u/26/lQiL7oK86zTNnhnW0FUnSul2";
/// The same in a URL.
const ENCODED: &str = "ABEiM0RVZneImaq7zN3u%2F26%2FlQiL7oK86zTNnhnW0FUnSul2";

fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_guardsplat-credentials"))
}

fn sign(folder: &Path, name: &str) {
    std::fs::write(folder.join("scene.ply"), name).unwrap();
    let mut command = program();
    let scene = folder.join("scene.ply");
    command.args(["sign".as_ref(), scene.as_os_str(), scene.as_os_str()]);
    command.arg(folder.join(name)).args(["--soft-binding", VALUE]);
    assert!(command.stdout(Stdio::null()).status().unwrap().success());
}

struct Service {
    child: Child,
    address: String,
}

impl Service {
    fn start(folder: &Path, more: &[&str]) -> Self {
        let mut command = program();
        command
            .args(["serve", "--listen", "127.0.0.1:0", "--store"])
            .arg(folder)
            .args(more);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap())
            .read_line(&mut line)
            .unwrap();
        let address = line.trim().strip_prefix("listening on http://").unwrap().to_owned();
        Self { child, address }
    }

    /// Status and body.
    fn ask(&self, method: &str, target: &str, headers: &str, body: &str) -> (u16, Vec<u8>) {
        self.ask_with_length(method, target, headers, body, body.len())
    }

    fn ask_with_length(&self, method: &str, target: &str, headers: &str, body: &str, length: usize) -> (u16, Vec<u8>) {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        write!(
            stream,
            "{method} {target} HTTP/1.1\r\nHost: h\r\nConnection: close\r\nContent-Length: {length}\r\n{headers}\r\n{body}"
        )
        .unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let end = answer.windows(4).position(|part| part == b"\r\n\r\n").unwrap();
        let status = std::str::from_utf8(&answer[9..12]).unwrap().parse().unwrap();
        (status, answer[end + 4..].to_vec())
    }

    fn get(&self, target: &str) -> (u16, Vec<u8>) {
        self.ask("GET", target, "", "")
    }

    fn manifests(&self, target: &str) -> Vec<String> {
        let (status, body) = self.get(target);
        assert_eq!(status, 200, "{target}");
        ids(&body)
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn ids(body: &[u8]) -> Vec<String> {
    let told: Json = serde_json::from_slice(body).unwrap();
    let matches = told["matches"].as_array().unwrap();
    matches
        .iter()
        .map(|found| found["manifestId"].as_str().unwrap().to_owned())
        .collect()
}

#[test]
fn a_manifest_is_found_by_its_mark_and_fetched() {
    let folder = TempDir::new().unwrap();
    sign(folder.path(), "a.c2pa");
    std::fs::write(folder.path().join("none.c2pa"), b"PK").unwrap();
    let service = Service::start(folder.path(), &[]);
    let (status, body) = service.get("/services/supportedAlgorithms");
    let told: Json = serde_json::from_slice(&body).unwrap();
    assert_eq!(
        (status, &told["watermarks"][0]["alg"]),
        (200, &"org.guardsplat.sh.1".into())
    );

    let by_binding = format!("/matches/byBinding?alg=org.guardsplat.sh.1&value={ENCODED}");
    let found = service.manifests(&by_binding);
    assert_eq!(found.len(), 1);
    let (status, manifest) = service.get(&format!(
        "/manifests/{}?returnActiveManifest=true",
        found[0].replace(':', "%3A")
    ));
    assert_eq!(
        (status, manifest),
        (200, std::fs::read(folder.path().join("a.c2pa")).unwrap())
    );
    let asked = serde_json::json!({ "alg": "org.guardsplat.sh.1", "value": VALUE }).to_string();
    let (status, body) = service.ask(
        "POST",
        "/matches/byBinding",
        "Content-Type: application/json\r\n",
        &asked,
    );
    assert_eq!((status, ids(&body)), (200, found));
    // One bit off is another message, and no stranger's to guess at.
    assert!(service.manifests(&by_binding.replace("Sul2", "Sul3")).is_empty());
    assert_eq!(service.ask("POST", "/matches/byContent", "", "ply").0, 501);
    assert_eq!(
        service.ask_with_length("POST", "/matches/byBinding", "", "", 100_000).0,
        413
    );

    // What comes later is found, too, as soon as the folder is looked at again.
    sign(folder.path(), "b.c2pa");
    std::thread::sleep(std::time::Duration::from_millis(1100));
    assert_eq!(service.manifests(&by_binding).len(), 2);
    assert_eq!(service.manifests(&format!("{by_binding}&maxResults=1")).len(), 1);
}

#[test]
fn who_shows_no_token_learns_nothing() {
    let folder = TempDir::new().unwrap();
    sign(folder.path(), "a.c2pa");
    let token = folder.path().join("token");
    std::fs::write(&token, "secret\n").unwrap();
    let service = Service::start(folder.path(), &["--token-file", token.to_str().unwrap()]);
    let by_binding = format!("/matches/byBinding?alg=org.guardsplat.sh.1&value={ENCODED}");
    for (method, target) in [
        ("GET", by_binding.as_str()),
        ("POST", "/matches/byBinding"),
        ("POST", "/matches/byContent"),
    ]
    .into_iter()
    .chain([("GET", "/manifests/urn:c2pa:x"), ("GET", "/")])
    {
        for headers in ["", "Authorization: Bearer wrong\r\n", "Authorization: Basic secret\r\n"] {
            assert_eq!(
                service.ask(method, target, headers, "").0,
                401,
                "{method} {target} {headers}"
            );
        }
    }
    let (status, body) = service.ask("GET", &by_binding, "Authorization: Bearer secret\r\n", "");
    assert_eq!((status, ids(&body).len()), (200, 1));
}

#[test]
fn a_service_for_everybody_must_be_meant() {
    let folder = TempDir::new().unwrap();
    let refused = program()
        .args(["serve", "--listen", "0.0.0.0:0", "--store"])
        .arg(folder.path())
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(1));
    assert!(told.contains("--token-file") && told.contains("--public"), "{told}");
}
