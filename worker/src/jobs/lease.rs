//! The right to one attempt of a job: kept by heartbeats, and given back with the attempt's outcome.
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use guardsplat_codeword::DEFAULT_FALSE_POSITIVE_RATE;
use guardsplat_engine::{device, memory};
use guardsplat_proto::v1::{
    CompleteJobRequest, FailJobRequest, Failure, Job, LeaseJobResponse, Progress, ReleaseJobRequest, ReportJobRequest,
};
use tokio::sync::watch;
use tokio::time::MissedTickBehavior;

use super::attempt::Outcome;
use super::error::{Error, Result};
use super::server::{Server, persist, within};

/// Time between heartbeats, unless the lease is so short that it takes more of them.
const HEARTBEAT: Duration = Duration::from_secs(1);
/// How long a call of a few bytes may take.
const CALL: Duration = Duration::from_secs(10);
/// How long a server may take to decide a claim, for which it may search many assets.
const DECIDE: Duration = Duration::from_secs(120);
/// What reports say computed.
const ENGINE: &str = concat!("guardsplat-worker ", env!("CARGO_PKG_VERSION"));

/// A leased job.
pub struct Lease {
    server: Server,
    /// The job, `jobs/{job}`.
    pub job: String,
    /// The secret that goes with everything.
    pub token: String,
    /// It ends when nothing was heard from the worker for so long.
    pub duration: Duration,
    /// What the work is a part of, as `traceparent` has it; empty where nobody traces.
    pub trace_parent: String,
    /// How often a match may be claimed wrongly.
    pub false_positive_rate: f64,
    /// Whether the peak of memory is this attempt's, and not also of what was before.
    measured: bool,
    /// Bytes of the accelerator's memory that were held at most, of those times that it was looked at.
    device_peak: AtomicU64,
}

/// The rate that a server told; of one that told none, the one that such servers judge claims at.
fn false_positive_rate(told: f64) -> Result<f64> {
    match told {
        0.0 => Ok(DEFAULT_FALSE_POSITIVE_RATE),
        rate if rate > 0.0 && rate < 1.0 => Ok(rate),
        rate => Err(Error::Damaged {
            what: "a lease".into(),
            reason: format!("its rate of false positives is {rate}"),
        }),
    }
}

/// Why an attempt ends that is not done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// Somebody asked for the end of the job.
    Cancelled,
    /// The job is no longer this worker's.
    Lost,
}

/// Where the work tells how far it has come.
#[derive(Clone)]
pub struct Reporter(watch::Sender<Option<Progress>>);

impl Reporter {
    /// A reporter, and what it last told.
    pub fn new() -> (Self, watch::Receiver<Option<Progress>>) {
        let (sender, receiver) = watch::channel(None);
        (Self(sender), receiver)
    }

    /// Tells; what was not sent yet is forgotten.
    pub fn tell(&self, progress: Progress) {
        self.0.send_replace(Some(progress));
    }
}

impl Lease {
    /// What the server answered, if it has a job.
    ///
    /// # Errors
    /// [`Error::Damaged`] where the answer makes no sense.
    pub fn accept(server: &Server, answer: LeaseJobResponse) -> Result<Option<(Self, Job)>> {
        let Some(job) = answer.job else {
            return Ok(None);
        };
        let duration = answer.lease_duration.and_then(|d| Duration::try_from(d).ok());
        let duration = duration.filter(|d| !d.is_zero());
        let (Some(duration), false, false) = (duration, job.name.is_empty(), answer.lease_token.is_empty()) else {
            return Err(Error::Damaged {
                what: "a lease".into(),
                reason: "without a job's name, a token or a duration".into(),
            });
        };
        let lease = Self {
            server: server.clone(),
            job: job.name.clone(),
            token: answer.lease_token,
            duration,
            trace_parent: answer.trace_parent,
            false_positive_rate: false_positive_rate(answer.false_positive_rate)?,
            measured: memory::forget_peak(),
            device_peak: AtomicU64::new(0),
        };
        Ok(Some((lease, job)))
    }

    /// Sends heartbeats with the latest progress until the attempt is to end. While the server can't be reached the
    /// work goes on; the server decides whether it was away for too long.
    pub async fn keep(&self, progress: &watch::Receiver<Option<Progress>>) -> Ended {
        let every = HEARTBEAT.min(self.duration / 3);
        let mut beat = tokio::time::interval(every);
        beat.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut sent = None;
        let mut silent = false;
        loop {
            beat.tick().await;
            self.look_at_device();
            let latest = *progress.borrow();
            match self.report(latest.filter(|_| latest != sent)).await {
                Ok(true) => return Ended::Cancelled,
                Ok(false) => {
                    if std::mem::take(&mut silent) {
                        tracing::info!(job = self.job, "the server can be reached again");
                    }
                    sent = latest;
                }
                Err(Error::LeaseLost) => return Ended::Lost,
                Err(error) => {
                    if !std::mem::replace(&mut silent, true) {
                        tracing::warn!(job = self.job, "no heartbeat: {error}; the work goes on");
                    }
                }
            }
        }
    }

    /// One heartbeat; says whether the job is to end.
    async fn report(&self, progress: Option<Progress>) -> Result<bool> {
        let request = ReportJobRequest {
            name: self.job.clone(),
            lease_token: self.token.clone(),
            progress,
        };
        let mut server = self.server.worker();
        let answer = within(CALL.min(self.duration), "report progress", server.report_job(request));
        Ok(answer.await?.cancel_requested)
    }

    /// The job is done.
    pub async fn complete(&self, outcome: Outcome) -> Result<()> {
        let request = CompleteJobRequest {
            name: self.job.clone(),
            lease_token: self.token.clone(),
            result: Some(outcome.result),
            readings: outcome.readings,
            engine: ENGINE.into(),
            views: outcome.views,
            peak_memory_bytes: self.peak(),
            peak_device_memory_bytes: self.look_at_device(),
        };
        let call = "complete the job";
        persist(call, async || {
            within(DECIDE, call, self.server.worker().complete_job(request.clone())).await
        })
        .await?;
        Ok(())
    }

    /// Bytes of memory that the process took at most during the attempt; those of a GPU of its own are not among them.
    fn peak(&self) -> Option<u64> {
        memory::peak().filter(|_| self.measured)
    }

    /// Bytes of the accelerator's memory that the process held at most whenever this was called, if it uses one.
    fn look_at_device(&self) -> Option<u64> {
        let now = device::memory_held()?;
        Some(self.device_peak.fetch_max(now, Ordering::Relaxed).max(now))
    }

    /// The attempt failed; tried for as long as the lease lasts.
    pub async fn fail(&self, failure: Failure, retryable: bool) -> Result<()> {
        self.end(FailJobRequest {
            failure: Some(failure),
            retryable,
            ..FailJobRequest::default()
        })
        .await
    }

    /// The job has ended as was asked; tried for as long as the lease lasts.
    pub async fn cancelled(&self) -> Result<()> {
        self.end(FailJobRequest {
            cancelled: true,
            ..FailJobRequest::default()
        })
        .await
    }

    async fn end(&self, request: FailJobRequest) -> Result<()> {
        let request = FailJobRequest {
            name: self.job.clone(),
            lease_token: self.token.clone(),
            peak_memory_bytes: self.peak(),
            peak_device_memory_bytes: self.look_at_device(),
            ..request
        };
        let call = "end the job";
        let end = persist(call, async || {
            within(CALL, call, self.server.worker().fail_job(request.clone())).await
        });
        in_time(self.duration, end).await
    }

    /// Hands the job back; tried for as long as the lease lasts.
    pub async fn release(&self) -> Result<()> {
        let request = ReleaseJobRequest {
            name: self.job.clone(),
            lease_token: self.token.clone(),
        };
        let call = "hand the job back";
        let release = persist(call, async || {
            within(CALL, call, self.server.worker().release_job(request.clone())).await
        });
        in_time(self.duration, release).await
    }
}

/// `work`, given up after `limit`.
async fn in_time<T>(limit: Duration, work: impl Future<Output = Result<T>>) -> Result<()> {
    match tokio::time::timeout(limit, work).await {
        Ok(done) => done.map(|_| ()),
        Err(_) => Err(Error::Unreachable(format!("not within {} s", limit.as_secs()))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn servers_that_tell_no_rate_mean_the_default() {
        assert_eq!(false_positive_rate(0.0).unwrap(), DEFAULT_FALSE_POSITIVE_RATE);
        assert_eq!(false_positive_rate(1e-9).unwrap(), 1e-9);
        for rate in [-1.0, 1.0, f64::NAN, f64::INFINITY] {
            assert!(false_positive_rate(rate).is_err());
        }
    }
}
