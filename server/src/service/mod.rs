//! What the service decides, without a transport: jobs, keys, claims, registry and retention over the ledger, the
//! artifact store and the secrets.
use std::sync::Arc;
use std::time::Duration;

use crate::artifacts::ArtifactStore;
use crate::hooks::Rules;
use crate::ledger::Ledger;
use crate::ledger::queue::PRIORITIES;
use crate::metrics::Metrics;
use crate::notary::Notary;
use crate::secrets::MasterKey;
use crate::traces::Traces;

pub(crate) mod admission;
pub(crate) mod attempts;
pub(crate) mod changes;
pub(crate) mod claims;
pub mod clock;
pub(crate) mod completion;
pub(crate) mod concurrency_limit;
pub(crate) mod credentials;
pub(crate) mod direct_upload;
pub(crate) mod evidence;
pub(crate) mod fingerprint;
pub(crate) mod jobs;
pub(crate) mod keys;
pub(crate) mod lease;
pub(crate) mod ledger_errors;
pub(crate) mod message;
pub(crate) mod names;
pub(crate) mod opaque_token;
pub(crate) mod operations;
pub(crate) mod other_files;
pub(crate) mod ownership;
pub(crate) mod page;
pub mod placement;
pub(crate) mod predicted_cost;
pub(crate) mod progress;
pub(crate) mod queue_positions;
pub(crate) mod quota;
pub mod rate_limit;
pub(crate) mod registry;
pub(crate) mod resolution;
pub mod retention;
pub(crate) mod scene_summaries;
pub(crate) mod seeds;
pub(crate) mod stages;
pub(crate) mod store_generation;
pub(crate) mod submission;
pub mod text;
pub(crate) mod to_proto;
pub(crate) mod upload;
pub(crate) mod upload_parts;
pub(crate) mod violations;
pub mod worker_presence;
pub(crate) mod workers;

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
    /// Billions of pixels of views that a job may draw; 0 for no limit.
    pub max_job_gigapixels: u64,
    /// An attempt that makes no progress for so long is ended, though its worker lives.
    pub progress_stall: Duration,
    /// An upload of which nothing arrives for so long is broken off.
    pub upload_idle: Duration,
    /// A watch whose reader takes nothing for so long is let go.
    pub watch_stall: Duration,
    /// Watches that a caller may have open; 0 for no limit.
    pub max_watches: u32,
    /// A download whose reader takes nothing for so long is let go.
    pub download_stall: Duration,
    /// Uploads and downloads that a caller may have at once; 0 for no limit.
    pub max_transfers: u32,
    /// How often a scene without the mark may be said to match by chance, above 0 and below 1.
    pub false_positive_rate: f64,
    /// Whether everybody who verifies may do so without a claim on an asset, and be told every bit; else admins may.
    pub raw_verification: bool,
    /// Jobs of one project that may wait; none for no limit but that of all.
    pub max_queued_of_project: Option<u64>,
    /// Whether a project may have no more jobs waiting than there is room left for others.
    pub fair_shares: bool,
    /// Bytes of artifacts that one project may have; none for no limit.
    pub max_bytes_of_project: Option<u64>,
    /// How often a caller may call.
    pub rates: rate_limit::Rates,
    /// What an upload or an attempt left behind is deleted after so long; so no upload may take longer.
    pub abandoned_after: Duration,
    /// What hooks may be, and how long they are told.
    pub hooks: Rules,
    /// How long an address is good for at which the store gives out an artifact, or takes one; none for no such
    /// addresses.
    pub signed_url: Option<Duration>,
    /// How long things are kept.
    pub retention: retention::RetentionPolicy,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            lease: Duration::from_secs(30),
            max_attempts: 3,
            max_queued: 10_000,
            max_priority: *PRIORITIES.end(),
            max_job_memory: None,
            max_job_gigapixels: 16,
            progress_stall: Duration::from_secs(30 * 60),
            upload_idle: Duration::from_secs(60),
            watch_stall: Duration::from_secs(60),
            max_watches: 1_000,
            download_stall: Duration::from_secs(60),
            max_transfers: 64,
            false_positive_rate: guardsplat_codeword::DEFAULT_FALSE_POSITIVE_RATE,
            raw_verification: false,
            max_queued_of_project: None,
            fair_shares: false,
            max_bytes_of_project: None,
            rates: rate_limit::Rates::default(),
            abandoned_after: Duration::from_secs(24 * 60 * 60),
            hooks: Rules::default(),
            signed_url: None,
            retention: retention::RetentionPolicy::default(),
        }
    }
}

/// What the seven services share. Cheap to clone.
#[derive(Clone)]
pub struct Service {
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
    meter: Arc<rate_limit::Meter>,
    metrics: Arc<Metrics>,
    alive: Arc<worker_presence::WorkerPresence>,
    stages: stages::Stages,
    traces: Traces,
    changes: changes::Changes,
    reports: progress::ProgressThrottle,
    placement: placement::Placement,
    positions: queue_positions::QueuePositions,
    summaries: scene_summaries::SceneSummaries,
    watches: Arc<concurrency_limit::ConcurrencyLimit>,
    transfers: Arc<concurrency_limit::ConcurrencyLimit>,
    arriving: upload_parts::ArrivingUploads,
}

impl Service {
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
            meter: Arc::new(rate_limit::Meter::new(limits.rates)),
            limits,
            metrics: Arc::default(),
            alive: Arc::default(),
            stages: stages::Stages::default(),
            traces: Traces::default(),
            changes: changes::Changes::default(),
            reports: progress::ProgressThrottle::default(),
            placement: placement::Placement::default(),
            positions: queue_positions::QueuePositions::default(),
            summaries: scene_summaries::SceneSummaries::default(),
            watches: Arc::default(),
            transfers: Arc::default(),
            arriving: upload_parts::ArrivingUploads::default(),
        };
        Self {
            shared: Arc::new(shared),
        }
    }

    /// Begins the end: no more jobs are leased, and calls that wait (`LeaseJob`, `WatchJob`) end with `UNAVAILABLE`.
    /// Workers can still hand back and complete what they have.
    pub fn stop(&self) {
        self.shared.changes.stop();
    }

    /// What counts calls, for the guard.
    pub fn meter(&self) -> Arc<rate_limit::Meter> {
        self.shared.meter.clone()
    }

    /// What is measured.
    pub fn metrics(&self) -> Arc<Metrics> {
        self.shared.metrics.clone()
    }

    /// Whether any worker is there.
    pub fn workers(&self) -> Arc<worker_presence::WorkerPresence> {
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

    pub(crate) fn stages(&self) -> &stages::Stages {
        &self.shared.stages
    }

    pub(crate) fn ledger(&self) -> &dyn Ledger {
        self.shared.ledger.as_ref()
    }

    pub(crate) fn store(&self) -> &ArtifactStore {
        &self.shared.store
    }

    pub(crate) fn master(&self) -> &MasterKey {
        &self.shared.master
    }

    pub(crate) fn notary(&self) -> &Notary {
        &self.shared.notary
    }

    pub(crate) fn opened(&self) -> i64 {
        self.shared.opened
    }

    pub(crate) fn limits(&self) -> &Limits {
        &self.shared.limits
    }

    pub(crate) fn changes(&self) -> &changes::Changes {
        &self.shared.changes
    }

    pub(crate) fn progress_throttle(&self) -> &progress::ProgressThrottle {
        &self.shared.reports
    }

    pub(crate) fn placement(&self) -> &placement::Placement {
        &self.shared.placement
    }

    pub(crate) fn watch_limit(&self) -> &Arc<concurrency_limit::ConcurrencyLimit> {
        &self.shared.watches
    }

    pub(crate) fn arriving(&self) -> &upload_parts::ArrivingUploads {
        &self.shared.arriving
    }

    pub(crate) fn transfer_limit(&self) -> &Arc<concurrency_limit::ConcurrencyLimit> {
        &self.shared.transfers
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    /// Names of the files below a folder that speak of a word.
    fn speak_of(folder: &Path, word: &str, found: &mut Vec<String>) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                speak_of(&path, word, found);
            } else if path.extension().is_some_and(|extension| extension == "rs")
                && std::fs::read_to_string(&path).unwrap().contains(word)
            {
                found.push(path.display().to_string());
            }
        }
    }

    #[test]
    fn what_is_decided_knows_no_transport() {
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        // In two pieces, since this file is read too.
        let (transport, handlers) = (["ton", "ic::"].concat(), ["crate::", "grpc"].concat());
        for folder in ["service", "tasks", "ledger"] {
            for word in [&transport, &handlers] {
                let mut found = Vec::new();
                speak_of(&source.join(folder), word, &mut found);
                assert_eq!(found, Vec::<String>::new(), "{word}");
            }
        }
        let mut found = Vec::new();
        speak_of(&source.join("grpc"), &transport, &mut found);
        assert!(!found.is_empty());
    }
}
