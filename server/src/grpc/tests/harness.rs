//! A server for one test, and what a client and a worker do with it.
use std::fmt::Debug;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use guardsplat_proto::v1::artifact_service_client::ArtifactServiceClient;
use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::key_service_client::KeyServiceClient;
use guardsplat_proto::v1::registry_service_client::RegistryServiceClient;
use guardsplat_proto::v1::worker_service_client::WorkerServiceClient;
use guardsplat_proto::v1::{
    Artifact, CompleteJobRequest, CreateJobRequest, EmbedSpec, GetJobRequest, Job, Key, KeyOutput, KeyResult, KeySpec,
    LeaseJobRequest, LeaseJobResponse, OutputMetadata, UploadArtifactRequest, UploadMetadata, UploadOutputRequest,
    VerifySpec, upload_artifact_request, upload_output_request,
};
use secrecy::ExposeSecret;
use sha2::{Digest, Sha256};
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tonic::transport::Channel;
use tonic::{Code, Response, Status};
use tonic_types::{ErrorDetails, StatusExt};

use crate::access::{self, Scope};
use crate::artifacts::ArtifactStore;
use crate::grpc::guard::Guard;
use crate::grpc::listener::{ConnectionLimits, HANDSHAKE, ListenerOptions, Protocol, serve};
use crate::ledger::{Ledger, NewToken, SqliteLedger};
use crate::notary::Notary;
use crate::secrets::{self, KeySource};
use crate::service::{Limits, Service};
use crate::tasks::housekeeping::housekeeping;
use crate::tasks::remote_changes::relay;
use crate::traces::Traces;

pub const MAX_ARTIFACT_BYTES: u64 = 8 << 20;

/// A server with a folder of its own.
pub struct Server {
    pub api: Service,
    pub jobs: JobServiceClient<Channel>,
    pub artifacts: ArtifactServiceClient<Channel>,
    pub keys: KeyServiceClient<Channel>,
    pub registry: RegistryServiceClient<Channel>,
    pub worker: WorkerServiceClient<Channel>,
    pub channel: Channel,
    pub url: String,
    folder: TempDir,
    ledger: Arc<dyn Ledger>,
    tokens: bool,
    end: oneshot::Sender<()>,
    served: JoinHandle<crate::error::Result<()>>,
    housekeeper: JoinHandle<()>,
}

impl Server {
    pub async fn start() -> Self {
        Self::with(Limits::default()).await
    }

    pub async fn with(limits: Limits) -> Self {
        Self::in_folder(TempDir::new().unwrap(), limits, false).await
    }

    /// One that asks for tokens.
    pub async fn with_tokens() -> Self {
        Self::with_tokens_and(Limits::default()).await
    }

    pub async fn with_tokens_and(limits: Limits) -> Self {
        Self::in_folder(TempDir::new().unwrap(), limits, true).await
    }

    async fn in_folder(folder: TempDir, limits: Limits, tokens: bool) -> Self {
        let ledger = SqliteLedger::open(&folder.path().join("ledger.sqlite")).await.unwrap();
        Self::over(Arc::new(ledger), folder, limits, tokens).await
    }

    /// A server over a ledger that others may use too. The folder has the master key, and its artifacts.
    pub async fn over(ledger: Arc<dyn Ledger>, folder: TempDir, limits: Limits, tokens: bool) -> Self {
        Self::made_of(ledger, folder, limits, tokens, Traces::default()).await
    }

    /// One that sends traces.
    pub async fn traced(limits: Limits, traces: Traces) -> Self {
        let folder = TempDir::new().unwrap();
        let ledger = SqliteLedger::open(&folder.path().join("ledger.sqlite")).await.unwrap();
        Self::made_of(Arc::new(ledger), folder, limits, false, traces).await
    }

    async fn made_of(ledger: Arc<dyn Ledger>, folder: TempDir, limits: Limits, tokens: bool, traces: Traces) -> Self {
        let store = ArtifactStore::open(&folder.path().join("artifacts"), MAX_ARTIFACT_BYTES).unwrap();
        Self::begun(ledger, store, folder, limits, tokens, traces).await
    }

    /// A server over a store that others may use too.
    pub async fn with_store(
        ledger: Arc<dyn Ledger>,
        store: ArtifactStore,
        folder: TempDir,
        limits: Limits,
        tokens: bool,
    ) -> Self {
        Self::begun(ledger, store, folder, limits, tokens, Traces::default()).await
    }

    async fn begun(
        ledger: Arc<dyn Ledger>,
        store: ArtifactStore,
        folder: TempDir,
        limits: Limits,
        tokens: bool,
        traces: Traces,
    ) -> Self {
        let master = secrets::load(KeySource::DataFolder, folder.path()).unwrap();
        let notary = Notary::open(ledger.as_ref(), &master, 0).await.unwrap();
        let api = Service::new(ledger.clone(), store, master, notary, limits).traced(traces);
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let (end, ended) = oneshot::channel();
        let shutdown = async { ended.await.unwrap_or_default() };
        let guard = match tokens {
            true => Guard::tokens(api.meter(), ledger.clone(), None),
            false => Guard::open(api.meter()),
        };
        let (_, health) = tonic_health::server::health_reporter();
        let routes = api.routes().unwrap().add_service(health);
        let door = ListenerOptions {
            guard,
            tls: None,
            protocol: Protocol::Grpc,
            connections: ConnectionLimits::default(),
            handshake: HANDSHAKE,
            idle: None,
            api: api.clone(),
        };
        let served = tokio::spawn(serve(routes, door, listener, shutdown));
        let housekeeper = tokio::spawn(housekeeping(api.clone()));
        tokio::spawn(relay(api.clone()));
        let channel = Channel::from_shared(url.clone()).unwrap().connect_lazy();
        Self {
            jobs: JobServiceClient::new(channel.clone()),
            artifacts: ArtifactServiceClient::new(channel.clone()),
            keys: KeyServiceClient::new(channel.clone()),
            registry: RegistryServiceClient::new(channel.clone()),
            worker: WorkerServiceClient::new(channel.clone()),
            channel,
            url,
            api,
            folder,
            ledger,
            tokens,
            end,
            served,
            housekeeper,
        }
    }

    /// Another server with the same master key, and a folder of its own.
    pub async fn twin(&self, ledger: Arc<dyn Ledger>) -> Self {
        let folder = self.folder_of_a_twin();
        Self::over(ledger, folder, self.api.limits().clone(), self.tokens).await
    }

    /// Another server over the same ledger and artifacts, which asks for tokens.
    pub async fn with_a_door(&self, limits: Limits) -> Self {
        let (store, folder) = (self.api.store().clone(), self.folder_of_a_twin());
        Self::with_store(self.ledger(), store, folder, limits, true).await
    }

    /// A new folder with the same master key.
    pub fn folder_of_a_twin(&self) -> TempDir {
        let folder = TempDir::new().unwrap();
        std::fs::copy(self.folder.path().join("master.key"), folder.path().join("master.key")).unwrap();
        folder
    }

    /// Stops in good order, and starts another server over the same folder.
    pub async fn restart(self, limits: Limits) -> Self {
        self.restart_after(Duration::ZERO, limits).await
    }

    /// As [`Self::restart`], with no server at all for a while in between.
    pub async fn restart_after(self, absence: Duration, limits: Limits) -> Self {
        self.api.stop();
        self.end.send(()).unwrap();
        drop((self.jobs, self.artifacts, self.keys));
        drop((self.registry, self.worker, self.channel));
        self.served.await.unwrap().unwrap();
        self.housekeeper.await.unwrap();
        self.ledger.close().await;
        tokio::time::sleep(absence).await;
        Self::in_folder(self.folder, limits, self.tokens).await
    }

    /// A token of a project that is good for these.
    pub async fn token(&self, project: &str, scopes: &[Scope]) -> String {
        self.token_until(project, scopes, None).await
    }

    /// One that ends at a time.
    pub async fn token_until(&self, project: &str, scopes: &[Scope], expire_time: Option<i64>) -> String {
        let fresh = access::fresh().unwrap();
        let new = NewToken {
            id: fresh.id,
            hash: fresh.hash,
            display_name: String::new(),
            project: project.into(),
            scopes: scopes.iter().copied().collect(),
            expire_time,
        };
        self.ledger.create_token(new, 0).await.unwrap();
        fresh.text.expose_secret().to_owned()
    }

    pub fn ledger(&self) -> Arc<dyn Ledger> {
        self.ledger.clone()
    }

    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// What is in the files of the ledger.
    pub fn ledger_files(&self) -> Vec<Vec<u8>> {
        let names = ["ledger.sqlite", "ledger.sqlite-wal"].map(|name| self.folder.path().join(name));
        names.into_iter().filter_map(|path| std::fs::read(path).ok()).collect()
    }

    /// All files of artifacts there are, staged ones too; without what says whose the folder is.
    pub fn files(&self) -> Vec<PathBuf> {
        let mut found = Vec::new();
        let folder = self.folder.path().join("artifacts");
        walk(&folder, &mut found);
        found.retain(|path| path.parent() != Some(&folder));
        found
    }

    pub async fn create(&self, spec: Spec) -> Job {
        let job = Job {
            spec: Some(spec),
            ..Default::default()
        };
        self.submit(job, "").await.unwrap().into_inner()
    }

    pub async fn submit(&self, job: Job, request_id: &str) -> Result<Response<Job>, Status> {
        let request = CreateJobRequest {
            job: Some(job),
            request_id: request_id.into(),
        };
        self.jobs.clone().create_job(request).await
    }

    pub async fn job(&self, name: &str) -> Job {
        let request = GetJobRequest { name: name.into() };
        self.jobs.clone().get_job(request).await.unwrap().into_inner()
    }

    pub async fn upload(&self, name: &str, bytes: &[u8]) -> Artifact {
        let messages = upload_messages(metadata(name, bytes), bytes);
        self.artifacts
            .clone()
            .upload_artifact(tokio_stream::iter(messages))
            .await
            .unwrap()
            .into_inner()
    }

    /// Leases the next job, or gets an empty answer.
    pub async fn lease(&self, wait: Duration) -> LeaseJobResponse {
        let wait = Some(prost_types::Duration::try_from(wait).unwrap());
        let request = LeaseJobRequest {
            worker: "test".into(),
            wait,
            ..LeaseJobRequest::default()
        };
        self.worker.clone().lease_job(request).await.unwrap().into_inner()
    }

    /// Leases the next job, which must be there.
    pub async fn take(&self) -> (Job, String) {
        let lease = self.lease(Duration::ZERO).await;
        (lease.job.expect("there is no job"), lease.lease_token)
    }

    pub async fn output(
        &self,
        job: &str,
        token: &str,
        bytes: &[u8],
        secret: bool,
    ) -> Result<Response<Artifact>, Status> {
        let upload = metadata("output.bin", bytes);
        let first = OutputMetadata {
            job: job.into(),
            lease_token: token.into(),
            upload: Some(upload),
            secret,
        };
        let mut messages = vec![output_message(upload_output_request::Payload::Metadata(first))];
        let chunks = bytes.chunks(1 << 20).map(<[u8]>::to_vec);
        messages.extend(chunks.map(|chunk| output_message(upload_output_request::Payload::Chunk(chunk))));
        self.worker.clone().upload_output(tokio_stream::iter(messages)).await
    }

    /// The name of an output that was stored.
    pub async fn stored(&self, job: &str, token: &str, bytes: &[u8], secret: bool) -> String {
        let answer = self.output(job, token, bytes, secret).await;
        answer.unwrap().into_inner().name
    }

    pub async fn complete(&self, job: &str, token: &str, result: Output) -> Result<(), Status> {
        let request = CompleteJobRequest {
            name: job.into(),
            lease_token: token.into(),
            result: Some(result),
            ..CompleteJobRequest::default()
        };
        self.worker.clone().complete_job(request).await.map(|_| ())
    }

    /// A key made by a job, with this key file. The queue must be empty.
    pub async fn key(&self, bits: u32, file: &[u8]) -> String {
        let job = self
            .create(Spec::CreateKey(KeySpec {
                bits,
                seed: None,
                ..KeySpec::default()
            }))
            .await;
        let (leased, token) = self.take().await;
        assert_eq!(leased.name, job.name);
        let output = self.stored(&job.name, &token, file, true).await;
        self.complete(&job.name, &token, Output::KeyOutput(key_output(bits, &output)))
            .await
            .unwrap();
        match self.job(&job.name).await.result.unwrap() {
            guardsplat_proto::v1::job::Result::KeyResult(result) => result.key,
            other => panic!("{other:?}"),
        }
    }

    /// A queued `embed` job with a scene and a key of its own. The queue must be empty.
    pub async fn embed_job(&self) -> Job {
        let key = self.key(16, b"the key file").await;
        let scene = self.upload("scene.ply", b"a scene").await.name;
        self.create(Spec::Embed(EmbedSpec {
            scene,
            key,
            message: "beef".into(),
            ..Default::default()
        }))
        .await
    }
}

fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.path().is_dir() {
            walk(&entry.path(), found)
        } else {
            found.push(entry.path())
        }
    }
}

pub fn sha256(bytes: &[u8]) -> String {
    hex::encode(Sha256::digest(bytes))
}

pub fn metadata(name: &str, bytes: &[u8]) -> UploadMetadata {
    UploadMetadata {
        display_name: name.into(),
        size_bytes: bytes.len() as i64,
        sha256: sha256(bytes),
    }
}

pub fn first(metadata: UploadMetadata) -> UploadArtifactRequest {
    UploadArtifactRequest {
        payload: Some(upload_artifact_request::Payload::Metadata(metadata)),
    }
}

pub fn chunk(bytes: &[u8]) -> UploadArtifactRequest {
    UploadArtifactRequest {
        payload: Some(upload_artifact_request::Payload::Chunk(bytes.to_vec())),
    }
}

fn output_message(payload: upload_output_request::Payload) -> UploadOutputRequest {
    UploadOutputRequest { payload: Some(payload) }
}

pub fn upload_messages(metadata: UploadMetadata, bytes: &[u8]) -> Vec<UploadArtifactRequest> {
    std::iter::once(first(metadata))
        .chain(bytes.chunks(1 << 20).map(chunk))
        .collect()
}

pub fn key_spec(bits: u32) -> Spec {
    Spec::CreateKey(KeySpec {
        bits,
        seed: None,
        ..KeySpec::default()
    })
}

pub fn verify_spec(suspect: &str, key: &str) -> Spec {
    Spec::Verify(VerifySpec {
        suspects: vec![suspect.into()],
        key: key.into(),
        ..Default::default()
    })
}

pub fn key_output(bits: u32, file: &str) -> KeyOutput {
    let key = Key {
        bits,
        clip: "a clip".into(),
        clip_sha256: sha256(b"weights"),
        ..Default::default()
    };
    KeyOutput {
        key_file: file.into(),
        key: Some(key),
        result: Some(KeyResult::default()),
    }
}

/// Waits until `holds`, for a few seconds at most.
pub async fn soon(what: &str, mut holds: impl AsyncFnMut() -> bool) {
    for _ in 0..300 {
        if holds().await {
            return;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    panic!("{what} did not happen");
}

/// The details of an error with this code and reason; every error must have both.
#[track_caller]
pub fn refused<T: Debug>(answer: Result<T, Status>, code: Code, reason: &str) -> ErrorDetails {
    let status = answer.expect_err("was taken");
    let details = status.check_error_details().unwrap();
    let info = details
        .error_info()
        .unwrap_or_else(|| panic!("no ErrorInfo: {status:?}"));
    assert_eq!(
        (status.code(), info.reason.as_str(), info.domain.as_str()),
        (code, reason, "guardsplat"),
        "{status:?}"
    );
    details
}

/// As [`refused`], for fields that are wrong: their paths.
#[track_caller]
pub fn invalid<T: Debug>(answer: Result<T, Status>) -> Vec<String> {
    let details = refused(answer, Code::InvalidArgument, "INVALID_FIELD");
    let violations = &details.bad_request().expect("no BadRequest").field_violations;
    assert!(violations.iter().all(|violation| !violation.description.is_empty()));
    violations.iter().map(|violation| violation.field.clone()).collect()
}

/// As [`refused`], for resources that are not there: their names.
#[track_caller]
pub fn not_found<T: Debug>(answer: Result<T, Status>) -> String {
    let details = refused(answer, Code::NotFound, "NOT_FOUND");
    details.resource_info().expect("no ResourceInfo").resource_name.clone()
}
