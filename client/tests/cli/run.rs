//! Runs the client.
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

use super::fake::Fake;

/// What a picture begins with; the fake server looks no further.
pub const PICTURE: &[u8] = b"\x89PNG\r\n\x1a\n";

/// A folder to run in, and the server to talk to.
pub struct TestEnvironment {
    /// The server.
    pub fake: Fake,
    /// The folder.
    pub folder: TempDir,
    url: String,
}

/// What a run left.
pub struct Ran {
    /// Exit code.
    pub code: i32,
    /// Standard output.
    pub out: String,
    /// Standard error.
    pub err: String,
}

impl Ran {
    /// Standard output as the one JSON document that it must be.
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.out).unwrap_or_else(|e| panic!("{e}: {}\n{}", self.out, self.err))
    }
}

impl TestEnvironment {
    /// A new one.
    pub fn new() -> Self {
        let fake = Fake::start();
        let url = fake.url();
        Self::at(fake, url)
    }

    /// One whose clients use another address.
    pub fn at(fake: Fake, url: String) -> Self {
        Self {
            fake,
            folder: tempfile::tempdir().unwrap(),
            url,
        }
    }

    /// A path in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file into the folder.
    pub fn file(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.path(name), bytes).unwrap();
    }

    /// The names of the files in the folder.
    pub fn files(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.path()).unwrap();
        let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// Runs a line and waits.
    pub fn run(&self, line: &str) -> Ran {
        finish(self.start(line))
    }

    /// Runs a line.
    pub fn start(&self, line: &str) -> Child {
        self.command(line).env("GUARDSPLAT_SERVER", &self.url).spawn().unwrap()
    }

    /// A line to be run, without a server.
    pub fn command(&self, line: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_guardsplat"));
        command
            .args(line.split_whitespace())
            .current_dir(self.folder.path())
            .env_remove("GUARDSPLAT_SERVER")
            .env_remove("GUARDSPLAT_TOKEN")
            .env_remove("GUARDSPLAT_TOKEN_FILE")
            .env("XDG_CONFIG_HOME", self.folder.path().join("config"))
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }
}

/// Waits for what was started.
pub fn finish(child: Child) -> Ran {
    let output = child.wait_with_output().unwrap();
    Ran {
        code: output.status.code().unwrap_or(-1),
        out: String::from_utf8(output.stdout).unwrap(),
        err: String::from_utf8(output.stderr).unwrap(),
    }
}

/// Waits until something holds.
pub fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let start = Instant::now();
    while !holds() {
        assert!(start.elapsed() < Duration::from_secs(20), "waited in vain until {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}
