//! The API over gRPC: the seven services of `guardsplat.v1` over the ledger, the artifact store and the secrets.
use std::sync::Arc;
use std::time::Duration;

use guardsplat_proto::v1::artifact_service_server::ArtifactServiceServer;
use guardsplat_proto::v1::hook_service_server::HookServiceServer;
use guardsplat_proto::v1::job_service_server::JobServiceServer;
use guardsplat_proto::v1::key_service_server::KeyServiceServer;
use guardsplat_proto::v1::registry_service_server::RegistryServiceServer;
use guardsplat_proto::v1::token_service_server::TokenServiceServer;
use guardsplat_proto::v1::worker_service_server::WorkerServiceServer;
use tonic::Status;
use tonic::service::Routes;

use crate::artifacts::ArtifactStore;
use crate::error::{Error, Result};
use crate::hooks::Rules;
use crate::ledger::Ledger;
use crate::ledger::queue::PRIORITIES;
use crate::metrics::Metrics;
use crate::notary::Notary;
use crate::secrets::MasterKey;
use crate::traces::Traces;

mod admission;
mod alive;
mod artifacts;
mod changes;
mod claims;
mod clock;
mod completion;
mod convert;
mod deadline;
mod deliveries;
mod direct;
mod evidence;
mod expiry;
mod explained;
mod fingerprint;
mod guard;
mod hooks;
mod housekeeping;
mod jobs;
mod keys;
mod lease;
mod listen;
mod measured;
mod message;
mod meter;
mod names;
mod operations;
mod orphans;
mod output;
mod own;
mod page;
mod patience;
mod placement;
mod places;
mod positions;
mod problems;
mod progress;
mod quota;
mod refusals;
mod registry;
mod relay;
mod stages;
mod status;
#[doc(hidden)]
pub mod strangers;
mod submission;
#[cfg(test)]
mod tests;
mod text;
mod token;
mod tokens;
mod upload;
mod watch;
mod worker;

pub use alive::Alive;
pub use clock::now;
pub use deliveries::deliveries;
pub use expiry::Keep;
pub use guard::Guard;
pub use housekeeping::housekeeping;
pub use listen::{Door, serve};
pub use measured::Measured;
pub use meter::{Meter, Rates};
pub use placement::seen_since;
pub use relay::relay;
pub use text::display_name as check_display_name;

/// Largest message that is read, as tonic has it by default: large things never travel in one message.
const MAX_MESSAGE: usize = 4 << 20;

/// What the API holds its callers to.
#[derive(Clone, Debug, PartialEq)]
pub struct Limits {
    /// A lease ends when nothing was reported for so long.
    pub lease: Duration,
    /// Attempts of a job before it is given up.
    pub max_attempts: i32,
    /// Jobs that may wait; more are refused.
    pub max_queued: u64,
    /// The highest priority that a caller may ask for.
    pub max_priority: i32,
    /// Bytes of memory that a job may take; one whose scene takes more is refused. `None` leaves that to the workers.
    pub max_job_memory: Option<u64>,
    /// An upload of which nothing arrives for so long is broken off.
    pub upload_idle: Duration,
    /// A watch whose reader takes nothing for so long is let go.
    pub watch_stall: Duration,
    /// Watches that a caller may have open; 0 for no limit.
    pub max_watches: u32,
    /// How often a claim may be said to match by chance, above 0 and below 1.
    pub false_positive_rate: f64,
    /// Jobs of one project that may wait; none for no limit but that of all.
    pub max_queued_of_project: Option<u64>,
    /// Bytes of artifacts that one project may have; none for no limit.
    pub max_bytes_of_project: Option<u64>,
    /// How often a caller may call.
    pub rates: Rates,
    /// What an upload or an attempt left behind is deleted after so long; so no upload may take longer.
    pub abandoned_after: Duration,
    /// What hooks may be, and how long they are told.
    pub hooks: Rules,
    /// How long an address is good for at which the store gives out an artifact, or takes one; none for no such
    /// addresses.
    pub signed_url: Option<Duration>,
    /// How long things are kept.
    pub keep: Keep,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            lease: Duration::from_secs(30),
            max_attempts: 3,
            max_queued: 10_000,
            max_priority: *PRIORITIES.end(),
            max_job_memory: None,
            upload_idle: Duration::from_secs(60),
            watch_stall: Duration::from_secs(60),
            max_watches: 1_000,
            false_positive_rate: guardsplat_codeword::DEFAULT_FALSE_POSITIVE_RATE,
            max_queued_of_project: None,
            max_bytes_of_project: None,
            rates: Rates::default(),
            abandoned_after: Duration::from_secs(24 * 60 * 60),
            hooks: Rules::default(),
            signed_url: None,
            keep: Keep::default(),
        }
    }
}

/// What the seven services share. Cheap to clone.
#[derive(Clone)]
pub struct Api {
    shared: Arc<Shared>,
}

struct Shared {
    /// When this server began, before it took any call.
    opened: i64,
    ledger: Arc<dyn Ledger>,
    store: ArtifactStore,
    master: MasterKey,
    notary: Notary,
    limits: Limits,
    meter: Arc<Meter>,
    metrics: Arc<Metrics>,
    alive: Arc<Alive>,
    stages: stages::Stages,
    traces: Traces,
    changes: changes::Changes,
    reports: progress::Reports,
    placement: placement::Placement,
    positions: positions::Positions,
    places: Arc<places::Places>,
}

impl Api {
    /// The API over a ledger, a store, the key that secrets are sealed with, and the one that commitments are signed
    /// with.
    pub fn new(
        ledger: Arc<dyn Ledger>,
        store: ArtifactStore,
        master: MasterKey,
        notary: Notary,
        limits: Limits,
    ) -> Self {
        let shared = Shared {
            opened: clock::now(),
            ledger,
            store,
            master,
            notary,
            meter: Arc::new(Meter::new(limits.rates)),
            limits,
            metrics: Arc::default(),
            alive: Arc::default(),
            stages: stages::Stages::default(),
            traces: Traces::default(),
            changes: changes::Changes::default(),
            reports: progress::Reports::default(),
            placement: placement::Placement::default(),
            positions: positions::Positions::default(),
            places: Arc::default(),
        };
        Self {
            shared: Arc::new(shared),
        }
    }

    /// The seven services and reflection. Health, which knows more than the API, is added by the caller.
    pub fn routes(&self) -> Result<Routes> {
        let reflection = || {
            tonic_reflection::server::Builder::configure()
                .register_encoded_file_descriptor_set(guardsplat_proto::FILE_DESCRIPTORS)
                .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
                .register_encoded_file_descriptor_set(tonic_types::pb::FILE_DESCRIPTOR_SET)
        };
        let failed = |error| Error::internal("setting up reflection", error);
        Ok(
            Routes::new(JobServiceServer::new(self.clone()).max_decoding_message_size(MAX_MESSAGE))
                .add_service(ArtifactServiceServer::new(self.clone()).max_decoding_message_size(MAX_MESSAGE))
                .add_service(KeyServiceServer::new(self.clone()).max_decoding_message_size(MAX_MESSAGE))
                .add_service(RegistryServiceServer::new(self.clone()).max_decoding_message_size(MAX_MESSAGE))
                .add_service(TokenServiceServer::new(self.clone()).max_decoding_message_size(MAX_MESSAGE))
                .add_service(HookServiceServer::new(self.clone()).max_decoding_message_size(MAX_MESSAGE))
                .add_service(WorkerServiceServer::new(self.clone()).max_decoding_message_size(MAX_MESSAGE))
                .add_service(reflection().build_v1().map_err(failed)?)
                .add_service(reflection().build_v1alpha().map_err(failed)?),
        )
    }

    /// Begins the end: no more jobs are leased, and calls that wait (`LeaseJob`, `WatchJob`) end with `UNAVAILABLE`.
    /// Workers can still hand back and complete what they have.
    pub fn stop(&self) {
        self.shared.changes.stop();
    }

    /// What counts calls, for the guard.
    pub fn meter(&self) -> Arc<Meter> {
        self.shared.meter.clone()
    }

    /// What is measured.
    pub fn metrics(&self) -> Arc<Metrics> {
        self.shared.metrics.clone()
    }

    /// Whether any worker is there.
    pub fn alive(&self) -> Arc<Alive> {
        self.shared.alive.clone()
    }

    /// The same, with traces of what it does. For an API that nobody shares yet.
    pub fn traced(mut self, traces: Traces) -> Self {
        if let Some(shared) = Arc::get_mut(&mut self.shared) {
            shared.traces = traces;
        }
        self
    }

    /// Where traces go.
    pub fn traces(&self) -> &Traces {
        &self.shared.traces
    }

    /// What counts and traces calls, for the listener.
    pub fn measured(&self) -> Measured {
        Measured {
            metrics: self.metrics(),
            traces: self.shared.traces.clone(),
        }
    }

    fn stages(&self) -> &stages::Stages {
        &self.shared.stages
    }

    fn ledger(&self) -> &dyn Ledger {
        self.shared.ledger.as_ref()
    }

    fn store(&self) -> &ArtifactStore {
        &self.shared.store
    }

    fn master(&self) -> &MasterKey {
        &self.shared.master
    }

    fn notary(&self) -> &Notary {
        &self.shared.notary
    }

    fn opened(&self) -> i64 {
        self.shared.opened
    }

    fn limits(&self) -> &Limits {
        &self.shared.limits
    }

    fn changes(&self) -> &changes::Changes {
        &self.shared.changes
    }

    fn reports(&self) -> &progress::Reports {
        &self.shared.reports
    }

    fn placement(&self) -> &placement::Placement {
        &self.shared.placement
    }

    fn places(&self) -> &Arc<places::Places> {
        &self.shared.places
    }

    /// Breaks off an upload that takes so long that its bytes would count as abandoned.
    async fn within_upload_time<T>(&self, upload: impl Future<Output = Result<T, Status>>) -> Result<T, Status> {
        let longest = self.limits().abandoned_after;
        let done = tokio::time::timeout(longest, upload).await;
        done.map_err(|_| Error::UploadTooSlow(longest))?
    }
}
