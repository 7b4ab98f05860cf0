//! A server in miniature: hands out the jobs it is given, keeps bytes in memory, and says what it is told.
use std::collections::{HashMap, VecDeque};
use std::net::SocketAddr;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, mpsc};
use std::time::{Duration, Instant};

use guardsplat_proto::v1::artifact_service_server::{ArtifactService, ArtifactServiceServer};
use guardsplat_proto::v1::complete_job_request::Result as Done;
use guardsplat_proto::v1::worker_service_server::{WorkerService, WorkerServiceServer};
use guardsplat_proto::v1::*;
use sha2::{Digest, Sha256};
use tokio::sync::Notify;
use tokio_stream::Stream;
use tonic::transport::server::TcpIncoming;
use tonic::{Code, Request, Response, Status, Streaming};
use tonic_types::{ErrorDetails, StatusExt};

/// What a worker did.
#[derive(Clone, Debug)]
pub enum Event {
    Reported(Progress),
    Completed(Box<Done>),
    Failed(FailJobRequest),
    Released,
}

#[derive(Default)]
struct State {
    queue: Mutex<VecDeque<Job>>,
    grew: Notify,
    artifacts: Mutex<HashMap<String, (Artifact, Vec<u8>)>>,
    key: Mutex<Vec<u8>>,
    /// The job that is leased; its token is its name backwards.
    leased: Mutex<Option<String>>,
    cancel: AtomicBool,
    break_download: AtomicBool,
    said: Mutex<Option<mpsc::Sender<Event>>>,
}

impl State {
    fn say(&self, event: Event) {
        let said = self.said.lock().unwrap();
        let _ = said.as_ref().unwrap().send(event);
    }

    /// Fails as a real server does unless the token is that of the lease.
    fn check(&self, job: &str, token: &str) -> Result<(), Status> {
        let leased = self.leased.lock().unwrap();
        if leased.as_deref() == Some(job) && token == token_of(job) {
            return Ok(());
        }
        let details = ErrorDetails::with_error_info("LEASE_LOST", "guardsplat", HashMap::new());
        Err(Status::with_error_details(Code::Aborted, "the lease is lost", details))
    }
}

fn token_of(job: &str) -> String {
    job.chars().rev().collect()
}

/// The server, and what its worker did.
pub struct Server {
    /// Where it listens.
    pub address: SocketAddr,
    state: Arc<State>,
    events: mpsc::Receiver<Event>,
    jobs: usize,
}

impl Server {
    /// Listens on `address` from now on; port 0 is any.
    pub fn start(address: SocketAddr) -> Self {
        let (sender, events) = mpsc::channel();
        let state = Arc::new(State {
            said: Mutex::new(Some(sender)),
            ..State::default()
        });
        let service = state.clone();
        let (ready, is_ready) = mpsc::channel();
        std::thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_current_thread()
                .enable_all()
                .build()
                .unwrap();
            runtime.block_on(async {
                let incoming = TcpIncoming::bind(address).unwrap();
                ready.send(incoming.local_addr().unwrap()).unwrap();
                tonic::transport::Server::builder()
                    .add_service(WorkerServiceServer::new(Service(service.clone())))
                    .add_service(ArtifactServiceServer::new(Service(service)))
                    .serve_with_incoming(incoming)
                    .await
                    .unwrap();
            });
        });
        let address = is_ready.recv().unwrap();
        Self {
            address,
            state,
            events,
            jobs: 0,
        }
    }

    /// Stores an artifact.
    pub fn store(&self, display_name: &str, bytes: &[u8]) -> String {
        self.store_as(display_name, bytes, hex::encode(Sha256::digest(bytes)))
    }

    /// Stores an artifact that says this of itself.
    pub fn store_as(&self, display_name: &str, bytes: &[u8], sha256: String) -> String {
        keep(&self.state, display_name.into(), bytes.to_vec(), sha256).name
    }

    /// An artifact's bytes.
    pub fn bytes(&self, name: &str) -> Vec<u8> {
        self.state.artifacts.lock().unwrap()[name].1.clone()
    }

    /// The key that jobs are given.
    pub fn set_key(&self, bytes: &[u8]) {
        *self.state.key.lock().unwrap() = bytes.to_vec();
    }

    /// Queues a job.
    pub fn submit(&mut self, spec: job::Spec) {
        self.jobs += 1;
        let job = Job {
            name: format!("jobs/{}", self.jobs),
            spec: Some(spec),
            attempt: 1,
            ..Job::default()
        };
        self.state.cancel.store(false, Ordering::SeqCst);
        self.state.queue.lock().unwrap().push_back(job);
        self.state.grew.notify_one();
    }

    /// Asks for the end of the job that is running.
    pub fn cancel(&self) {
        self.state.cancel.store(true, Ordering::SeqCst);
    }

    /// As if the lease had expired.
    pub fn take_away(&self) {
        *self.state.leased.lock().unwrap() = None;
    }

    /// The next download breaks off half-way.
    pub fn break_download(&self) {
        self.state.break_download.store(true, Ordering::SeqCst);
    }

    /// The next thing that the worker does besides heartbeats; those are added to `progress`.
    pub fn next(&self, progress: &mut Vec<Progress>) -> Event {
        let deadline = Instant::now() + Duration::from_secs(120);
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            match self.events.recv_timeout(left).expect("the worker does something") {
                Event::Reported(told) => progress.push(told),
                event => return event,
            }
        }
    }

    /// Waits for a heartbeat that tells of this stage.
    pub fn wait_for(&self, stage: progress::Stage) {
        let deadline = Instant::now() + Duration::from_secs(60);
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            match self.events.recv_timeout(left).expect("the worker comes so far") {
                Event::Reported(told) if told.stage() == stage => return,
                Event::Reported(_) => {}
                other => panic!("{other:?}"),
            }
        }
    }
}

fn keep(state: &State, display_name: String, bytes: Vec<u8>, sha256: String) -> Artifact {
    let mut artifacts = state.artifacts.lock().unwrap();
    let artifact = Artifact {
        name: format!("artifacts/{}", artifacts.len() + 1),
        display_name,
        size_bytes: bytes.len() as i64,
        sha256,
        ..Artifact::default()
    };
    artifacts.insert(artifact.name.clone(), (artifact.clone(), bytes));
    artifact
}

struct Service(Arc<State>);

type Sent<T> = Pin<Box<dyn Stream<Item = Result<T, Status>> + Send>>;

fn stream<T: Send + 'static>(messages: Vec<Result<T, Status>>) -> Response<Sent<T>> {
    Response::new(Box::pin(tokio_stream::iter(messages)))
}

#[tonic::async_trait]
impl ArtifactService for Service {
    type DownloadArtifactStream = Sent<DownloadArtifactResponse>;

    async fn download_artifact(
        &self,
        request: Request<DownloadArtifactRequest>,
    ) -> Result<Response<Self::DownloadArtifactStream>, Status> {
        use download_artifact_response::Payload;
        let request = request.into_inner();
        let artifacts = self.0.artifacts.lock().unwrap();
        let (artifact, bytes) = artifacts
            .get(&request.name)
            .ok_or(Status::not_found("no such artifact"))?;
        let message = |payload| Ok(DownloadArtifactResponse { payload: Some(payload) });
        let mut messages = vec![message(Payload::Artifact(artifact.clone()))];
        let chunks = bytes[request.offset as usize..].chunks(4096);
        messages.extend(chunks.map(|chunk| message(Payload::Chunk(chunk.to_vec()))));
        if self.0.break_download.swap(false, Ordering::SeqCst) {
            messages.truncate(messages.len() / 2);
            messages.push(Err(Status::unavailable("the cable was pulled")));
        }
        Ok(stream(messages))
    }

    async fn upload_artifact(
        &self,
        _: Request<Streaming<UploadArtifactRequest>>,
    ) -> Result<Response<Artifact>, Status> {
        Err(Status::unimplemented("not for workers"))
    }

    async fn get_download_url(
        &self,
        _: Request<GetDownloadUrlRequest>,
    ) -> Result<Response<GetDownloadUrlResponse>, Status> {
        Err(Status::unimplemented("not for workers"))
    }

    async fn start_upload(&self, _: Request<StartUploadRequest>) -> Result<Response<StartUploadResponse>, Status> {
        Err(Status::unimplemented("not for workers"))
    }

    async fn append_upload(&self, _: Request<AppendUploadRequest>) -> Result<Response<AppendUploadResponse>, Status> {
        Err(Status::unimplemented("not for workers"))
    }

    async fn finish_upload(&self, _: Request<FinishUploadRequest>) -> Result<Response<Artifact>, Status> {
        Err(Status::unimplemented("not for workers"))
    }

    async fn get_artifact(&self, _: Request<GetArtifactRequest>) -> Result<Response<Artifact>, Status> {
        Err(Status::unimplemented("not for workers"))
    }

    async fn delete_artifact(&self, _: Request<DeleteArtifactRequest>) -> Result<Response<()>, Status> {
        Err(Status::unimplemented("not for workers"))
    }
}

#[tonic::async_trait]
impl WorkerService for Service {
    type DownloadKeyStream = Sent<DownloadKeyResponse>;

    async fn lease_job(&self, request: Request<LeaseJobRequest>) -> Result<Response<LeaseJobResponse>, Status> {
        let wait = Duration::try_from(request.into_inner().wait.unwrap()).unwrap();
        let deadline = tokio::time::Instant::now() + wait;
        loop {
            if let Some(job) = self.0.queue.lock().unwrap().pop_front() {
                *self.0.leased.lock().unwrap() = Some(job.name.clone());
                return Ok(Response::new(LeaseJobResponse {
                    lease_token: token_of(&job.name),
                    lease_duration: Some(Duration::from_secs(2).try_into().unwrap()),
                    job: Some(job),
                    ..LeaseJobResponse::default()
                }));
            }
            if tokio::time::timeout_at(deadline, self.0.grew.notified()).await.is_err() {
                return Ok(Response::new(Default::default()));
            }
        }
    }

    async fn report_job(&self, request: Request<ReportJobRequest>) -> Result<Response<ReportJobResponse>, Status> {
        let request = request.into_inner();
        self.0.check(&request.name, &request.lease_token)?;
        if let Some(progress) = request.progress {
            self.0.say(Event::Reported(progress));
        }
        let cancel_requested = self.0.cancel.load(Ordering::SeqCst);
        Ok(Response::new(ReportJobResponse { cancel_requested }))
    }

    async fn upload_output(
        &self,
        request: Request<Streaming<UploadOutputRequest>>,
    ) -> Result<Response<Artifact>, Status> {
        use upload_output_request::Payload;
        let mut messages = request.into_inner();
        let (mut announced, mut bytes) = (None, Vec::new());
        while let Some(message) = messages.message().await? {
            match message.payload.unwrap() {
                Payload::Metadata(metadata) => announced = Some(metadata),
                Payload::Chunk(chunk) => {
                    assert!(announced.is_some() && chunk.len() <= 1 << 20);
                    bytes.extend(chunk);
                }
            }
        }
        let metadata = announced.unwrap();
        self.0.check(&metadata.job, &metadata.lease_token)?;
        let upload = metadata.upload.unwrap();
        assert_eq!(upload.size_bytes as usize, bytes.len());
        assert_eq!(upload.sha256, hex::encode(Sha256::digest(&bytes)));
        let secret = if metadata.secret { "secret " } else { "" };
        let name = format!("{secret}{}", upload.display_name);
        Ok(Response::new(keep(&self.0, name, bytes, upload.sha256)))
    }

    async fn download_key(
        &self,
        request: Request<DownloadKeyRequest>,
    ) -> Result<Response<Self::DownloadKeyStream>, Status> {
        let request = request.into_inner();
        self.0.check(&request.job, &request.lease_token)?;
        let key = self.0.key.lock().unwrap();
        let chunks = key.chunks(1 << 16);
        Ok(stream(
            chunks
                .map(|chunk| Ok(DownloadKeyResponse { chunk: chunk.to_vec() }))
                .collect(),
        ))
    }

    async fn complete_job(
        &self,
        request: Request<CompleteJobRequest>,
    ) -> Result<Response<CompleteJobResponse>, Status> {
        let request = request.into_inner();
        self.0.check(&request.name, &request.lease_token)?;
        self.0.say(Event::Completed(Box::new(request.result.unwrap())));
        Ok(Response::new(Default::default()))
    }

    async fn fail_job(&self, request: Request<FailJobRequest>) -> Result<Response<FailJobResponse>, Status> {
        let request = request.into_inner();
        self.0.check(&request.name, &request.lease_token)?;
        self.0.say(Event::Failed(request));
        Ok(Response::new(Default::default()))
    }

    async fn release_job(&self, request: Request<ReleaseJobRequest>) -> Result<Response<ReleaseJobResponse>, Status> {
        let request = request.into_inner();
        self.0.check(&request.name, &request.lease_token)?;
        self.0.say(Event::Released);
        Ok(Response::new(Default::default()))
    }
}
