//! An attempt of a job while a worker has it: reports, and how it ends.
use std::time::Instant;

use guardsplat_proto::v1::progress::Stage;
use guardsplat_proto::v1::{Failure, Progress, ReportJobRequest, failure};

use crate::error::{Error, Result};
use crate::ledger::{self, FailureReason, JobResult, JobRow};
use crate::metrics;
use crate::service::names::ResourceKind;
use crate::service::violations::Violations;
use crate::service::{Service, clock, text};

/// Most bytes of a failure's message; the rest is cut off.
const MAX_FAILURE_BYTES: usize = 4 << 10;

impl Service {
    /// Writes a report, or holds it back for a moment; either way says whether the job is to end.
    pub(crate) async fn report(&self, request: ReportJobRequest) -> Result<bool> {
        let ReportJobRequest {
            name,
            lease_token: token,
            progress,
        } = request;
        let id = ResourceKind::Job.parse("name", &name)?;
        let stage = progress.as_ref().map(Progress::stage);
        let progress = progress.map(checked_progress).transpose()?;
        let (lease, now) = (self.limits().lease, Instant::now());
        let Some(progress) = self.progress_throttle().due(id, &token, progress, lease, now) else {
            let job = self.ledger().leased_job(id, &token).await?;
            self.heard(id, stage);
            return Ok(job.cancel_requested);
        };
        let changed = progress.is_some();
        if !changed {
            self.end_if_stalled(id, &token).await?;
        }
        let cancel_requested = self.ledger().report(id, &token, progress, lease, clock::now()).await?;
        self.progress_throttle().written(id, &token, now);
        self.heard(id, stage);
        if changed {
            self.changes().job(id);
        }
        Ok(cancel_requested)
    }

    /// Ends the attempt of a worker that reports, and whose engine does nothing.
    async fn end_if_stalled(&self, id: ledger::JobId, token: &str) -> Result<()> {
        let job = self.ledger().leased_job(id, token).await?;
        let (stall, now) = (self.limits().progress_stall, clock::now());
        // It moves with every progress that is new, and when the attempt begins.
        if now.saturating_sub(job.update_time) < clock::micros(stall) {
            return Ok(());
        }
        let failure = ledger::Failure {
            reason: FailureReason::WorkerLost,
            message: format!("no progress for {} s, though the worker reported", stall.as_secs_f32()),
        };
        tracing::warn!(job = %id, "an attempt makes no progress, and is ended");
        let ended = self.ledger().fail(id, token, Some(failure), true, false, now).await?;
        self.attempt_over(&ended);
        Err(Error::LeaseLost {
            name: ResourceKind::Job.name(id),
        })
    }

    /// Tells those who wait that an attempt has ended, however it did: the job may be queued again.
    pub(crate) fn attempt_over(&self, job: &JobRow) {
        let id = job.id;
        self.ended(job);
        self.progress_throttle().forget(id);
        self.changes().job(id);
        self.changes().queue_grew();
        self.changes().queue_moved();
    }

    /// A worker that has the lease of a job is at this stage of it, if it says so.
    pub(crate) fn heard(&self, id: ledger::JobId, stage: Option<Stage>) {
        self.workers().heard();
        if let Some(stage) = stage {
            self.stages()
                .reached(id, stage, Instant::now(), &self.metrics(), self.traces());
        }
    }

    /// Counts an attempt that has ended, and left the job like this.
    pub(crate) fn ended(&self, job: &JobRow) {
        let metrics = self.metrics();
        let outcome = metrics.attempt_ended(job, metrics::was_lost(job));
        self.stages()
            .end(job.id, outcome, Instant::now(), &metrics, self.traces());
    }

    /// Counts a marked scene that is handed out.
    pub(crate) fn count_mark(&self, job: &JobRow) {
        if let Some(JobResult::Embed(result)) = &job.result {
            self.metrics().marked(result);
        }
    }
}

fn checked_progress(progress: Progress) -> Result<Progress> {
    let mut problems = Violations::default();
    let stage = Stage::try_from(progress.stage).ok();
    let known = stage.is_some_and(|stage| stage != Stage::Unspecified);
    problems.check(known, "progress.stage", "is missing or not known");
    problems.check(progress.done >= 0, "progress.done", "is negative");
    problems.check(progress.total >= 0, "progress.total", "is negative");
    problems.finish()?;
    Ok(progress)
}

pub(crate) fn checked_failure(failure: Option<Failure>) -> Result<ledger::Failure> {
    use failure::Reason;
    let failure = failure.ok_or_else(|| Error::invalid("failure", "is missing, and the job was not cancelled"))?;
    match Reason::try_from(failure.reason) {
        Ok(Reason::InvalidInput | Reason::TargetMissed | Reason::WorkerLost | Reason::Internal) => {}
        Ok(Reason::AttemptsExhausted) => {
            return Err(Error::invalid(
                "failure.reason",
                "only the server knows that attempts are used up",
            ));
        }
        Ok(Reason::Unspecified) | Err(_) => {
            return Err(Error::invalid("failure.reason", "is missing or not known"));
        }
    }
    Ok(ledger::Failure {
        reason: FailureReason::from_number(failure.reason),
        message: text::shortened(failure.message, MAX_FAILURE_BYTES),
    })
}
