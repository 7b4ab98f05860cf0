//! A server for one test, and what a client and a worker do with it.
mod answers;
mod jobs;
mod messages;

pub use answers::*;
pub use messages::*;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use guardsplat_proto::v1::artifact_service_client::ArtifactServiceClient;
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::key_service_client::KeyServiceClient;
use guardsplat_proto::v1::registry_service_client::RegistryServiceClient;
use guardsplat_proto::v1::worker_service_client::WorkerServiceClient;
use secrecy::ExposeSecret;
use tempfile::TempDir;
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tonic::transport::Channel;

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
