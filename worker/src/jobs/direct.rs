//! Fetches artifacts from the store that has them, where the server gives an address for that. Whatever goes wrong on
//! this way, the one through the server is left.
use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;
use std::time::Duration;

use guardsplat_proto::v1::{Artifact, GetDownloadUrlRequest};
use sha2::{Digest, Sha256};

use super::server::{Server, within};

/// How long the server may take to make an address.
const CALL: Duration = Duration::from_secs(10);
/// Longest wait for a connection to the store, which may be out of reach from here.
const CONNECT: Duration = Duration::from_secs(5);
/// And for its answer.
const ANSWER: Duration = Duration::from_secs(30);
/// Bytes a second below which a store is too slow.
const LEAST_SPEED: u64 = 1 << 18;

/// Fetches the artifact called `name` into the file at `path`; nothing where that does not work out.
pub async fn download(server: &Server, name: &str, path: &Path) -> Option<Artifact> {
    let request = GetDownloadUrlRequest { name: name.into() };
    let call = "ask where an artifact is";
    let answer = within(CALL, call, server.artifacts().get_download_url(request)).await;
    // A server that is older does not know the call.
    let answer = answer.ok()?;
    let (artifact, url) = (answer.artifact?, answer.url);
    // As safe as the way through the server.
    if !(url.starts_with("https://") || url.starts_with("http://") && !server.is_encrypted()) {
        return None;
    }
    let (size, sha256) = (u64::try_from(artifact.size_bytes).ok()?, artifact.sha256.clone());
    let path = path.to_owned();
    let fetched = tokio::task::spawn_blocking(move || fetch(&url, &path, size, &sha256)).await;
    match fetched.unwrap_or_else(|error| Err(error.to_string())) {
        Ok(()) => Some(artifact),
        Err(reason) => {
            tracing::info!(
                artifact = name,
                reason,
                "the store did not give it; fetched through the server"
            );
            None
        }
    }
}

/// Fetches exactly these bytes. The address is a secret, and not in what is said of an error.
fn fetch(url: &str, path: &Path, size: u64, sha256: &str) -> Result<(), String> {
    let agent = ureq::Agent::config_builder()
        .timeout_connect(Some(CONNECT))
        .timeout_recv_response(Some(ANSWER))
        .timeout_recv_body(Some(ANSWER + Duration::from_secs(size / LEAST_SPEED)))
        .max_redirects(0)
        .build()
        .new_agent();
    let answer = agent.get(url).call().map_err(|error| match error {
        ureq::Error::StatusCode(code) => format!("status {code}"),
        _ => "no answer".to_owned(),
    })?;
    let mut body = answer.into_body().into_with_config().limit(u64::MAX).reader();
    let mut file = File::create(path).map_err(|error| error.to_string())?;
    let (mut hash, mut bytes, mut buffer) = (Sha256::new(), 0, vec![0; 1 << 16]);
    loop {
        let read = body
            .read(&mut buffer)
            .map_err(|_| format!("it broke off after {bytes} bytes"))?;
        let chunk = buffer.get(..read).unwrap_or_default();
        if chunk.is_empty() {
            break;
        }
        bytes += read as u64;
        if bytes > size {
            return Err(format!("more bytes than the {size} announced"));
        }
        hash.update(chunk);
        file.write_all(chunk).map_err(|error| error.to_string())?;
    }
    match bytes == size && hex::encode(hash.finalize()).eq_ignore_ascii_case(sha256) {
        true => file.flush().map_err(|error| error.to_string()),
        false => Err(format!("{bytes} bytes that are not the {size} announced")),
    }
}

#[cfg(test)]
mod tests {
    use std::io::{BufRead, BufReader};
    use std::net::TcpListener;

    use super::*;

    /// A store that gives one answer; its address.
    fn store(answer: Vec<u8>) -> String {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let url = format!(
            "http://{}/bucket/object?signature=secret",
            listener.local_addr().unwrap()
        );
        std::thread::spawn(move || {
            let (mut stream, _) = listener.accept().unwrap();
            let lines = BufReader::new(stream.try_clone().unwrap()).lines();
            // To the end of the request, which has no body.
            lines
                .map(Result::unwrap)
                .take_while(|line| !line.is_empty())
                .for_each(drop);
            stream.write_all(&answer).unwrap();
        });
        url
    }

    fn answer(status: &str, length: usize, body: &[u8]) -> Vec<u8> {
        let head = format!("HTTP/1.1 {status}\r\ncontent-length: {length}\r\nconnection: close\r\n\r\n");
        [head.as_bytes(), body].concat()
    }

    #[test]
    fn only_the_announced_bytes_are_taken() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene");
        let bytes = vec![7; 200_000];
        let sha256 = hex::encode(Sha256::digest(&bytes));
        let size = bytes.len() as u64;
        fetch(&store(answer("200 OK", bytes.len(), &bytes)), &path, size, &sha256).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), bytes);

        let mut changed = bytes.clone();
        changed[100_000] ^= 1;
        let longer = [&bytes[..], &[7]].concat();
        for (what, given, told) in [
            ("changed", answer("200 OK", bytes.len(), &changed), "not the 200000"),
            ("cut", answer("200 OK", bytes.len(), &bytes[..150_000]), "broke off"),
            ("short", answer("200 OK", 150_000, &bytes[..150_000]), "150000 bytes"),
            ("longer", answer("200 OK", longer.len(), &longer), "more bytes"),
            ("expired", answer("403 Forbidden", 0, b""), "status 403"),
            (
                "elsewhere",
                answer("302 Found\r\nlocation: http://127.0.0.1:1/", 0, b""),
                "",
            ),
        ] {
            let reason = fetch(&store(given), &path, size, &sha256).expect_err(what);
            assert!(reason.contains(told) && !reason.contains("secret"), "{what}: {reason}");
        }
    }
}
