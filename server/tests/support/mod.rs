//! Starts the server's program on folders and ports of its own.
pub mod postgres;
pub mod s3;

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;
use std::process::{ExitStatus, Stdio};
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use tempfile::TempDir;
use tokio::io::{AsyncBufReadExt, BufReader};
use tokio::process::{Child, Command};
use tokio::time::{sleep, timeout};
use tonic::transport::Channel;

/// By then whatever is waited for has happened.
pub const SOON: Duration = Duration::from_secs(20);

/// Asks until the answer is right.
pub async fn until(ask: impl Fn() -> String, right: impl Fn(&str) -> bool) -> String {
    let begin = Instant::now();
    loop {
        let answer = ask();
        if right(&answer) {
            return answer;
        }
        assert!(begin.elapsed() < SOON, "still {answer:?}");
        sleep(Duration::from_millis(10)).await;
    }
}

/// A data folder, and what stands for the worker.
pub struct Bench {
    folder: TempDir,
    variables: Vec<(String, String)>,
    /// Most files that the server may have open, if that is not left to the system.
    files: Option<u64>,
}

impl Bench {
    pub fn new() -> Self {
        Self {
            folder: TempDir::new().unwrap(),
            variables: Vec::new(),
            files: None,
        }
    }

    /// Bounds the files, connections among them, that the server may have open.
    #[allow(dead_code)] // the tests of faults do so
    pub fn may_open(&mut self, files: u64) {
        self.files = Some(files);
    }

    /// Sets a variable of the server's environment.
    pub fn variable(&mut self, name: &str, value: &str) {
        self.variables.push((name.into(), value.into()));
    }

    pub fn data(&self) -> PathBuf {
        self.folder.path().join("data")
    }

    /// Where a worker's script writes.
    pub fn log_path(&self) -> PathBuf {
        self.folder.path().join("log")
    }

    pub fn log(&self) -> String {
        fs::read_to_string(self.log_path()).unwrap_or_default()
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let program = env!("CARGO_BIN_EXE_guardsplat-server");
        let mut command = match self.files {
            None => Command::new(program),
            Some(files) => {
                let mut shell = Command::new("sh");
                shell.args(["-c", &format!("ulimit -n {files} && exec \"$0\" \"$@\""), program]);
                shell
            }
        };
        for (name, _) in std::env::vars_os() {
            if name.to_string_lossy().starts_with("GUARDSPLAT_") {
                command.env_remove(name);
            }
        }
        command
            .args([
                "--listen",
                "127.0.0.1:0",
                "--embedded-worker",
                "false",
                "--stop-seconds",
                "2",
                "--data-dir",
            ])
            .arg(self.data())
            .args(arguments)
            .env("LOG", self.log_path())
            .envs(self.variables.iter().cloned())
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .kill_on_drop(true);
        command
    }

    /// What servers that came up logged.
    pub fn server_log(&self) -> String {
        String::from_utf8_lossy(&fs::read(self.folder.path().join("server.log")).unwrap_or_default()).into_owned()
    }

    /// Starts a server, whether or not it will listen.
    pub fn begin(&self, arguments: &[&str]) -> Server {
        // A file, because a pipe that nobody reads fills up.
        let path = self.folder.path().join("server.log");
        let log = fs::OpenOptions::new().append(true).create(true).open(path).unwrap();
        Server {
            child: self.command(arguments).stderr(log).spawn().unwrap(),
            address: String::new(),
        }
    }

    /// Starts a server with these arguments, which go before those that all have.
    pub async fn start_as(&self, arguments: &[&str]) -> Server {
        let Server { mut child, .. } = self.begin(arguments);
        let mut line = String::new();
        let mut stdout = BufReader::new(child.stdout.take().unwrap());
        timeout(SOON, stdout.read_line(&mut line)).await.unwrap().unwrap();
        let address = line
            .trim()
            .rsplit_once("://")
            .map(|(_, address)| address)
            .unwrap_or_else(|| {
                panic!("said {line:?} and {}", self.server_log());
            });
        Server {
            child,
            address: address.into(),
        }
    }

    /// Starts a server that is expected not to come up, and returns what it says.
    pub async fn fails(&self, arguments: &[&str]) -> (ExitStatus, String) {
        let output = timeout(SOON, self.command(arguments).stderr(Stdio::piped()).output())
            .await
            .unwrap()
            .unwrap();
        let text = String::from_utf8(output.stderr).unwrap();
        // The log comes before.
        let last = text.lines().last().unwrap_or_default().to_owned();
        (output.status, last)
    }

    /// Runs the program to its end: exit status, standard output and standard error.
    pub async fn says(&self, arguments: &[&str]) -> (ExitStatus, String, String) {
        let output = timeout(SOON, self.command(arguments).stderr(Stdio::piped()).output()).await;
        let output = output.unwrap().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        (output.status, text(output.stdout), text(output.stderr))
    }

    /// All files that the server keeps.
    pub fn kept(&self) -> Vec<PathBuf> {
        let mut folders = vec![self.data()];
        let mut files = Vec::new();
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() { &mut folders } else { &mut files }.push(path);
            }
        }
        files
    }

    pub async fn start(&self) -> Server {
        self.start_as(&[]).await
    }

    /// Starts a server whose worker is a shell script.
    pub async fn start_with_worker(&self, script: &str) -> Server {
        let program = self.folder.path().join("worker");
        fs::write(&program, format!("#!/bin/sh\n{script}\n")).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        let program = program.to_str().unwrap();
        let arguments = [
            "--embedded-worker",
            "true",
            "--worker-device",
            "cpu",
            "--worker-binary",
            program,
        ];
        self.start_as(&arguments).await
    }
}

/// A server that listens.
pub struct Server {
    child: Child,
    address: String,
}

impl Server {
    pub fn address(&self) -> &str {
        &self.address
    }

    #[allow(dead_code)] // the tests of faults look at its memory
    pub fn pid(&self) -> u32 {
        self.child.id().unwrap()
    }

    pub async fn channel(&self) -> Channel {
        Channel::from_shared(format!("http://{}", self.address))
            .unwrap()
            .connect()
            .await
            .unwrap()
    }

    pub fn signal(&self, signal: Signal) {
        let pid = self.child.id().unwrap().try_into().unwrap();
        kill(Pid::from_raw(pid), signal).unwrap();
    }

    /// Waits for the end.
    pub async fn ended(mut self) -> ExitStatus {
        timeout(SOON, self.child.wait()).await.unwrap().unwrap()
    }

    pub async fn stop(self) -> ExitStatus {
        self.signal(Signal::SIGTERM);
        self.ended().await
    }

    pub async fn kill(self) -> ExitStatus {
        self.signal(Signal::SIGKILL);
        self.ended().await
    }
}
