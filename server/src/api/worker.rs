//! `WorkerService`: what workers say to the server.
use std::time::Instant;

use futures::stream::BoxStream;
use guardsplat_proto::v1::progress::Stage;
use guardsplat_proto::v1::worker_service_server::WorkerService;
use guardsplat_proto::v1::{
    Artifact, CompleteJobRequest, CompleteJobResponse, DownloadKeyRequest, DownloadKeyResponse, FailJobRequest,
    FailJobResponse, Failure, LeaseJobRequest, LeaseJobResponse, Progress, ReleaseJobRequest, ReleaseJobResponse,
    ReportJobRequest, ReportJobResponse, UploadOutputRequest, failure,
};
use tonic::{Request, Response, Status, Streaming};

use super::claims::Told;
use super::names::Kind;
use super::problems::Problems;
use super::upload::Incoming;
use super::{Api, clock, completion, convert, text};
use crate::error::{Error, Result};
use crate::ledger::{self, FailureReason, JobResult, JobRow};
use crate::metrics;

/// Most bytes of a failure's message; the rest is cut off.
const MAX_FAILURE_BYTES: usize = 4 << 10;

#[tonic::async_trait]
impl WorkerService for Api {
    async fn lease_job(&self, request: Request<LeaseJobRequest>) -> Result<Response<LeaseJobResponse>, Status> {
        Ok(Response::new(self.lease(request.into_inner()).await?))
    }

    async fn report_job(&self, request: Request<ReportJobRequest>) -> Result<Response<ReportJobResponse>, Status> {
        let cancel_requested = self.report(request.into_inner()).await?;
        Ok(Response::new(ReportJobResponse { cancel_requested }))
    }

    async fn upload_output(
        &self,
        request: Request<Streaming<UploadOutputRequest>>,
    ) -> Result<Response<Artifact>, Status> {
        let incoming = Incoming::new(request.into_inner(), self.limits().upload_idle);
        let row = self.within_upload_time(self.receive_output(incoming)).await?;
        self.metrics().uploaded(true, row.size);
        Ok(Response::new(convert::artifact(row)))
    }

    type DownloadKeyStream = BoxStream<'static, Result<DownloadKeyResponse, Status>>;

    async fn download_key(
        &self,
        request: Request<DownloadKeyRequest>,
    ) -> Result<Response<Self::DownloadKeyStream>, Status> {
        let DownloadKeyRequest { job, lease_token } = request.into_inner();
        Ok(Response::new(self.send_key(&job, &lease_token).await?))
    }

    async fn complete_job(
        &self,
        request: Request<CompleteJobRequest>,
    ) -> Result<Response<CompleteJobResponse>, Status> {
        let mut request = request.into_inner();
        let id = Kind::Job.parse("name", &request.name)?;
        let lease_token = request.lease_token.clone();
        let (peak, on_device) = (request.peak_memory_bytes, request.peak_device_memory_bytes);
        // Whether the lease holds is looked at when the result is written: a worker whose answer was lost says it again.
        let job = self.ledger().get_job(id).await.map_err(Error::from)?;
        let job = job.ok_or_else(|| Kind::Job.not_found(id))?;
        let mut completion = completion::check(&job, request.clone())?;
        let told = Told {
            readings: std::mem::take(&mut request.readings),
            engine: request.engine,
            views: std::mem::take(&mut request.views),
        };
        // A job that is over was concluded before, and is only to be answered in the same way.
        if !job.state.is_over() {
            match self.conclude(&job, &lease_token, &told, &mut completion).await {
                // Another call may have been faster; whether it said the same is looked at next.
                Ok(()) | Err(Error::LeaseLost { .. }) => {}
                Err(error) => return Err(error.into()),
            }
        }
        let done = self.ledger().complete(id, &lease_token, completion, clock::now());
        let done = done.await.map_err(Error::from)?;
        // What is said again was counted before.
        if !job.state.is_over() {
            self.count_mark(&done);
            self.metrics().memory_taken(done.kind(), peak, on_device);
            self.attempt_over(&done);
        }
        Ok(Response::new(CompleteJobResponse {}))
    }

    async fn fail_job(&self, request: Request<FailJobRequest>) -> Result<Response<FailJobResponse>, Status> {
        let FailJobRequest {
            name,
            lease_token,
            failure,
            retryable,
            cancelled,
            peak_memory_bytes,
            peak_device_memory_bytes,
        } = request.into_inner();
        let id = Kind::Job.parse("name", &name)?;
        let failure = if cancelled {
            None
        } else {
            Some(checked_failure(failure)?)
        };
        let failed = self
            .ledger()
            .fail(id, &lease_token, failure, retryable, cancelled, clock::now())
            .await;
        let failed = failed.map_err(Error::from)?;
        self.metrics()
            .memory_taken(failed.kind(), peak_memory_bytes, peak_device_memory_bytes);
        self.attempt_over(&failed);
        Ok(Response::new(FailJobResponse {}))
    }

    async fn release_job(&self, request: Request<ReleaseJobRequest>) -> Result<Response<ReleaseJobResponse>, Status> {
        let ReleaseJobRequest { name, lease_token } = request.into_inner();
        let id = Kind::Job.parse("name", &name)?;
        let released = self.ledger().release(id, &lease_token, clock::now()).await;
        self.attempt_over(&released.map_err(Error::from)?);
        Ok(Response::new(ReleaseJobResponse {}))
    }
}

impl Api {
    /// Writes a report, or holds it back for a moment; either way says whether the job is to end.
    async fn report(&self, request: ReportJobRequest) -> Result<bool> {
        let ReportJobRequest {
            name,
            lease_token: token,
            progress,
        } = request;
        let id = Kind::Job.parse("name", &name)?;
        let stage = progress.as_ref().map(Progress::stage);
        let progress = progress.map(checked_progress).transpose()?;
        let (lease, now) = (self.limits().lease, Instant::now());
        let Some(progress) = self.reports().due(id, &token, progress, lease, now) else {
            let job = self.ledger().leased_job(id, &token).await?;
            self.heard(id, stage);
            return Ok(job.cancel_requested);
        };
        let changed = progress.is_some();
        let cancel_requested = self.ledger().report(id, &token, progress, lease, clock::now()).await?;
        self.reports().written(id, &token, now);
        self.heard(id, stage);
        if changed {
            self.changes().job(id);
        }
        Ok(cancel_requested)
    }

    /// Tells those who wait that an attempt has ended, however it did: the job may be queued again.
    pub(super) fn attempt_over(&self, job: &JobRow) {
        let id = job.id;
        self.ended(job);
        self.reports().forget(id);
        self.changes().job(id);
        self.changes().queue_grew();
        self.changes().queue_moved();
    }
}

impl Api {
    /// A worker that has the lease of a job is at this stage of it, if it says so.
    fn heard(&self, id: ledger::JobId, stage: Option<Stage>) {
        self.alive().heard();
        if let Some(stage) = stage {
            self.stages()
                .reached(id, stage, Instant::now(), &self.metrics(), self.traces());
        }
    }

    /// Counts an attempt that has ended, and left the job like this.
    pub(super) fn ended(&self, job: &JobRow) {
        let metrics = self.metrics();
        let outcome = metrics.attempt_ended(job, metrics::was_lost(job));
        self.stages()
            .end(job.id, outcome, Instant::now(), &metrics, self.traces());
    }

    /// Counts a marked scene that is handed out.
    fn count_mark(&self, job: &JobRow) {
        if let Some(JobResult::Embed(result)) = &job.result {
            self.metrics().marked(result);
        }
    }
}

fn checked_progress(progress: Progress) -> Result<Progress> {
    let mut problems = Problems::default();
    let stage = Stage::try_from(progress.stage).ok();
    let known = stage.is_some_and(|stage| stage != Stage::Unspecified);
    problems.check(known, "progress.stage", "is missing or not known");
    problems.check(progress.done >= 0, "progress.done", "is negative");
    problems.check(progress.total >= 0, "progress.total", "is negative");
    problems.finish()?;
    Ok(progress)
}

fn checked_failure(failure: Option<Failure>) -> Result<ledger::Failure> {
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
