//! Supervision of real processes: shell scripts that stand for the worker.
use std::fs;
use std::os::unix::fs::PermissionsExt;

use tempfile::TempDir;

use super::*;

const SOON: Duration = Duration::from_secs(10);
const QUICK: Backoff = Backoff {
    first: Duration::from_millis(20),
    longest: Duration::from_millis(200),
    well_after: Duration::from_secs(60),
};

/// A folder in which a script writes what happens to it.
struct Bench(TempDir);

impl Bench {
    fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    fn worker(&self, script: &str) -> WorkerProcess {
        let arguments = ["-c", script, "worker", self.0.path().to_str().unwrap()]
            .map(OsString::from)
            .to_vec();
        WorkerProcess {
            program: "/bin/sh".into(),
            arguments,
            token: None,
        }
    }

    /// What the script wrote to `log`.
    fn log(&self) -> String {
        fs::read_to_string(self.0.path().join("log")).unwrap_or_default()
    }

    async fn until(&self, done: impl Fn(&str) -> bool) -> String {
        let begin = Instant::now();
        while begin.elapsed() < SOON {
            let log = self.log();
            if done(&log) {
                return log;
            }
            sleep(Duration::from_millis(10)).await;
        }
        panic!("the worker wrote {:?}", self.log());
    }
}

fn is_alive(pid: i32) -> bool {
    // Signal 0 only asks. A zombie would count as alive, so this also shows that the child was waited for.
    kill(Pid::from_raw(pid), None).is_ok()
}

#[tokio::test]
async fn a_worker_that_dies_is_started_again_with_growing_pauses() {
    let bench = Bench::new();
    let begin = Instant::now();
    let worker = EmbeddedWorker::start(bench.worker("echo $$ >> $1/log; exit 7"), QUICK);
    let log = bench.until(|log| log.lines().count() >= 5).await;
    // 20, 40, 80 and 160 ms.
    assert!(
        begin.elapsed() >= Duration::from_millis(300),
        "restarted in a rush: {:?}",
        begin.elapsed()
    );
    let pids: std::collections::HashSet<_> = log.lines().collect();
    assert_eq!(pids.len(), log.lines().count());
    worker.stop(SOON).await;
    let after = bench.log();
    sleep(Duration::from_millis(400)).await;
    assert_eq!(bench.log(), after, "started again after the stop");
}

#[tokio::test]
async fn a_worker_that_was_well_is_started_again_at_once() {
    let bench = Bench::new();
    let backoff = Backoff {
        longest: Duration::from_secs(3600),
        well_after: Duration::from_millis(30),
        ..QUICK
    };
    let worker = EmbeddedWorker::start(bench.worker("echo x >> $1/log; sleep 0.05"), backoff);
    // The twelfth pause would be 40 s.
    bench.until(|log| log.lines().count() >= 12).await;
    worker.stop(SOON).await;
}

#[tokio::test]
async fn a_worker_is_asked_to_end_and_given_time() {
    let bench = Bench::new();
    let script = "trap 'echo handing back >> $1/log; sleep 0.2; echo handed back >> $1/log; exit 0' TERM
        echo ready $$ >> $1/log; while :; do sleep 0.02; done";
    let worker = EmbeddedWorker::start(bench.worker(script), QUICK);
    let log = bench.until(|log| log.starts_with("ready")).await;
    let pid = log.trim().strip_prefix("ready ").unwrap().parse().unwrap();
    assert!(is_alive(pid));
    worker.stop(SOON).await;
    assert!(bench.log().ends_with("handing back\nhanded back\n"), "{}", bench.log());
    assert!(!is_alive(pid));
}

#[tokio::test]
async fn a_worker_that_does_not_end_is_killed() {
    let bench = Bench::new();
    let script = "trap '' TERM; echo $$ >> $1/log; while :; do sleep 0.02; done";
    let worker = EmbeddedWorker::start(bench.worker(script), QUICK);
    let pid = bench.until(|log| log.ends_with('\n')).await.trim().parse().unwrap();
    let begin = Instant::now();
    worker.stop(Duration::from_millis(200)).await;
    assert!(begin.elapsed() >= Duration::from_millis(200) && begin.elapsed() < SOON);
    assert!(!is_alive(pid));
}

/// The pipe stays open while the server lives, and ends when the server's end of it is gone.
#[tokio::test]
async fn standard_input_stays_open_and_empty() {
    let bench = Bench::new();
    let worker = EmbeddedWorker::start(
        bench.worker("echo ready >> $1/log; cat >> $1/log; echo ended >> $1/log"),
        QUICK,
    );
    bench.until(|log| log == "ready\n").await;
    sleep(Duration::from_millis(200)).await;
    assert_eq!(bench.log(), "ready\n");
    worker.stop(SOON).await;
    assert_eq!(bench.log(), "ready\n");
}

#[test]
fn the_worker_never_sees_the_master_key() {
    let command = Bench::new().worker("").command().unwrap();
    for secret in [MASTER_KEY_VARIABLE, DATABASE_VARIABLE, "PGPASSWORD"] {
        let mut set = command.as_std().get_envs();
        assert!(set.any(|(name, value)| name == secret && value.is_none()), "{secret}");
    }
}

#[tokio::test]
async fn a_program_that_cannot_be_started_is_tried_again() {
    let bench = Bench::new();
    let program = bench.0.path().join("worker");
    let worker = WorkerProcess {
        program: program.clone(),
        arguments: Vec::new(),
        token: None,
    };
    let worker = EmbeddedWorker::start(worker, QUICK);
    sleep(Duration::from_millis(50)).await;
    let staged = bench.0.path().join("staged");
    fs::write(
        &staged,
        format!(
            "#!/bin/sh\necho up >> {}/log; exec sleep 60\n",
            bench.0.path().display()
        ),
    )
    .unwrap();
    fs::set_permissions(&staged, fs::Permissions::from_mode(0o755)).unwrap();
    fs::rename(staged, program).unwrap();
    bench.until(|log| log == "up\n").await;
    worker.stop(SOON).await;
}

#[test]
fn the_command_line_is_the_workers() {
    let binary = std::env::current_exe().unwrap();
    let settings = Settings {
        worker_binary: Some(binary.clone()),
        ..Settings::default()
    };
    let worker = WorkerProcess::new(&settings, "0.0.0.0:7001".parse().unwrap()).unwrap();
    assert_eq!(worker.program, binary);
    let name = worker.arguments.last().unwrap().to_str().unwrap();
    let shown: Vec<_> = worker.arguments.iter().map(|a| a.to_str().unwrap()).collect();
    let expected = [
        "run",
        "--server",
        "http://127.0.0.1:7001",
        "--stop-with-stdin",
        "--device",
        "auto",
        "--name",
        name,
    ];
    assert_eq!(shown, expected);
    let limited = Settings {
        max_job_memory_mebibytes: 2048,
        ..settings
    };
    let limited = WorkerProcess::new(&limited, "0.0.0.0:7001".parse().unwrap()).unwrap();
    let shown: Vec<_> = limited.arguments.iter().map(|a| a.to_str().unwrap()).collect();
    let memory = ["--memory", "2048"];
    assert_eq!(shown, [&expected[..6], &memory, &expected[6..]].concat());
    assert!(name.starts_with("embedded-") && name.ends_with(&std::process::id().to_string()) && name.len() <= 63);
    for (listens, reached) in [
        ("[::]:1", "[::1]:1"),
        ("127.0.0.1:2", "127.0.0.1:2"),
        ("10.1.2.3:4", "10.1.2.3:4"),
        ("[fd00::1]:5", "[fd00::1]:5"),
    ] {
        assert_eq!(reachable(listens.parse().unwrap()), reached.parse().unwrap());
    }
}

#[test]
fn a_missing_program_is_told_at_the_start() {
    let settings = Settings {
        worker_binary: Some("/nowhere/worker".into()),
        ..Settings::default()
    };
    let error = WorkerProcess::new(&settings, "127.0.0.1:1".parse().unwrap())
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("/nowhere/worker") && error.contains("worker_binary"),
        "{error}"
    );
}
