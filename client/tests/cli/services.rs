//! The four services that clients use, over the state of the tests.
use std::pin::Pin;

use guardsplat_proto::v1::artifact_service_server::ArtifactService;
use guardsplat_proto::v1::job::State as JobState;
use guardsplat_proto::v1::job_service_server::JobService;
use guardsplat_proto::v1::key_service_server::KeyService;
use guardsplat_proto::v1::registry_service_server::RegistryService;
use guardsplat_proto::v1::{
    AppendUploadRequest, AppendUploadResponse, Artifact, Asset, CancelJobRequest, Commitment, CreateAssetRequest,
    CreateJobRequest, CreateOwnerRequest, DeleteArtifactRequest, DownloadArtifactRequest, DownloadArtifactResponse,
    ExportCommitmentRequest, ExportCommitmentResponse, FinishUploadRequest, GetArtifactRequest, GetAssetRequest,
    GetCommitmentRequest, GetDownloadUrlRequest, GetDownloadUrlResponse, GetHeadRequest, GetJobRequest, GetKeyRequest,
    GetOwnerRequest, GetPublicKeyRequest, HttpHeader, Job, JobAttempt, Key, ListAssetsRequest, ListAssetsResponse,
    ListCommitmentsRequest, ListCommitmentsResponse, ListJobAttemptsRequest, ListJobAttemptsResponse, ListJobsRequest,
    ListJobsResponse, ListKeysRequest, ListKeysResponse, ListOwnersRequest, ListOwnersResponse, ListWorkersRequest,
    ListWorkersResponse, Owner, PublicKey, RequeueJobRequest, RevealCommitmentRequest, RevealCommitmentResponse,
    StartUploadRequest, StartUploadResponse, UpdateKeyStateRequest, UploadArtifactRequest, WatchJobRequest,
    WatchJobResponse, Worker, download_artifact_response, job_attempt, upload_artifact_request,
};
use sha2::{Digest, Sha256};
use tokio::sync::mpsc;
use tokio_stream::Stream;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Code, Request, Response, Status, Streaming};
use tonic_types::{ErrorDetails, StatusExt};
use uuid::Uuid;

use super::fake::{Fake, Step};

type Replies<T> = Pin<Box<dyn Stream<Item = Result<T, Status>> + Send>>;

fn replies<T: Send + 'static>(items: Vec<Result<T, Status>>) -> Replies<T> {
    Box::pin(tokio_stream::iter(items))
}

/// That a resource is not there, told as the server tells it.
pub fn not_found(name: &str) -> Status {
    let mut details = ErrorDetails::new();
    details
        .set_error_info("NOT_FOUND", "guardsplat", [("name".to_owned(), name.to_owned())])
        .set_resource_info("guardsplat.v1/thing", name, "", "");
    Status::with_error_details(Code::NotFound, format!("{name} does not exist"), details)
}

/// That a request id stands for another request, told as the server tells it.
fn reused(request_id: &str) -> Status {
    let message = format!("request_id {request_id} was used for another job");
    let mut details = ErrorDetails::new();
    details
        .set_error_info("REQUEST_ID_REUSED", "guardsplat", [])
        .add_bad_request_violation("request_id", message.clone());
    Status::with_error_details(Code::AlreadyExists, message, details)
}

#[tonic::async_trait]
impl ArtifactService for Fake {
    async fn upload_artifact(
        &self,
        request: Request<Streaming<UploadArtifactRequest>>,
    ) -> Result<Response<Artifact>, Status> {
        self.state().uploads += 1;
        let mut stream = request.into_inner();
        let first = stream.message().await?.and_then(|message| message.payload);
        let Some(upload_artifact_request::Payload::Metadata(metadata)) = first else {
            return Err(Status::invalid_argument("metadata must come first"));
        };
        let error = self.state().upload_errors.pop_front();
        if let Some(error) = error {
            return Err(error);
        }
        let (mut bytes, mut chunks) = (Vec::new(), Vec::new());
        while let Some(message) = stream.message().await? {
            let Some(upload_artifact_request::Payload::Chunk(chunk)) = message.payload else {
                return Err(Status::invalid_argument("a chunk must come"));
            };
            chunks.push(chunk.len());
            bytes.extend(chunk);
        }
        if metadata.size_bytes != bytes.len() as i64 || metadata.sha256 != hex::encode(Sha256::digest(&bytes)) {
            return Err(Status::invalid_argument("these are other bytes"));
        }
        let name = self.store(&metadata.display_name, &bytes);
        let mut state = self.state();
        state.chunks = chunks;
        Ok(Response::new(state.artifacts[&name].0.clone()))
    }

    async fn start_upload(
        &self,
        request: Request<StartUploadRequest>,
    ) -> Result<Response<StartUploadResponse>, Status> {
        let metadata = request.into_inner().metadata.unwrap();
        let mut state = self.state();
        let Some(begin) = state.addresses_to_write.clone() else {
            return Ok(Response::new(StartUploadResponse::default()));
        };
        let upload = format!("uploads/{}", Uuid::new_v4());
        state.begun.insert(upload.clone(), (metadata, None));
        let header = HttpHeader {
            name: "x-ms-blob-type".into(),
            value: "BlockBlob".into(),
        };
        Ok(Response::new(StartUploadResponse {
            url: format!("{begin}/{upload}"),
            upload,
            headers: vec![header],
            expire_time: None,
        }))
    }

    async fn append_upload(&self, _: Request<AppendUploadRequest>) -> Result<Response<AppendUploadResponse>, Status> {
        Err(Status::unimplemented("for browsers"))
    }

    async fn finish_upload(&self, request: Request<FinishUploadRequest>) -> Result<Response<Artifact>, Status> {
        let upload = request.into_inner().upload;
        let (metadata, finished) = self.state().begun[&upload].clone();
        let bytes = self.state().put.clone();
        self.state().finishes += 1;
        let name = match finished {
            Some(name) => name,
            None if metadata.sha256 == hex::encode(Sha256::digest(&bytes)) => {
                self.store(&metadata.display_name, &bytes)
            }
            None => return Err(Status::invalid_argument("these are other bytes")),
        };
        let mut state = self.state();
        state.begun.insert(upload, (metadata, Some(name.clone())));
        match state.finish_errors.pop_front() {
            Some(error) => Err(error),
            None => Ok(Response::new(state.artifacts[&name].0.clone())),
        }
    }

    type DownloadArtifactStream = Replies<DownloadArtifactResponse>;

    async fn download_artifact(
        &self,
        request: Request<DownloadArtifactRequest>,
    ) -> Result<Response<Self::DownloadArtifactStream>, Status> {
        let request = request.into_inner();
        let mut state = self.state();
        state.offsets.push(request.offset);
        let found = state.artifacts.get(&request.name).cloned();
        let (artifact, mut bytes) = found.ok_or_else(|| not_found(&request.name))?;
        if state.damage {
            bytes[0] ^= 1;
        }
        let mut rest = bytes.split_off(request.offset as usize);
        let end = state.download_ends.pop_front();
        if let Some(end) = end {
            rest.truncate(end);
        }
        use download_artifact_response::Payload;
        let respond = |payload| Ok(DownloadArtifactResponse { payload: Some(payload) });
        let mut items = vec![respond(Payload::Artifact(artifact))];
        items.extend(
            rest.chunks(100_000)
                .map(|chunk| respond(Payload::Chunk(chunk.to_vec()))),
        );
        if end.is_some() {
            items.push(Err(Status::unavailable("going down")));
        }
        Ok(Response::new(replies(items)))
    }

    async fn get_download_url(
        &self,
        request: Request<GetDownloadUrlRequest>,
    ) -> Result<Response<GetDownloadUrlResponse>, Status> {
        let name = request.into_inner().name;
        let state = self.state();
        let (artifact, _) = state.artifacts.get(&name).ok_or_else(|| not_found(&name))?;
        let address = state.addresses.as_ref();
        Ok(Response::new(GetDownloadUrlResponse {
            artifact: Some(artifact.clone()),
            url: address.map(|begin| format!("{begin}/{name}")).unwrap_or_default(),
            expire_time: None,
        }))
    }

    async fn get_artifact(&self, request: Request<GetArtifactRequest>) -> Result<Response<Artifact>, Status> {
        Err(Status::unimplemented(request.into_inner().name))
    }

    async fn delete_artifact(&self, request: Request<DeleteArtifactRequest>) -> Result<Response<()>, Status> {
        let name = request.into_inner().name;
        let mut state = self.state();
        state.deleted.push(name.clone());
        state
            .artifacts
            .remove(&name)
            .map(|_| Response::new(()))
            .ok_or_else(|| not_found(&name))
    }
}

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

#[tonic::async_trait]
impl KeyService for Fake {
    async fn get_key(&self, request: Request<GetKeyRequest>) -> Result<Response<Key>, Status> {
        let name = request.into_inner().name;
        let key = self.state().keys.iter().find(|key| key.name == name).cloned();
        key.map(Response::new).ok_or_else(|| not_found(&name))
    }

    async fn list_keys(&self, request: Request<ListKeysRequest>) -> Result<Response<ListKeysResponse>, Status> {
        let from: usize = request.into_inner().page_token.parse().unwrap_or(0);
        let keys = &self.state().keys;
        let to = (from + 2).min(keys.len());
        Ok(Response::new(ListKeysResponse {
            keys: keys[from..to].to_vec(),
            next_page_token: if to < keys.len() { to.to_string() } else { String::new() },
        }))
    }

    async fn update_key_state(&self, _: Request<UpdateKeyStateRequest>) -> Result<Response<Key>, Status> {
        Err(Status::unimplemented("no test changes a key's state"))
    }
}

#[tonic::async_trait]
impl RegistryService for Fake {
    async fn create_owner(&self, request: Request<CreateOwnerRequest>) -> Result<Response<Owner>, Status> {
        let mut owner = request.into_inner().owner.unwrap();
        owner.name = format!("owners/{}", Uuid::new_v4());
        self.state().owners.insert(0, owner.clone());
        Ok(Response::new(owner))
    }

    async fn get_owner(&self, request: Request<GetOwnerRequest>) -> Result<Response<Owner>, Status> {
        let name = request.into_inner().name;
        let owner = self.state().owners.iter().find(|owner| owner.name == name).cloned();
        owner.map(Response::new).ok_or_else(|| not_found(&name))
    }

    async fn list_owners(&self, _: Request<ListOwnersRequest>) -> Result<Response<ListOwnersResponse>, Status> {
        Ok(Response::new(ListOwnersResponse {
            owners: self.state().owners.clone(),
            next_page_token: String::new(),
        }))
    }

    async fn create_asset(&self, request: Request<CreateAssetRequest>) -> Result<Response<Asset>, Status> {
        let mut asset = request.into_inner().asset.unwrap();
        asset.name = format!("assets/{}", Uuid::new_v4());
        self.state().registered.push(asset.clone());
        Ok(Response::new(asset))
    }

    async fn get_asset(&self, request: Request<GetAssetRequest>) -> Result<Response<Asset>, Status> {
        let name = request.into_inner().name;
        let asset = self.state().registered.iter().find(|asset| asset.name == name).cloned();
        asset.map(Response::new).ok_or_else(|| not_found(&name))
    }

    async fn list_assets(&self, request: Request<ListAssetsRequest>) -> Result<Response<ListAssetsResponse>, Status> {
        let ListAssetsRequest { owner, key, .. } = request.into_inner();
        let wanted =
            |asset: &&Asset| (owner.is_empty() || asset.owner == owner) && (key.is_empty() || asset.key == key);
        Ok(Response::new(ListAssetsResponse {
            assets: self.state().registered.iter().rev().filter(wanted).cloned().collect(),
            next_page_token: String::new(),
        }))
    }

    async fn get_commitment(&self, _: Request<GetCommitmentRequest>) -> Result<Response<Commitment>, Status> {
        Err(Status::unimplemented("no client asks for it"))
    }

    async fn list_commitments(
        &self,
        _: Request<ListCommitmentsRequest>,
    ) -> Result<Response<ListCommitmentsResponse>, Status> {
        Err(Status::unimplemented("no client asks for it"))
    }

    async fn get_head(&self, _: Request<GetHeadRequest>) -> Result<Response<Commitment>, Status> {
        Err(Status::unimplemented("no client asks for it"))
    }

    async fn export_commitment(
        &self,
        _: Request<ExportCommitmentRequest>,
    ) -> Result<Response<ExportCommitmentResponse>, Status> {
        Err(Status::unimplemented("no client asks for it"))
    }

    async fn reveal_commitment(
        &self,
        request: Request<RevealCommitmentRequest>,
    ) -> Result<Response<RevealCommitmentResponse>, Status> {
        let opened = self.state().opened.clone();
        let document = opened.ok_or_else(|| not_found(&request.into_inner().name))?;
        Ok(Response::new(RevealCommitmentResponse {
            document,
            reveal_time: Some(prost_types::Timestamp {
                seconds: 1_800_000_000,
                nanos: 0,
            }),
        }))
    }

    async fn get_public_key(&self, _: Request<GetPublicKeyRequest>) -> Result<Response<PublicKey>, Status> {
        Ok(Response::new(PublicKey {
            hex: self.state().public_key.clone(),
            pem: "-----BEGIN PUBLIC KEY-----".into(),
        }))
    }
}
