//! `WorkerService`: what workers say to the server.
use futures::stream::{self, BoxStream, StreamExt};
use guardsplat_proto::v1::worker_service_server::WorkerService;
use guardsplat_proto::v1::{
    Artifact, CompleteJobRequest, CompleteJobResponse, DownloadKeyRequest, DownloadKeyResponse, FailJobRequest,
    FailJobResponse, LeaseJobRequest, LeaseJobResponse, ReleaseJobRequest, ReleaseJobResponse, ReportJobRequest,
    ReportJobResponse, UploadOutputRequest,
};
use secrecy::ExposeSecret;
use tonic::{Request, Response, Status, Streaming};

use crate::artifacts::CHUNK_BYTES;
use crate::error::{Error, Result};
use crate::grpc::upload_stream::Incoming;
use crate::service::claims::WorkerReadings;
use crate::service::names::ResourceKind;
use crate::service::{Service, attempts, clock, completion, to_proto};

#[tonic::async_trait]
impl WorkerService for Service {
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
        Ok(Response::new(to_proto::artifact(row)))
    }

    type DownloadKeyStream = BoxStream<'static, Result<DownloadKeyResponse, Status>>;

    async fn download_key(
        &self,
        request: Request<DownloadKeyRequest>,
    ) -> Result<Response<Self::DownloadKeyStream>, Status> {
        let DownloadKeyRequest { job, lease_token } = request.into_inner();
        let secret = self.key_file(&job, &lease_token).await?;
        // Chunks are made when they are sent, and the whole is wiped when the stream ends.
        let chunks = stream::unfold((secret, 0), |(secret, at)| async move {
            let chunk = secret.expose_secret().get(at..).filter(|rest| !rest.is_empty())?;
            let chunk = chunk[..chunk.len().min(CHUNK_BYTES)].to_vec();
            let next = at + chunk.len();
            Some((Ok(DownloadKeyResponse { chunk }), (secret, next)))
        });
        Ok(Response::new(chunks.boxed()))
    }

    async fn complete_job(
        &self,
        request: Request<CompleteJobRequest>,
    ) -> Result<Response<CompleteJobResponse>, Status> {
        let mut request = request.into_inner();
        let id = ResourceKind::Job.parse("name", &request.name)?;
        let lease_token = request.lease_token.clone();
        let (peak, on_device) = (request.peak_memory_bytes, request.peak_device_memory_bytes);
        // Whether the lease holds is looked at when the result is written: a worker whose answer was lost says it again.
        let job = self.ledger().get_job(id).await.map_err(Error::from)?;
        let job = job.ok_or_else(|| ResourceKind::Job.not_found(id))?;
        let mut completion = completion::check(&job, request.clone())?;
        let told = WorkerReadings {
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
            self.name_credentials(&job, &mut completion).await?;
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
        let id = ResourceKind::Job.parse("name", &name)?;
        let failure = if cancelled {
            None
        } else {
            Some(attempts::checked_failure(failure)?)
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
        let id = ResourceKind::Job.parse("name", &name)?;
        let released = self.ledger().release(id, &lease_token, clock::now()).await;
        self.attempt_over(&released.map_err(Error::from)?);
        Ok(Response::new(ReleaseJobResponse {}))
    }
}
