//! A server of the tests' own: it keeps what it is sent, and answers as it was told to.
use std::collections::{BTreeMap, VecDeque};
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, MutexGuard};

use guardsplat_proto::v1::artifact_service_server::ArtifactServiceServer;
use guardsplat_proto::v1::hook_service_server::HookServiceServer;
use guardsplat_proto::v1::job::{Result as Outcome, Spec, State as JobState};
use guardsplat_proto::v1::job_service_server::JobServiceServer;
use guardsplat_proto::v1::key_service_server::KeyServiceServer;
use guardsplat_proto::v1::registry_service_server::RegistryServiceServer;
use guardsplat_proto::v1::token_service_server::TokenServiceServer;
use guardsplat_proto::v1::{
    Artifact, Asset, CreateJobRequest, Delivery, EmbedResult, Failure, Hook, Job, Key, Owner, Token, UploadMetadata,
    WatchJobRequest,
};
use sha2::{Digest, Sha256};
use tonic::service::InterceptorLayer;
use tonic::transport::Server;
use tonic::transport::server::TcpIncoming;
use tonic::{Request, Status};
use uuid::Uuid;

/// The key that is there.
pub const KEY: &str = "keys/0190a5d0-0000-7000-8000-00000000000a";

/// What a watch stream does next.
#[derive(Clone)]
pub enum Step {
    /// Sends the job like this.
    Send(Box<Job>),
    /// Fails.
    Fail(Status),
    /// Says nothing more, but stays.
    Hang,
}

/// What the server has, was asked, and will answer.
#[derive(Default)]
pub struct State {
    /// Artifacts with their bytes.
    pub artifacts: BTreeMap<String, (Artifact, Vec<u8>)>,
    /// Lengths of the chunks of the last upload.
    pub chunks: Vec<usize>,
    /// Uploads that were begun.
    pub uploads: usize,
    /// Uploads that were begun and go to the store, and the artifacts of those that were finished.
    pub begun: BTreeMap<String, (UploadMetadata, Option<String>)>,
    /// How often one was to be finished.
    pub finishes: usize,
    /// What the store was sent.
    pub put: Vec<u8>,
    /// Names that were to be deleted.
    pub deleted: Vec<String>,
    /// Offsets that downloads began at.
    pub offsets: Vec<i64>,
    /// Jobs by name.
    pub jobs: BTreeMap<String, Job>,
    /// Jobs by request id.
    pub requests: BTreeMap<String, String>,
    /// All that was to be created.
    pub created: Vec<CreateJobRequest>,
    /// All that was to be watched.
    pub watched: Vec<WatchJobRequest>,
    /// Jobs that were to be cancelled.
    pub cancelled: Vec<String>,
    /// Keys, newest first.
    pub keys: Vec<Key>,
    /// Owners, newest first.
    pub owners: Vec<Owner>,
    /// All that was to be registered.
    pub registered: Vec<Asset>,
    /// Tokens that were made.
    pub tokens: Vec<Token>,
    /// Hooks that were made.
    pub hooks: Vec<Hook>,
    /// What they were sent.
    pub deliveries: Vec<Delivery>,
    /// What calls showed as authorisation, in their order.
    pub shown: Vec<Option<String>>,
    /// What calls said that they are a part of.
    pub traced: Vec<Option<String>>,
    /// The public key, in hexadecimal.
    pub public_key: String,
    /// What an opened commitment is answered with.
    pub opened: Option<String>,

    /// What the next watch streams do.
    pub watch: VecDeque<Vec<Step>>,
    /// What the next uploads fail with.
    pub upload_errors: VecDeque<Status>,
    /// What the next finishes of uploads fail with, after they were carried out.
    pub finish_errors: VecDeque<Status>,
    /// What the next creations fail with; they are kept all the same when it is a lost answer.
    pub create_errors: VecDeque<Status>,
    /// After how many bytes the next downloads end.
    pub download_ends: VecDeque<usize>,
    /// Where artifacts can be fetched from besides: what addresses begin with.
    pub addresses: Option<String>,
    /// Where they can be sent to besides.
    pub addresses_to_write: Option<String>,
    /// Whether downloads are damaged on their way.
    pub damage: bool,
}

impl State {
    /// What the artifacts of a job hold, by which a request is known when it is sent again.
    pub fn content(&self, job: &Job) -> Vec<String> {
        let names = match &job.spec {
            Some(Spec::Embed(spec)) => vec![&spec.scene],
            Some(Spec::Verify(spec)) => spec.suspects.iter().collect(),
            _ => Vec::new(),
        };
        let hash = |name: &String| self.artifacts.get(name).map(|(artifact, _)| artifact.sha256.clone());
        names.into_iter().filter_map(hash).collect()
    }
}

/// The server, running on a thread of its own.
#[derive(Clone)]
pub struct Fake {
    /// Where it listens.
    pub address: SocketAddr,
    state: Arc<Mutex<State>>,
}

impl Fake {
    /// Starts one that has a key of 32 bits.
    pub fn start() -> Self {
        let (sender, receiver) = std::sync::mpsc::channel();
        let state = Arc::new(Mutex::new(State::default()));
        let shared = Arc::clone(&state);
        std::thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_current_thread()
                .enable_all()
                .build()
                .unwrap();
            runtime.block_on(async {
                let incoming = TcpIncoming::bind("127.0.0.1:0".parse().unwrap()).unwrap();
                let address = incoming.local_addr().unwrap();
                let fake = Fake { address, state: shared };
                sender.send(address).unwrap();
                let noting = fake.clone();
                let note = move |request: Request<()>| {
                    let said = |name| {
                        let said = request.metadata().get(name);
                        said.map(|said| said.to_str().unwrap().to_owned())
                    };
                    let mut state = noting.state();
                    state.shown.push(said("authorization"));
                    state.traced.push(said("traceparent"));
                    drop(state);
                    Ok(request)
                };
                Server::builder()
                    .layer(InterceptorLayer::new(note))
                    .add_service(ArtifactServiceServer::new(fake.clone()))
                    .add_service(JobServiceServer::new(fake.clone()))
                    .add_service(HookServiceServer::new(fake.clone()))
                    .add_service(KeyServiceServer::new(fake.clone()))
                    .add_service(RegistryServiceServer::new(fake.clone()))
                    .add_service(TokenServiceServer::new(fake))
                    .serve_with_incoming(incoming)
                    .await
                    .unwrap();
            });
        });
        let fake = Self {
            address: receiver.recv().unwrap(),
            state,
        };
        fake.state().keys.push(key(KEY, "website", 32));
        fake
    }

    /// What it has and was asked.
    pub fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap()
    }

    /// Its address as clients name it.
    pub fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Keeps bytes, and gives their name.
    pub fn store(&self, display_name: &str, bytes: &[u8]) -> String {
        let name = format!("artifacts/{}", Uuid::new_v4());
        let artifact = Artifact {
            name: name.clone(),
            display_name: display_name.into(),
            size_bytes: bytes.len() as i64,
            sha256: hex::encode(Sha256::digest(bytes)),
            ..Artifact::default()
        };
        self.state().artifacts.insert(name.clone(), (artifact, bytes.to_vec()));
        name
    }

    /// Plans the next watch stream.
    pub fn plan(&self, steps: impl IntoIterator<Item = Step>) {
        self.state().watch.push_back(steps.into_iter().collect());
    }
}

/// A key.
pub fn key(name: &str, display_name: &str, bits: u32) -> Key {
    Key {
        name: name.into(),
        display_name: display_name.into(),
        bits,
        clip: "guardsplat".into(),
        clip_sha256: "ab".repeat(32),
        ..Key::default()
    }
}

/// A job in a state.
pub fn job(state: JobState) -> Job {
    let mut job = Job {
        attempt: 1,
        max_attempts: 3,
        ..Job::default()
    };
    job.set_state(state);
    job
}

/// That a job in this state is sent.
pub fn send(job: Job) -> Step {
    Step::Send(Box::new(job))
}

/// That a job succeeded with this.
pub fn success(result: Outcome) -> Step {
    send(Job {
        result: Some(result),
        ..job(JobState::Succeeded)
    })
}

/// That a job failed for this reason.
pub fn failure(reason: guardsplat_proto::v1::failure::Reason, message: &str) -> Step {
    send(Job {
        failure: Some(Failure {
            reason: reason.into(),
            message: message.into(),
        }),
        ..job(JobState::Failed)
    })
}

/// Figures of a mark.
pub fn figures(scene: &str, comparison: &str) -> EmbedResult {
    EmbedResult {
        scene: scene.into(),
        comparison: comparison.into(),
        bit_accuracy: 0.975,
        bit_accuracy_worst_view: 0.9375,
        message: "c0ffee42".into(),
        message_recovered: true,
        psnr_db: Some(36.5),
        ssim: 0.97,
        steps: 600,
        view_steps: 4800,
        duration: Some(prost_types::Duration {
            seconds: 12,
            nanos: 500_000_000,
        }),
        device: "cpu".into(),
        clip: "guardsplat".into(),
        gaussians: 1000,
        changed_gaussians: 900,
        ignored_rows: 2,
        ..EmbedResult::default()
    }
}
