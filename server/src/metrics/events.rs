//! What happens, counted as it does.
use std::sync::Arc;
use std::time::Duration;

use guardsplat_proto::v1::EmbedResult;
use guardsplat_proto::v1::progress::Stage;
use tonic::Code;

use super::labels::{self, AtStage, AttemptEnded, Bytes, Call, Mark, OfKind, OfMethod, Part, Refused, kind, stage};
use super::{Metrics, code, seconds};
use crate::ledger::{FailureReason, JobKind, JobRow, JobState, Outcome};

impl Metrics {
    /// A job was accepted.
    pub fn created(&self, job: JobKind) {
        self.created.get_or_create(&OfKind { kind: kind(job) }).inc();
    }

    /// A failed job was queued once more.
    pub fn requeued(&self, job: JobKind) {
        self.requeued.get_or_create(&OfKind { kind: kind(job) }).inc();
    }

    /// A worker was given a job.
    pub fn given(&self, job: &JobRow) {
        let of = OfKind { kind: kind(job.kind()) };
        self.attempts.get_or_create(&of).inc();
        // After an attempt it waited for other reasons too.
        if is_first(job)
            && let Some(start) = job.start_time
        {
            let waited = start.saturating_sub(job.create_time);
            self.wait.get_or_create(&of).observe(seconds(waited));
        }
    }

    /// An attempt ended, and left the job like this: how.
    pub fn attempt_ended(&self, job: &JobRow, lost: bool) -> &'static str {
        let outcome = match job.state {
            _ if lost => "lost",
            JobState::Succeeded => labels::outcome(Outcome::Succeeded),
            JobState::Cancelled => labels::outcome(Outcome::Cancelled),
            JobState::Queued if job.failure.is_none() => labels::outcome(Outcome::Released),
            JobState::Queued | JobState::Running | JobState::Failed => labels::outcome(Outcome::Failed),
        };
        let kind = kind(job.kind());
        self.attempts_ended.get_or_create(&AttemptEnded { kind, outcome }).inc();
        if job.state == JobState::Queued && job.failure.is_some() {
            self.retries.get_or_create(&OfKind { kind }).inc();
        }
        self.job_ended(job);
        if let Some((start, end)) = job.start_time.zip(job.end_time) {
            self.run
                .get_or_create(&labels::over(job.kind(), job.state))
                .observe(seconds(end.saturating_sub(start)));
        }
        outcome
    }

    /// A job is over, if it is.
    pub fn job_ended(&self, job: &JobRow) {
        if job.state.is_over() {
            self.ended.get_or_create(&labels::over(job.kind(), job.state)).inc();
        }
    }

    /// A marked scene was handed out.
    pub fn marked(&self, result: &EmbedResult) {
        let recovered = if result.message_recovered { "true" } else { "false" };
        self.marks.get_or_create(&Mark { recovered }).inc();
        // What a worker says is no number may be anything.
        if result.bit_accuracy.is_finite() {
            self.accuracy.observe(result.bit_accuracy);
        }
        if let Some(psnr) = result.psnr_db.filter(|psnr| psnr.is_finite()) {
            self.psnr.observe(psnr);
        }
    }

    /// What an attempt took of the machine's memory and of its accelerator's, as far as its worker knows.
    pub fn memory_taken(&self, job: JobKind, peak: Option<u64>, on_device: Option<u64>) {
        let of = OfKind { kind: kind(job) };
        for (taken, bytes) in [(&self.memory, peak), (&self.device_memory, on_device)] {
            if let Some(bytes) = bytes {
                taken.get_or_create(&of).observe(bytes as f64);
            }
        }
    }

    /// A stage of an attempt is over.
    pub fn stage(&self, job: JobKind, at: Stage, length: Duration) {
        let (kind, stage) = (kind(job), stage(at));
        let times = self.stages.get_or_create(&AtStage { kind, stage });
        times.observe(length.as_secs_f64());
    }

    /// Bytes of an upload, or of an output, are all there.
    pub fn uploaded(&self, output: bool, size: i64) {
        let what = if output { "output" } else { "artifact" };
        let size = u64::try_from(size).unwrap_or_default();
        self.bytes.get_or_create(&Bytes { what }).inc_by(size);
    }

    /// The answer to a call began.
    pub fn answered(&self, method: &'static str, after: Duration) {
        self.call_time
            .get_or_create(&OfMethod { method })
            .observe(after.as_secs_f64());
    }

    /// A call is over.
    pub fn call(&self, method: &'static str, how: Code) {
        let code = code(how);
        self.calls.get_or_create(&Call { method, code }).inc();
    }

    /// A call was refused for this reason of errors.
    pub fn refused(&self, reason: &str) {
        if let Some(reason) = labels::refusal(reason) {
            self.refused.get_or_create(&Refused { reason }).inc();
        }
    }

    /// A watch is looked after, until what this gives is dropped.
    pub fn watching(self: &Arc<Self>) -> Watching {
        self.watches.inc();
        Watching(self.clone())
    }

    /// A watch was let go, because its reader took nothing.
    pub fn watch_shed(&self) {
        self.watches_shed.inc();
    }

    /// A download was let go, because its reader took nothing.
    pub fn download_shed(&self) {
        self.downloads_shed.inc();
    }

    /// A connection was taken.
    pub fn connected(&self) {
        self.connections.inc();
    }

    /// A connection is gone.
    pub fn disconnected(&self) {
        self.connections.dec();
    }

    /// A connection was refused, or closed for another, because there were too many.
    pub fn turned_away(&self) {
        self.connections_turned_away.inc();
    }

    /// Whether a part is well.
    pub fn ready(&self, part: &'static str, well: bool) {
        self.ready.get_or_create(&Part { part }).set(well.into());
    }
}

/// A watch that is counted.
#[derive(Debug)]
pub struct Watching(Arc<Metrics>);

impl Drop for Watching {
    fn drop(&mut self) {
        self.0.watches.dec();
    }
}

/// Whether a job that was just given to a worker never was before, nor was anything else done to it.
pub fn is_first(job: &JobRow) -> bool {
    // One for being made, one for being given.
    job.revision == 2
}

/// Whether an attempt ended because its worker was lost.
pub fn was_lost(job: &JobRow) -> bool {
    let failure = job.failure.as_ref();
    failure.is_some_and(|failure| failure.reason == FailureReason::WorkerLost)
}
