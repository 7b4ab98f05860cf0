//! The worker's day: waits for a job, carries it out, says what became of it, until it is to leave.
use std::time::{Duration, Instant};

use guardsplat_engine::memory;
use guardsplat_engine::stop::Stop;
use guardsplat_proto::v1::Job;
use tonic::Code;

use super::accelerator::Accelerator;
use super::attempt::Attempt;
use super::capabilities::WorkerCapabilities;
use super::convert;
use super::error::{Error, Result};
use super::lease::{Ended, Lease, Reporter};
use super::server::{Server, persist, within};
use super::shutdown::ShutdownSignal;
use super::work_directory::WorkDirectory;
use crate::credentials_program::Certificate;

/// How long to wait for a job before asking again.
const WAIT: Duration = Duration::from_secs(30);
/// How much later than that the answer may come.
const LATE: Duration = Duration::from_secs(10);
/// A server that says at once that there is no job is not asked again before this.
const BETWEEN_ASKING: Duration = Duration::from_secs(1);
/// An engine that was asked to stop gets so long before its job is handed back all the same: nothing that it still does
/// counts any more.
const TO_STOP: Duration = Duration::from_secs(2);
/// An engine that does not stop for so long never will.
const TO_END: Duration = Duration::from_secs(120);
/// How long a worker that is to leave waits for its engine.
const TO_LEAVE: Duration = Duration::from_secs(10);
/// And for a server that does not answer.
const TO_TELL: Duration = Duration::from_secs(5);
/// A worker at work.
pub struct Worker {
    /// Who has the jobs.
    pub server: Server,
    /// Whether it is to leave.
    pub leaving: ShutdownSignal,
    /// For the files of jobs.
    pub folder: WorkDirectory,
    /// Where to compute.
    pub accelerator: Accelerator,
    /// Who signs content credentials.
    pub certificate: Certificate,
    /// What it calls itself, and what it can do.
    pub capabilities: WorkerCapabilities,
}

impl Worker {
    /// One job after the other, until the worker is to leave.
    ///
    /// # Errors
    /// What the worker can't go on after: an engine that is lost, or a server that will have nothing to do with it.
    pub async fn serve(&mut self) -> Result<()> {
        let mut leaving = self.leaving.clone();
        loop {
            let leased = tokio::select! {
                biased;
                () = leaving.asked() => return Ok(()),
                leased = self.lease() => leased?,
            };
            if let Some((lease, job)) = leased {
                self.attempt(&lease, &job).await?;
                // The next job may be long in coming, and its peak is its own.
                memory::give_back_freed();
            }
        }
    }

    /// Waits for a job. Comes back without one now and then.
    async fn lease(&self) -> Result<Option<(Lease, Job)>> {
        let start = Instant::now();
        let request = self.capabilities.request(WAIT);
        let call = "ask for a job";
        let answer = persist(call, async || {
            let mut server = self.server.worker();
            match within(WAIT + LATE, call, server.lease_job(request.clone())).await {
                // This worker will never be given a job.
                Err(error @ Error::Refused { code, .. }) if is_final(code) => Err(error),
                Ok(answer) => Ok(answer),
                Err(error @ Error::Unreachable(_)) => Err(error),
                Err(error) => Err(Error::Unreachable(error.to_string())),
            }
        });
        let leased = Lease::accept(&self.server, answer.await?);
        if !matches!(leased, Ok(Some(_))) && start.elapsed() < BETWEEN_ASKING {
            tokio::time::sleep(BETWEEN_ASKING).await;
        }
        leased.or_else(|error| {
            tracing::warn!("{error}");
            Ok(None)
        })
    }

    /// Carries a job out and says what became of it.
    ///
    /// # Errors
    /// Only what the worker can't go on after.
    async fn attempt(&mut self, lease: &Lease, job: &Job) -> Result<()> {
        tracing::info!(
            job = lease.job,
            attempt = job.attempt,
            trace = lease.trace_parent,
            "job begins"
        );
        let folder = match self.folder.of_job() {
            Ok(folder) => folder,
            Err(error) => return self.fail(lease, error).await,
        };
        let stop = Stop::default();
        let (reporter, progress) = Reporter::new();
        let mut attempt = Attempt {
            server: &self.server,
            accelerator: &self.accelerator,
            lease,
            folder: folder.path(),
            stop: &stop,
            reporter,
            certificate: &self.certificate,
            known_as: Vec::new(),
        };
        let mut leaving = self.leaving.clone();
        let ended = tokio::select! {
            biased;
            () = leaving.asked() => None,
            ended = lease.keep(&progress) => Some(ended),
            done = attempt.carry_out(job) => return match done {
                Ok(()) => {
                    tracing::info!(job = lease.job, "job is done");
                    Ok(())
                }
                Err(Error::LeaseLost) => {
                    tracing::warn!(job = lease.job, "the lease was lost; what came out is dropped");
                    Ok(())
                }
                Err(error) => self.fail(lease, error).await,
            },
        };
        stop.request();
        let grace = TO_STOP.min(lease.duration / 3);
        let stopped = tokio::time::timeout(grace, self.accelerator.idle())
            .await
            .unwrap_or(Ok(()));
        let told = match ended {
            None => {
                tracing::info!(job = lease.job, "job is handed back");
                self.tell(lease.release()).await
            }
            Some(Ended::Cancelled) => {
                tracing::info!(job = lease.job, "job is cancelled");
                self.tell(lease.cancelled()).await
            }
            Some(Ended::Lost) => {
                tracing::warn!(job = lease.job, "the lease was lost; the work is dropped");
                Ok(())
            }
        };
        if let Err(error) = told {
            tracing::warn!(job = lease.job, "the server takes the job back by itself: {error}");
        }
        stopped?;
        // The next job would wait for the engine anyway; and the folder is to stay until nothing is written to it.
        tokio::select! {
            idle = self.accelerator.idle() => idle,
            () = tokio::time::sleep(TO_END) => Err(Error::Stuck(TO_END.as_secs())),
            () = self.overdue(TO_LEAVE) => Ok(()),
        }
    }

    /// Says why an attempt failed; gives the error back when the worker can't go on.
    async fn fail(&self, lease: &Lease, error: Error) -> Result<()> {
        let (failure, retryable) = convert::failure(&error);
        tracing::warn!(job = lease.job, retryable, "job failed: {error}");
        if let Err(error) = self.tell(lease.fail(failure, retryable)).await {
            tracing::warn!(job = lease.job, "the server was not told: {error}");
        }
        if error.is_fatal() { Err(error) } else { Ok(()) }
    }

    /// A last word about a job, for which a worker that is to leave does not take long.
    async fn tell(&self, word: impl Future<Output = Result<()>>) -> Result<()> {
        tokio::select! {
            told = word => told,
            () = self.overdue(TO_TELL) => Err(Error::Unreachable("the worker is leaving".into())),
        }
    }

    /// Ends so long after the worker was asked to leave, or after now if that was before.
    async fn overdue(&self, after: Duration) {
        self.leaving.clone().asked().await;
        tokio::time::sleep(after).await;
    }
}

/// Whether a server that refuses with this code will do so next time.
fn is_final(code: Code) -> bool {
    matches!(
        code,
        Code::InvalidArgument | Code::Unimplemented | Code::Unauthenticated | Code::PermissionDenied
    )
}

#[cfg(test)]
mod tests;
