//! The program: offline, and as a worker of the server.
use std::io::Read;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use guardsplat_engine::testing::tiny;

/// A folder with a tiny CLIP, a sample scene and a key in it.
pub struct Bench(tempfile::TempDir);

impl Bench {
    pub fn new() -> Self {
        let bench = Self(tempfile::tempdir().unwrap());
        tiny::write(&bench.path("clip"));
        std::fs::create_dir(bench.path("work")).unwrap();
        bench.offline("sample in.ply --gaussians 500 --sh-degree 1 --seed 2", 0);
        bench.offline("key create --bits 32 --seed 7 -o k.key --device cpu", 0);
        bench
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap()
    }

    /// What is left of the files of jobs.
    pub fn left(&self) -> usize {
        std::fs::read_dir(self.path("work")).unwrap().count()
    }

    fn command(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_guardsplat-worker"));
        command
            .current_dir(self.0.path())
            .env("GUARDSPLAT_CLIP", self.path("clip"))
            .env("GUARDSPLAT_HOME", self.path("home"))
            .env_remove("RUST_LOG");
        command
    }

    /// Standard output of a command that must exit with `code`.
    pub fn offline(&self, line: &str, code: i32) -> String {
        let output = self.command().args(line.split(' ')).output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{line}: {stderr}");
        String::from_utf8(output.stdout).unwrap()
    }

    /// What a command says that must fail.
    pub fn fails(&self, line: &str) -> String {
        let output = self.command().args(line.split(' ')).output().unwrap();
        assert_eq!(output.status.code(), Some(1), "{line}");
        String::from_utf8(output.stderr).unwrap()
    }

    /// Starts a worker.
    pub fn worker(&self, server: SocketAddr) -> Worker {
        let log = self.path("log");
        let child = self
            .command()
            .args(["run", "--device", "cpu", "--name", "test", "--stop-with-stdin"])
            .args(["--server", &format!("http://{server}"), "--work-dir", "work"])
            .stdin(Stdio::piped())
            .stderr(std::fs::File::create(&log).unwrap())
            .spawn()
            .unwrap();
        Worker { child, log }
    }
}

/// A running worker; killed when the test ends early.
pub struct Worker {
    child: Child,
    log: PathBuf,
}

impl Worker {
    /// Sends SIGTERM.
    pub fn terminate(&self) {
        let kill = Command::new("kill")
            .args(["-TERM", &self.child.id().to_string()])
            .status();
        assert!(kill.unwrap().success());
    }

    /// Ends its standard input.
    pub fn end_stdin(&mut self) {
        drop(self.child.stdin.take());
    }

    /// Waits until it has exited.
    pub fn exit(&mut self) -> ExitStatus {
        let start = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status;
            }
            assert!(start.elapsed() < Duration::from_secs(20), "{}", self.log());
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// What it has logged.
    pub fn log(&self) -> String {
        read(&self.log)
    }
}

fn read(path: &Path) -> String {
    let mut text = String::new();
    std::fs::File::open(path).unwrap().read_to_string(&mut text).unwrap();
    text
}

impl Drop for Worker {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
