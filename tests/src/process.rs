//! Processes that a test starts, and none of which outlives it.
use std::fs::OpenOptions;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// By then whatever is waited for has happened, however busy the machine. Only tests that fail wait for so long.
pub const SOON: Duration = Duration::from_secs(300);

/// Asks until there is an answer.
///
/// # Panics
/// When there still is none after minutes.
#[track_caller]
pub fn until<T>(what: &str, mut ask: impl FnMut() -> Option<T>) -> T {
    let begin = Instant::now();
    loop {
        if let Some(answer) = ask() {
            return answer;
        }
        assert!(begin.elapsed() < SOON, "waited in vain until {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// A running program. It is killed with the value.
pub struct Process {
    child: Child,
    // Some programs end when their standard input does.
    stdin: Option<ChildStdin>,
    log: PathBuf,
}

impl Process {
    /// Starts a program whose standard error is appended to the file `log`; standard output too, unless it is a pipe.
    ///
    /// # Panics
    /// When it can't be started.
    pub fn start(command: &mut Command, log: &Path) -> Self {
        let file = OpenOptions::new().create(true).append(true).open(log);
        let file = file.expect("the log can be written");
        let mut child = command
            .stdin(Stdio::piped())
            .stderr(file)
            .spawn()
            .unwrap_or_else(|e| panic!("{command:?}: {e}"));
        Self {
            stdin: child.stdin.take(),
            child,
            log: log.into(),
        }
    }

    /// Its number.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Its standard output, if that is a pipe and was not taken before.
    pub fn stdout(&mut self) -> Option<std::process::ChildStdout> {
        self.child.stdout.take()
    }

    /// What it has logged, and those before it in the same file.
    pub fn log(&self) -> String {
        String::from_utf8_lossy(&std::fs::read(&self.log).unwrap_or_default()).into_owned()
    }

    /// Sends a signal, such as `TERM`.
    ///
    /// # Panics
    /// When that is not possible.
    pub fn signal(&self, signal: &str) {
        let script = "kill -s \"$0\" \"$1\"";
        let status = Command::new("sh")
            .args(["-c", script, signal, &self.id().to_string()])
            .status();
        assert!(status.expect("a shell").success(), "{signal} was not delivered");
    }

    /// Waits for its end.
    ///
    /// # Panics
    /// When it does not end soon.
    #[track_caller]
    pub fn wait(&mut self) -> ExitStatus {
        let begin = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().expect("a child can be waited for") {
                return status;
            }
            assert!(begin.elapsed() < SOON, "it does not end: {}", self.log());
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Kills it with SIGKILL.
    pub fn kill(&mut self) {
        // It may have ended by itself, which is as good.
        let _ = self.child.kill();
        let _ = self.child.wait();
        self.stdin = None;
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
    }
}
