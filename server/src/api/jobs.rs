//! `JobService`: work that is queued and carried out by workers.
use futures::stream::BoxStream;
use guardsplat_proto::v1::job_service_server::JobService;
use guardsplat_proto::v1::{
    CancelJobRequest, CreateJobRequest, GetJobRequest, Job, ListJobsRequest, ListJobsResponse, WatchJobRequest,
    WatchJobResponse,
};
use prost::Message as _;
use tonic::{Request, Response, Status};
use uuid::Uuid;

use super::names::Kind;
use super::submission::{self, Submission};
use super::{Api, clock, convert, fingerprint, keys, message, page, watch};
use crate::error::{Error, Result};
use crate::ledger::NewJob;

/// A page ends early rather than come near the largest message that clients read by default.
const MAX_PAGE_BYTES: usize = 2 << 20;

#[tonic::async_trait]
impl JobService for Api {
    async fn create_job(&self, request: Request<CreateJobRequest>) -> Result<Response<Job>, Status> {
        Ok(Response::new(self.submit(request.into_inner()).await?))
    }

    async fn get_job(&self, request: Request<GetJobRequest>) -> Result<Response<Job>, Status> {
        let id = Kind::Job.parse("name", &request.get_ref().name)?;
        let row = self.ledger().get_job(id).await.map_err(Error::from)?;
        Ok(Response::new(convert::job(
            row.ok_or_else(|| Kind::Job.not_found(id))?,
        )?))
    }

    async fn list_jobs(&self, request: Request<ListJobsRequest>) -> Result<Response<ListJobsResponse>, Status> {
        Ok(Response::new(self.list(&request.into_inner()).await?))
    }

    async fn cancel_job(&self, request: Request<CancelJobRequest>) -> Result<Response<Job>, Status> {
        let id = Kind::Job.parse("name", &request.get_ref().name)?;
        let row = self.ledger().cancel_job(id, clock::now()).await.map_err(Error::from)?;
        self.changes().job(id);
        self.changes().queue_moved();
        Ok(Response::new(convert::job(row)?))
    }

    type WatchJobStream = BoxStream<'static, Result<WatchJobResponse, Status>>;

    async fn watch_job(&self, request: Request<WatchJobRequest>) -> Result<Response<Self::WatchJobStream>, Status> {
        let WatchJobRequest { name, cursor } = request.into_inner();
        Ok(Response::new(watch::watch(self.clone(), &name, &cursor).await?))
    }
}

impl Api {
    async fn submit(&self, request: CreateJobRequest) -> Result<Job> {
        let submission = submission::check(request)?;
        if let Some(id) = submission.key {
            let key = self
                .ledger()
                .get_key(id)
                .await?
                .ok_or_else(|| Kind::Key.not_found(id))?;
            if let Some((field, text)) = &submission.message {
                message::check(field, text, key.bits)?;
            }
            if let Err(error) = keys::usable(&key, submission.kind)
                && !self.is_known(&submission).await?
            {
                return Err(error);
            }
            if let Some(claim) = &submission.claim {
                self.check_claim(claim, &key, &submission).await?;
            }
        }
        self.admit(&submission).await?;
        let fingerprint = self.fingerprint(&submission).await?;
        let new = NewJob {
            id: Uuid::now_v7(),
            display_name: submission.display_name,
            kind: submission.kind,
            spec: submission.spec,
            inputs: submission.inputs,
            key: submission.key,
            request_id: submission.request_id,
            fingerprint,
            max_attempts: self.limits().max_attempts,
        };
        let row = self.ledger().create_job(new, clock::now()).await?;
        self.changes().queue_grew();
        convert::job(row)
    }

    /// What a request is known by when it is sent again; needed only where it has a name.
    async fn fingerprint(&self, submission: &Submission) -> Result<[u8; 32]> {
        let mut inputs = Vec::new();
        if submission.request_id.is_some() {
            for &id in &submission.inputs {
                inputs.push((id, self.ledger().get_artifact(id).await?));
            }
        }
        Ok(fingerprint::whole(&submission.asked, &inputs))
    }

    async fn list(&self, request: &ListJobsRequest) -> Result<ListJobsResponse> {
        let size = page::size(request.page_size)?;
        let states = convert::states(&request.states)?;
        let numbers: Vec<u8> = states.iter().map(|&state| state as u8).collect();
        let query: [&[u8]; 2] = [b"jobs", &numbers];
        let before = page::position(&query, &request.page_token)?;
        // One more than asked for tells whether there is another page.
        let rows = self.ledger().list_jobs(&states, before, size + 1).await?;
        let (count, mut bytes) = (rows.len(), 0);
        let mut jobs = Vec::with_capacity(count.min(size as usize));
        let mut last = None;
        for row in rows.into_iter().take(size as usize) {
            let position = (row.create_time, row.id);
            let job = convert::job(row)?;
            bytes += job.encoded_len();
            if bytes > MAX_PAGE_BYTES && !jobs.is_empty() {
                break;
            }
            last = Some(position);
            jobs.push(job);
        }
        let more = last.filter(|_| count > jobs.len());
        Ok(ListJobsResponse {
            jobs,
            next_page_token: more.map(|at| page::token(&query, at)).unwrap_or_default(),
        })
    }
}
