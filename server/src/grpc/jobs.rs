//! `JobService`: work that is queued and carried out by workers.
use futures::stream::{BoxStream, StreamExt as _};
use guardsplat_proto::v1::job_service_server::JobService;
use guardsplat_proto::v1::{
    CancelJobRequest, CreateJobRequest, GetJobRequest, Job, ListJobAttemptsRequest, ListJobAttemptsResponse,
    ListJobsRequest, ListJobsResponse, ListWorkersRequest, ListWorkersResponse, RequeueJobRequest, WatchJobRequest,
    WatchJobResponse,
};
use tonic::{Request, Response, Status};

use crate::error::{Error, Result};
use crate::grpc::guard::caller;
use crate::grpc::{metrics_layer, watch};
use crate::service::names::ResourceKind;
use crate::service::rate_limit::payer;
use crate::service::{Service, clock, ownership, to_proto};

#[tonic::async_trait]
impl JobService for Service {
    async fn create_job(&self, request: Request<CreateJobRequest>) -> Result<Response<Job>, Status> {
        let caller = caller(&request)?;
        let trace_parent = metrics_layer::trace_parent(&request);
        let job = self.submit(request.into_inner(), trace_parent, &caller).await?;
        Ok(Response::new(job))
    }

    async fn get_job(&self, request: Request<GetJobRequest>) -> Result<Response<Job>, Status> {
        let id = ResourceKind::Job.parse("name", &request.get_ref().name)?;
        let caller = caller(&request)?;
        let row = self.owned_job(&caller.project, id).await?;
        Ok(Response::new(self.describe_job(row, self.disclosure(&caller)).await?))
    }

    async fn list_jobs(&self, request: Request<ListJobsRequest>) -> Result<Response<ListJobsResponse>, Status> {
        let caller = caller(&request)?;
        Ok(Response::new(self.list(&caller, request.get_ref()).await?))
    }

    async fn cancel_job(&self, request: Request<CancelJobRequest>) -> Result<Response<Job>, Status> {
        let caller = caller(&request)?;
        let id = ResourceKind::Job.parse("name", &request.get_ref().name)?;
        let job = self.owned_job(&caller.project, id).await?;
        caller.must(ownership::scope_of(job.kind()))?;
        let row = self.ledger().cancel_job(id, clock::now()).await.map_err(Error::from)?;
        // A running job ends when its worker has heard of it.
        self.metrics().job_ended(&row);
        self.changes().job(id);
        self.changes().queue_moved();
        Ok(Response::new(self.disclosure(&caller).job(to_proto::job(row))))
    }

    type WatchJobStream = BoxStream<'static, Result<WatchJobResponse, Status>>;

    async fn watch_job(&self, request: Request<WatchJobRequest>) -> Result<Response<Self::WatchJobStream>, Status> {
        let caller = caller(&request)?;
        let limit = self.limits().max_watches;
        let permit = self.watch_limit().take(payer(&caller), limit);
        let permit = permit.ok_or(Error::TooManyWatches { limit })?;
        let WatchJobRequest { name, cursor } = request.into_inner();
        let watching = watch::watch(self.clone(), &caller, &name, &cursor).await?;
        let kept = move |message| {
            let _ = &permit;
            message
        };
        Ok(Response::new(watching.map(kept).boxed()))
    }

    async fn requeue_job(&self, request: Request<RequeueJobRequest>) -> Result<Response<Job>, Status> {
        let project = caller(&request)?.project;
        Ok(Response::new(self.requeue(&project, &request.get_ref().name).await?))
    }

    async fn list_job_attempts(
        &self,
        request: Request<ListJobAttemptsRequest>,
    ) -> Result<Response<ListJobAttemptsResponse>, Status> {
        let project = caller(&request)?.project;
        let attempts = self.attempts(&project, &request.get_ref().name).await?;
        Ok(Response::new(ListJobAttemptsResponse { attempts }))
    }

    async fn list_workers(
        &self,
        request: Request<ListWorkersRequest>,
    ) -> Result<Response<ListWorkersResponse>, Status> {
        let project = caller(&request)?.project;
        let workers = self.workers_of_all(&project).await?;
        Ok(Response::new(ListWorkersResponse { workers }))
    }
}
