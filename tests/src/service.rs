//! The service of a test: a server with data of its own, workers, and the client.
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use tonic::transport::Channel;

use crate::process::{SOON, until};
use crate::{Process, TestEnvironment, program};

/// A server on a port of its own, whose data lies in the folder of a environment.
pub struct Service {
    /// The folder.
    pub environment: TestEnvironment,
    /// How long a run of the client may take.
    pub patience: Duration,
    /// Variables of the client: its token, a CA.
    pub client_variables: Vec<(String, String)>,
    /// Variables of workers.
    pub worker_variables: Vec<(String, String)>,
    flags: Vec<String>,
    address: String,
    encrypted: bool,
    server: Option<Process>,
}

impl Service {
    /// Starts a server with these flags; without a worker of its own unless they say so.
    ///
    /// # Panics
    /// When it does not come up.
    pub fn start(environment: TestEnvironment, flags: &str) -> Self {
        let mut service = Self {
            environment,
            patience: SOON,
            client_variables: Vec::new(),
            worker_variables: Vec::new(),
            flags: flags.split_whitespace().map(str::to_owned).collect(),
            address: "127.0.0.1:0".into(),
            encrypted: false,
            server: None,
        };
        service.restart();
        service
    }

    /// Starts the server again, where it was, once it has ended.
    ///
    /// # Panics
    /// When it does not come up.
    #[track_caller]
    pub fn restart(&mut self) {
        let mut command = self.environment.command(&program("guardsplat-server"));
        command
            .args(["--listen", &self.address, "--data-dir", "data"])
            .args(["--embedded-worker", "false", "--worker-device", "cpu"])
            .args(&self.flags)
            .stdout(Stdio::piped());
        let mut server = Process::start(&mut command, &self.environment.path("server.log"));
        let mut line = String::new();
        let stdout = server.stdout().expect("a pipe, and it was not taken");
        BufReader::new(stdout).read_line(&mut line).expect("it prints text");
        let url = line
            .trim()
            .strip_prefix("listening on ")
            .and_then(|url| url.split_once("://"));
        let (scheme, address) = url.unwrap_or_else(|| panic!("{}", server.log()));
        self.encrypted = scheme == "https";
        self.address = address.into();
        self.server = Some(server);
    }

    /// The server's process.
    ///
    /// # Panics
    /// When it is not running.
    pub fn server(&mut self) -> &mut Process {
        self.server.as_mut().expect("the server runs")
    }

    /// Kills the server with SIGKILL.
    pub fn kill(&mut self) {
        self.server().kill();
        self.server = None;
    }

    /// What the server has logged.
    pub fn log(&self) -> String {
        String::from_utf8_lossy(&self.environment.read("server.log")).into_owned()
    }

    /// Address and port.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// Where programs find it. Certificates are made out to `localhost`.
    pub fn url(&self) -> String {
        let port = self.address.rsplit(':').next().unwrap_or_default();
        match self.encrypted {
            true => format!("https://localhost:{port}"),
            false => format!("http://{}", self.address),
        }
    }

    /// A connection.
    ///
    /// # Panics
    /// When there is none.
    pub async fn channel(&self) -> Channel {
        let endpoint = Channel::from_shared(format!("http://{}", self.address)).expect("an address");
        endpoint.connect().await.expect("the server answers")
    }

    /// Starts a worker, which logs to a file of its name.
    pub fn worker(&self, name: &str) -> Process {
        let mut command = self.environment.command(&crate::worker());
        command.args(["run", "--device", "cpu", "--name", name, "--server"]);
        command.arg(self.url()).envs(self.worker_variables.iter().cloned());
        Process::start(&mut command, &self.environment.path(format!("{name}.log")))
    }

    /// The client, to be run with the words of `line`.
    pub fn client_command(&self, line: &str) -> Command {
        let mut command = self.environment.command(&program("guardsplat"));
        command
            .env("GUARDSPLAT_SERVER", self.url())
            .envs(self.client_variables.iter().cloned())
            .args(line.split_whitespace())
            .stdin(Stdio::null());
        command
    }

    /// Runs the client.
    ///
    /// # Panics
    /// When it can't be started, or does not end in time.
    #[track_caller]
    pub fn client(&self, line: &str) -> Output {
        let [mut out, mut err] = [(); 2].map(|()| tempfile::tempfile().expect("the temporary folder is writable"));
        let clone = |file: &File| Stdio::from(file.try_clone().expect("a file"));
        let mut command = self.client_command(line);
        command.stdout(clone(&out)).stderr(clone(&err));
        let mut child = command.spawn().expect("the client starts");
        let begin = Instant::now();
        let status = loop {
            if let Some(status) = child.try_wait().expect("a child can be waited for") {
                break status;
            }
            if begin.elapsed() > self.patience {
                let _ = child.kill();
                panic!("{line} does not end\n{}", self.log());
            }
            std::thread::sleep(Duration::from_millis(5));
        };
        let [stdout, stderr] = [&mut out, &mut err].map(|file| {
            let mut bytes = Vec::new();
            file.rewind().expect("a file");
            file.read_to_end(&mut bytes).expect("a file");
            bytes
        });
        Output { status, stdout, stderr }
    }

    /// What the client prints as JSON, which must exit with `code`.
    ///
    /// # Panics
    /// When it exits otherwise or prints something else.
    #[track_caller]
    pub fn json(&self, line: &str, code: i32) -> Value {
        let output = self.client(&format!("--json {line}"));
        let [text, log] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes));
        assert_eq!(output.status.code(), Some(code), "{line}: {log}{text}");
        serde_json::from_str(&text).unwrap_or_else(|e| panic!("{line}: {e}: {text}"))
    }

    /// Submits a job and leaves it; gives its name.
    ///
    /// # Panics
    /// When it is refused.
    #[track_caller]
    pub fn submit(&self, line: &str) -> String {
        let job = self.json(&format!("{line} --no-wait"), 0);
        job["name"].as_str().expect("a job has a name").into()
    }

    /// A job as it stands.
    ///
    /// # Panics
    /// When it can't be read.
    #[track_caller]
    pub fn job(&self, name: &str) -> Value {
        self.json(&format!("jobs get {name}"), 0)
    }

    /// Waits until a job is in a state.
    ///
    /// # Panics
    /// When it is over before, or does not get there soon.
    #[track_caller]
    pub fn reaches(&self, name: &str, state: &str) -> Value {
        until(&format!("{name} is {state}"), || {
            let job = self.job(name);
            let over = !job["end_time"].is_null() && job["state"] != state;
            assert!(!over, "{job}\n{}", self.log());
            (job["state"] == state).then_some(job)
        })
    }

    /// Waits until an attempt at an embedding has taken some steps.
    ///
    /// # Panics
    /// When it is over before, or does not get there soon.
    #[track_caller]
    pub fn is_embedding(&self, name: &str, attempt: i64) -> Value {
        until(&format!("attempt {attempt} at {name} takes steps"), || {
            let job = self.job(name);
            assert!(job["end_time"].is_null(), "{job}\n{}", self.log());
            let steps = job["attempt"] == attempt
                && job["state"] == "running"
                && job["progress"]["stage"] == "optimising"
                && job["progress"]["done"].as_i64() > Some(0);
            steps.then_some(job)
        })
    }

    /// Sizes of all files that the server keeps for artifacts and keys, also those that are half there.
    pub fn kept(&self) -> Vec<u64> {
        let mut sizes = Vec::new();
        let mut folders = vec![self.environment.path("data/artifacts")];
        while let Some(folder) = folders.pop() {
            // What is gone between two looks is not kept.
            for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
                match entry.metadata() {
                    Ok(metadata) if metadata.is_dir() => folders.push(entry.path()),
                    // It says whose the others are.
                    Ok(_) if entry.file_name() == "ledger" || entry.file_name() == "generation" => {}
                    Ok(metadata) => sizes.push(metadata.len()),
                    Err(_) => {}
                }
            }
        }
        sizes
    }

    /// Waits until so many files are kept.
    ///
    /// # Panics
    /// When it does not come to that.
    #[track_caller]
    pub fn keeps(&self, files: usize) {
        until(&format!("{files} files are kept"), || {
            let kept = self.kept().len();
            (kept == files).then_some(())
        });
    }
}
