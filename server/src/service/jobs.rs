//! Jobs that are submitted and listed.
use guardsplat_proto::v1::{CreateJobRequest, Job, ListJobsRequest, ListJobsResponse};
use prost::Message as _;
use uuid::Uuid;

use crate::access::{Caller, Scope};
use crate::error::{Error, Result};
use crate::ledger::{JobKind, JobSpec, NewJob};
use crate::service::claims::Disclosure;
use crate::service::rate_limit::{Class, payer};
use crate::service::submission::{self, Submission};
use crate::service::{
    Service, clock, fingerprint, keys, message, operations, ownership, page, predicted_cost, seeds, to_proto,
};

/// A page ends early rather than come near the largest message that clients read by default.
const MAX_PAGE_BYTES: usize = 2 << 20;
/// Claims are answered while somebody waits; scenes are marked overnight.
const PRIORITY_OF_VERIFY: i32 = 5;

/// How urgent a job is: as it says, or by its kind; never above the highest that callers may have.
fn urgency(submission: &Submission, highest: i32) -> Result<i32> {
    match submission.priority {
        Some(priority) if priority > highest => Err(Error::invalid(
            "job.priority",
            format!("is {priority}, the highest that this server takes is {highest}"),
        )),
        Some(priority) => Ok(priority),
        None if submission.spec.kind() == JobKind::Verify => Ok(PRIORITY_OF_VERIFY.min(highest)),
        None => Ok(highest.min(0)),
    }
}

impl Service {
    pub(crate) async fn submit(
        &self,
        request: CreateJobRequest,
        trace_parent: Option<String>,
        caller: &Caller,
    ) -> Result<Job> {
        let submission = submission::check(request)?;
        caller.must(ownership::scope_of(submission.spec.kind()))?;
        predicted_cost::check(&submission.spec, self.limits().max_job_gigapixels)?;
        let project = caller.project.as_str();
        let mut clip = None;
        if let Some(id) = submission.key {
            let key = self.owned_key(project, id).await?;
            if let Some((field, text)) = &submission.message {
                message::check(field, text, key.bits)?;
            }
            if let Err(error) = keys::usable(&key, submission.spec.kind())
                && !self.is_known(project, &submission).await?
            {
                return Err(error);
            }
            if let Some(claim) = &submission.claim {
                self.check_claim(project, claim, &key, &submission).await?;
            }
            clip = Some(key.clip_sha256).filter(|hash| !hash.is_empty());
        }
        if submission.spec.kind() == JobKind::Verify {
            if submission.claim.is_none() && !self.limits().raw_verification && !caller.scopes.has(Scope::Admin) {
                return Err(Error::ScopeNeeded {
                    what: "verifying without a claim on an asset tells every bit that is read, and needs it unless the \
                           operator sets allow_raw_verification",
                    needed: Scope::Admin.word(),
                });
            }
            self.shared.meter.count(Class::Claim, &payer(caller))?;
        }
        let priority = urgency(&submission, self.limits().max_priority)?;
        let mut requirements = self.admit(project, &submission).await?;
        requirements.clip = clip;
        let mut fingerprint = self.fingerprint(project, &submission).await?;
        let id = Uuid::now_v7();
        let spec = match submission.spec {
            JobSpec::CreateKey(order) if order.seed.is_some() => {
                fingerprint = seeds::fingerprint(self.master(), fingerprint);
                JobSpec::CreateKey(seeds::sealed(self.master(), id, order)?)
            }
            spec => spec,
        };
        let new = NewJob {
            id,
            project: project.to_owned(),
            display_name: submission.display_name,
            spec,
            inputs: submission.inputs,
            key: submission.key,
            request_id: submission.request_id.map(|id| ownership::request(project, id)),
            asked_id: submission.request_id,
            fingerprint,
            max_attempts: self.limits().max_attempts,
            priority,
            requirements,
            trace_parent,
        };
        let row = self.ledger().create_job(new, clock::now()).await;
        let row = row.map_err(|error| ownership::as_asked(error, submission.request_id))?;
        // A request that was sent again has made its job before.
        if row.id == id {
            self.metrics().created(row.kind());
        }
        self.changes().queue_grew();
        self.describe_job(row, self.disclosure(caller)).await
    }

    /// What a caller is told of jobs.
    pub(crate) fn disclosure(&self, caller: &Caller) -> Disclosure {
        Disclosure::to(caller, self.limits().raw_verification)
    }

    /// What a request is known by when it is sent again; needed only where it has a name.
    async fn fingerprint(&self, project: &str, submission: &Submission) -> Result<[u8; 32]> {
        let mut inputs = Vec::new();
        if submission.request_id.is_some() {
            for &id in &submission.inputs {
                inputs.push((id, self.find_artifact(project, id).await?));
            }
        }
        Ok(fingerprint::whole(&submission.asked, &inputs))
    }

    pub(crate) async fn list(&self, caller: &Caller, request: &ListJobsRequest) -> Result<ListJobsResponse> {
        let (project, disclosure) = (caller.project.as_str(), self.disclosure(caller));
        let size = page::size(request.page_size)?;
        let states = to_proto::states(&request.states)?;
        let numbers: Vec<u8> = states.iter().map(|&state| state as u8).collect();
        let reasons = operations::reasons(&request.reasons, &states)?;
        let reasons_asked: Vec<u8> = reasons.iter().map(|&reason| reason as u8).collect();
        // As it was before there were reasons to ask for, so that tokens of then are known.
        let query: &[&[u8]] = match reasons.is_empty() {
            true => &[b"jobs", &numbers],
            false => &[b"failed", &reasons_asked],
        };
        let before = page::position(query, &request.page_token)?;
        // One more than asked for tells whether there is another page.
        let mut rows = match reasons.is_empty() {
            true => self.ledger().list_jobs(project, &states, before, size + 1).await?,
            false => self.ledger().list_failed(project, &reasons, before, size + 1).await?,
        };
        self.place(&mut rows).await?;
        let (count, mut bytes) = (rows.len(), 0);
        let mut jobs = Vec::with_capacity(count.min(size as usize));
        let mut last = None;
        for row in rows.into_iter().take(size as usize) {
            let position = (row.create_time, row.id);
            let job = self.describe_job(row, disclosure).await?;
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
            next_page_token: more.map(|at| page::token(query, at)).unwrap_or_default(),
        })
    }
}
