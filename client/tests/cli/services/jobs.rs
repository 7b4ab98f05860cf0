//! Jobs, and what becomes of them.
use guardsplat_proto::v1::job::State as JobState;
use guardsplat_proto::v1::job_service_server::JobService;
use guardsplat_proto::v1::{
    CancelJobRequest, CreateJobRequest, GetJobRequest, Job, JobAttempt, ListJobAttemptsRequest,
    ListJobAttemptsResponse, ListJobsRequest, ListJobsResponse, ListWorkersRequest, ListWorkersResponse,
    RequeueJobRequest, WatchJobRequest, WatchJobResponse, Worker, job_attempt,
};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Code, Request, Response, Status};
use uuid::Uuid;

use super::super::fake::{Fake, Step};
use super::{Replies, not_found, reused};

#[tonic::async_trait]
impl JobService for Fake {
    async fn create_job(&self, request: Request<CreateJobRequest>) -> Result<Response<Job>, Status> {
        let request = request.into_inner();
        let mut state = self.state();
        state.created.push(request.clone());
        let error = state.create_errors.pop_front();
        if let Some(error) = error.as_ref().filter(|error| error.code() != Code::Unavailable) {
            return Err(error.clone());
        }
        let mut job = request.job.unwrap();
        let known = state
            .requests
            .get(&request.request_id)
            .map(|name| state.jobs[name].clone());
        if let Some(known) = known {
            return if state.content(&known) == state.content(&job) {
                error.map_or(Ok(Response::new(known)), Err)
            } else {
                Err(reused(&request.request_id))
            };
        }
        let name = format!("jobs/{}", Uuid::new_v4());
        state.requests.insert(request.request_id, name.clone());
        job.name = name.clone();
        job.max_attempts = 3;
        job.set_state(JobState::Queued);
        state.jobs.insert(name, job.clone());
        error.map_or(Ok(Response::new(job)), Err)
    }

    async fn get_job(&self, request: Request<GetJobRequest>) -> Result<Response<Job>, Status> {
        let name = request.into_inner().name;
        let job = self.state().jobs.get(&name).cloned();
        job.map(Response::new).ok_or_else(|| not_found(&name))
    }

    async fn list_jobs(&self, request: Request<ListJobsRequest>) -> Result<Response<ListJobsResponse>, Status> {
        let request = request.into_inner();
        let state = self.state();
        let from: usize = request.page_token.parse().unwrap_or(0);
        let reason = |job: &Job| job.failure.as_ref().map_or(0, |failure| failure.reason);
        let wanted = |job: &&Job| {
            (request.states.is_empty() || request.states.contains(&job.state))
                && (request.reasons.is_empty() || request.reasons.contains(&reason(job)))
        };
        let all: Vec<Job> = state.jobs.values().rev().filter(wanted).cloned().collect();
        // Pages are smaller than asked for, which a server may do.
        let to = (from + 2).min(all.len());
        Ok(Response::new(ListJobsResponse {
            jobs: all[from..to].to_vec(),
            next_page_token: if to < all.len() { to.to_string() } else { String::new() },
        }))
    }

    async fn cancel_job(&self, request: Request<CancelJobRequest>) -> Result<Response<Job>, Status> {
        let name = request.into_inner().name;
        let mut state = self.state();
        state.cancelled.push(name.clone());
        let job = state.jobs.get_mut(&name).ok_or_else(|| not_found(&name))?;
        job.set_state(JobState::Cancelled);
        Ok(Response::new(job.clone()))
    }

    async fn requeue_job(&self, request: Request<RequeueJobRequest>) -> Result<Response<Job>, Status> {
        let name = request.into_inner().name;
        let mut state = self.state();
        let job = state.jobs.get_mut(&name).ok_or_else(|| not_found(&name))?;
        job.set_state(JobState::Queued);
        job.failure = None;
        Ok(Response::new(job.clone()))
    }

    async fn list_job_attempts(
        &self,
        request: Request<ListJobAttemptsRequest>,
    ) -> Result<Response<ListJobAttemptsResponse>, Status> {
        let name = request.into_inner().name;
        let job = self.state().jobs.get(&name).cloned().ok_or_else(|| not_found(&name))?;
        let attempt = JobAttempt {
            number: 1,
            worker: "a worker".into(),
            outcome: job_attempt::Outcome::Failed.into(),
            failure: job.failure,
            ..JobAttempt::default()
        };
        let attempts = vec![attempt];
        Ok(Response::new(ListJobAttemptsResponse { attempts }))
    }

    async fn list_workers(&self, _: Request<ListWorkersRequest>) -> Result<Response<ListWorkersResponse>, Status> {
        let worker = |name: &str, job: &str, attempt| Worker {
            name: name.into(),
            device: "a GPU".into(),
            version: "1.2.3".into(),
            memory_bytes: 3 << 30,
            seen_time: Some(prost_types::Timestamp::default()),
            busy: name != "idle",
            job: job.into(),
            attempt,
            start_time: None,
        };
        let workers = vec![
            worker("busy", "jobs/7", 2),
            worker("elsewhere", "", 0),
            worker("idle", "", 0),
        ];
        Ok(Response::new(ListWorkersResponse { workers }))
    }

    type WatchJobStream = Replies<WatchJobResponse>;

    async fn watch_job(&self, request: Request<WatchJobRequest>) -> Result<Response<Self::WatchJobStream>, Status> {
        let request = request.into_inner();
        let mut state = self.state();
        let stream = state.watched.len();
        state.watched.push(request.clone());
        let known = state
            .jobs
            .get(&request.name)
            .cloned()
            .ok_or_else(|| not_found(&request.name))?;
        let steps = state.watch.pop_front().unwrap_or_else(|| vec![Step::Hang]);
        drop(state);
        let (sender, receiver) = mpsc::channel(1);
        tokio::spawn(async move {
            for (index, step) in steps.into_iter().enumerate() {
                let sent = match step {
                    Step::Send(job) => {
                        let job = Job {
                            name: known.name.clone(),
                            spec: known.spec.clone(),
                            ..*job
                        };
                        let cursor = format!("{stream}.{index}");
                        sender.send(Ok(WatchJobResponse { job: Some(job), cursor })).await
                    }
                    Step::Fail(status) => sender.send(Err(status)).await,
                    Step::Hang => {
                        sender.closed().await;
                        return;
                    }
                };
                if sent.is_err() {
                    return;
                }
            }
        });
        Ok(Response::new(Box::pin(ReceiverStream::new(receiver))))
    }
}
