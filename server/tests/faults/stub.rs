//! A worker that computes nothing: it leases, fetches, reports, stores and completes as a real one does, over the same
//! API, and takes the time in between that it is told.
//!
//! As a process of its own ([`process`]) it kills itself, `kill -9`, once for each job whose display name has the point
//! and a seed. [`POINTS`] are all of them.
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::progress::Stage;
use guardsplat_proto::v1::verify_result::Verdict;
use guardsplat_proto::v1::{
    DownloadKeyRequest, EmbedResult, FailJobRequest, Job, Key, KeyOutput, KeyResult, Progress, ReleaseJobRequest,
    ReportJobRequest, VerifyResult, failure::Reason,
};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use sha2::{Digest, Sha256};
use tokio::process::{Child, Command};
use tokio::time::{Instant, sleep};
use tonic::{Code, Status};

use crate::caller::{Caller, passes, persist};

/// Where the process may die.
pub const POINTS: [&str; 12] = [
    "leased",
    "amid the download",
    "with the key",
    "after a report",
    "amid a report",
    "amid an output",
    "with one output stored",
    "with all outputs stored",
    "amid the completion",
    "after the completion",
    "amid a failure",
    "amid a release",
];

/// How a stub works.
#[derive(Clone)]
pub struct Stub {
    pub caller: Caller,
    pub name: String,
    /// How long each job takes.
    pub takes: Duration,
    /// Where it notes for which jobs it has died; it does not where there is no place for that.
    pub graves: Option<PathBuf>,
}

/// Why an attempt ended early.
enum Ended {
    /// It is somebody else's job now, or nobody's.
    Lost,
    /// Its end was asked for.
    Cancelled,
}

type Attempt<T> = Result<T, Ended>;

impl Stub {
    pub fn new(caller: Caller, name: &str, takes: Duration) -> Self {
        Self {
            caller,
            name: name.into(),
            takes,
            graves: None,
        }
    }

    /// One job after the other until it is told to stop.
    pub async fn serve(self, stop: Arc<AtomicBool>) {
        while !stop.load(Ordering::Relaxed) {
            let lease = persist(|| self.caller.lease(&self.name, Duration::from_millis(500))).await;
            let lease = lease.unwrap_or_else(|status| panic!("{status}"));
            if let Some(job) = lease.job {
                self.attempt(&job, &lease.lease_token).await;
            }
        }
    }

    /// Whether this process is to end here, if none did before for this job.
    fn ends_at(&self, job: &Job, point: &str) -> bool {
        let here = job.display_name.split(';').next() == Some(point);
        here && self.grave(job).is_some_and(|grave| !grave.exists())
    }

    fn grave(&self, job: &Job) -> Option<PathBuf> {
        let id = job.name.strip_prefix("jobs/")?;
        Some(self.graves.as_ref()?.join(id))
    }

    fn dies_at(&self, job: &Job, point: &str) {
        if self.ends_at(job, point) {
            self.die(job);
        }
    }

    /// The end of this process, without a word to the server.
    fn die(&self, job: &Job) -> ! {
        std::fs::write(self.grave(job).unwrap(), "").unwrap();
        let _ = kill(Pid::this(), Signal::SIGKILL);
        unreachable!("killed")
    }

    /// Does `call`, and dies while it is under way: at once, or so late that the answer may be on its way.
    async fn dies_amid<T>(&self, job: &Job, point: &str, call: impl Future<Output = T>) -> T {
        if self.ends_at(job, point) {
            let seed = job.display_name.rsplit(' ').next().and_then(|seed| seed.parse().ok());
            let late = Duration::from_micros(400 * seed.unwrap_or(0_u64));
            tokio::select! {
                _ = call => {}
                () = sleep(late) => {}
            }
            self.die(job);
        }
        call.await
    }

    /// Carries out a job, whatever comes of it.
    pub async fn attempt(&self, job: &Job, token: &str) {
        if let Err(Ended::Cancelled) = self.carry_out(job, token).await {
            let request = FailJobRequest {
                name: job.name.clone(),
                lease_token: token.into(),
                cancelled: true,
                ..FailJobRequest::default()
            };
            let worker = &self.caller.worker;
            // Refused when the first answer was lost.
            let _ = persist(|| async { worker.clone().fail_job(request.clone()).await }).await;
        }
    }

    async fn carry_out(&self, job: &Job, token: &str) -> Attempt<()> {
        let (caller, of) = (&self.caller, (job.name.as_str(), token));
        self.dies_at(job, "leased");
        if let Some(Spec::Embed(spec)) = &job.spec {
            let download = persist(|| caller.download(&spec.scene));
            lost(self.dies_amid(job, "amid the download", download).await)?;
            lost(persist(|| key_file(caller, of)).await)?;
            self.dies_at(job, "with the key");
        }
        self.report(job, token, 1).await?;
        self.dies_at(job, "after a report");
        self.dies_amid(job, "amid a report", self.report(job, token, 2)).await?;
        let begun = Instant::now();
        while let Some(left) = self.takes.checked_sub(begun.elapsed()).filter(|left| !left.is_zero()) {
            sleep(left.min(Duration::from_millis(200))).await;
            if self.takes > Duration::from_secs(1) {
                self.report(job, token, 3).await?;
            }
        }
        if self.ends_at(job, "amid a failure") {
            let mut worker = caller.worker.clone();
            let failure = guardsplat_proto::v1::Failure {
                reason: Reason::Internal.into(),
                message: "it dies while it says so".into(),
            };
            let request = FailJobRequest {
                name: job.name.clone(),
                lease_token: token.into(),
                failure: Some(failure),
                retryable: true,
                cancelled: false,
                ..FailJobRequest::default()
            };
            let _ = self.dies_amid(job, "amid a failure", worker.fail_job(request)).await;
        }
        if self.ends_at(job, "amid a release") {
            let release = release(caller, of);
            let _ = self.dies_amid(job, "amid a release", release).await;
        }
        let result = lost(self.store(job, token).await)?;
        let complete = persist(|| caller.complete(of, result.clone()));
        lost(self.dies_amid(job, "amid the completion", complete).await)?;
        self.dies_at(job, "after the completion");
        Ok(())
    }

    /// Stores what came out, dying in between where that is wanted.
    async fn store(&self, job: &Job, token: &str) -> Result<Output, Status> {
        let (caller, of) = (&self.caller, (job.name.as_str(), token));
        let Some(Spec::Embed(_)) = &job.spec else {
            return result_of(caller, job, token).await;
        };
        let marked = marked(job);
        if self.ends_at(job, "amid an output") {
            let slow = caller.output(of, &marked, false, Duration::from_millis(2));
            self.dies_amid(job, "amid an output", slow).await?;
        }
        let scene = persist(|| caller.output(of, &marked, false, Duration::ZERO)).await?;
        self.dies_at(job, "with one output stored");
        let comparison = persist(|| caller.output(of, b"a picture", false, Duration::ZERO)).await?;
        self.dies_at(job, "with all outputs stored");
        Ok(Output::EmbedResult(EmbedResult {
            scene,
            comparison,
            ..EmbedResult::default()
        }))
    }

    async fn report(&self, job: &Job, token: &str, done: i64) -> Attempt<()> {
        let mut progress = Progress {
            done,
            total: 9,
            ..Progress::default()
        };
        progress.set_stage(Stage::Optimising);
        let request = ReportJobRequest {
            name: job.name.clone(),
            lease_token: token.into(),
            progress: Some(progress),
        };
        let worker = &self.caller.worker;
        let report = persist(|| async { worker.clone().report_job(request.clone()).await }).await;
        match lost(report)?.into_inner().cancel_requested {
            true => Err(Ended::Cancelled),
            false => Ok(()),
        }
    }
}

/// What the marked scene of an attempt holds: by it one knows whose it is, and whether it is whole.
pub fn marked(job: &Job) -> Vec<u8> {
    format!("{} attempt {}; ", job.name, job.attempt)
        .repeat(3000)
        .into_bytes()
}

/// Stores what a job of this kind makes, and says so.
pub async fn complete(caller: &Caller, job: &Job, token: &str) -> Result<(), Status> {
    let result = result_of(caller, job, token).await?;
    caller.complete((&job.name, token), result).await
}

/// What comes out of a job, with its outputs stored.
pub async fn result_of(caller: &Caller, job: &Job, token: &str) -> Result<Output, Status> {
    let of = (job.name.as_str(), token);
    match &job.spec {
        Some(Spec::CreateKey(spec)) => {
            let key = Key {
                bits: spec.bits,
                clip: "stub".into(),
                clip_sha256: hex::encode(Sha256::digest("stub")),
                seeded: spec.seed.is_some(),
                ..Key::default()
            };
            Ok(Output::KeyOutput(KeyOutput {
                key_file: caller.output(of, b"a key file", true, Duration::ZERO).await?,
                key: Some(key),
                result: Some(KeyResult::default()),
            }))
        }
        Some(Spec::Embed(_)) => Ok(Output::EmbedResult(EmbedResult {
            scene: caller.output(of, &marked(job), false, Duration::ZERO).await?,
            comparison: caller.output(of, b"a picture", false, Duration::ZERO).await?,
            ..EmbedResult::default()
        })),
        _ => {
            let mut result = VerifyResult::default();
            result.set_verdict(Verdict::Inconclusive);
            Ok(Output::VerifyResult(result))
        }
    }
}

/// Fetches the key file of a job.
pub async fn key_file(caller: &Caller, of: (&str, &str)) -> Result<Vec<u8>, Status> {
    let request = DownloadKeyRequest {
        job: of.0.into(),
        lease_token: of.1.into(),
    };
    let mut chunks = caller.worker.clone().download_key(request).await?.into_inner();
    let mut bytes = Vec::new();
    while let Some(message) = chunks.message().await? {
        bytes.extend(message.chunk);
    }
    Ok(bytes)
}

pub async fn release(caller: &Caller, of: (&str, &str)) -> Result<(), Status> {
    let request = ReleaseJobRequest {
        name: of.0.into(),
        lease_token: of.1.into(),
    };
    caller.worker.clone().release_job(request).await.map(|_| ())
}

fn lost<T>(answer: Result<T, Status>) -> Attempt<T> {
    answer.map_err(|status| {
        let expected = status.code() == Code::Aborted || status.code() == Code::NotFound || passes(&status);
        assert!(expected, "{status}");
        Ended::Lost
    })
}

/// Starts this program as a stub that dies.
pub fn spawn(url: &str, name: &str, graves: &Path) -> Child {
    Command::new(std::env::current_exe().unwrap())
        .args(["stub_worker", "--exact", "--ignored"])
        .env("STUB_SERVER", url)
        .env("STUB_NAME", name)
        .env("STUB_GRAVES", graves)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .kill_on_drop(true)
        .spawn()
        .unwrap()
}

/// A script that is a stub to the server that starts it as its own worker.
pub fn script(takes: Duration) -> String {
    let program = std::env::current_exe().unwrap();
    assert!(Path::new(&program).is_absolute());
    format!(
        "STUB_SERVER=\"$3\" STUB_NAME=own STUB_TAKES_MS={} exec {} stub_worker --exact --ignored",
        takes.as_millis(),
        program.display()
    )
}

/// What the process does: jobs, until it is killed, or is asked to leave and has handed back what it has.
pub fn process() {
    let Ok(url) = std::env::var("STUB_SERVER") else { return };
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(0);
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .unwrap();
    runtime.block_on(async {
        let stub = Stub {
            graves: std::env::var_os("STUB_GRAVES").map(PathBuf::from),
            ..Stub::new(
                Caller::new(&url),
                &std::env::var("STUB_NAME").unwrap_or_default(),
                Duration::from_millis(number("STUB_TAKES_MS")),
            )
        };
        let mut asked = tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate()).unwrap();
        loop {
            let lease = tokio::select! {
                lease = persist(|| stub.caller.lease(&stub.name, Duration::from_secs(1))) => lease.unwrap(),
                _ = asked.recv() => return,
            };
            let Some(job) = lease.job else { continue };
            tokio::select! {
                () = stub.attempt(&job, &lease.lease_token) => {}
                _ = asked.recv() => {
                    release(&stub.caller, (&job.name, &lease.lease_token)).await.unwrap();
                    return;
                }
            }
        }
    });
}
