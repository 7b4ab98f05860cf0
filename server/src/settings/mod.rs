//! Settings, in layers: defaults, a file, the environment, flags. Each overrides the one before.
mod database;
mod error;
mod flags;
mod layers;
mod limits;

use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::time::Duration;

use secrecy::SecretString;
use serde::{Deserialize, Serialize};

use crate::secrets::KeySource;

pub use database::{DATABASE_VARIABLE, DatabaseUrl};
pub use error::SettingsError;
pub use flags::{Arguments, Command, Flags};
pub use layers::{load, parse};

/// Everything that can be set. `deploy/guardsplat-server.toml` says what each is for.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Where the server listens.
    pub listen: SocketAddr,
    /// Where metrics and readiness are told, over plain HTTP; nowhere where none is named.
    pub metrics_listen: Option<SocketAddr>,
    /// Where the page is for browsers; nowhere where none is named.
    pub page_listen: Option<SocketAddr>,
    /// Who may call.
    pub access: Access,
    /// Whether other machines may reach a server that asks nobody for a token.
    pub allow_open_network: bool,
    /// Whether everybody who verifies may do so without a claim on an asset, and be told every bit that is read.
    pub allow_raw_verification: bool,
    /// File of the server's certificate; with it the server speaks TLS only.
    pub tls_certificate: Option<PathBuf>,
    /// File of the certificate's key.
    pub tls_key: Option<PathBuf>,
    /// File of the certificates that clients' must be signed by; with it nobody is let in without one.
    pub tls_client_ca: Option<PathBuf>,
    /// Folder of everything that is kept.
    pub data_dir: PathBuf,
    /// The database of the ledger, for several servers; a file in the folder where none is named.
    pub database: Option<DatabaseUrl>,
    /// URL of the store of artifacts; a folder in the data folder where none is named.
    pub artifacts: Option<String>,
    /// Seconds that an address is good for at which the store itself gives out an artifact, or takes one; 0 for no such
    /// addresses.
    pub signed_url_seconds: u64,
    /// Most bytes of an artifact.
    pub max_artifact_bytes: u64,
    /// Most jobs that may wait.
    pub max_queued_jobs: u64,
    /// Most jobs of one project that may wait; 0 for no limit but that of all.
    pub max_queued_jobs_per_project: u64,
    /// Most bytes of artifacts that one project may have; 0 for no limit.
    pub max_artifact_bytes_per_project: u64,
    /// Most jobs, uploads and registrations of one caller in a minute; 0 for no limit.
    pub max_submissions_per_minute: u32,
    /// Most jobs of one caller that verify in a minute; 0 for no limit.
    pub max_claims_per_minute: u32,
    /// Most other calls of one caller in a minute; 0 for no limit.
    pub max_calls_per_minute: u32,
    /// The highest priority that a job may be submitted with.
    pub max_priority: i32,
    /// Most mebibytes of memory that a job may take; 0 for no limit but the workers' machines.
    pub max_job_memory_mebibytes: u64,
    /// Most billions of pixels of views that a job may draw; 0 for no limit.
    pub max_job_gigapixels: u64,
    /// Seconds until a worker that says nothing is given up.
    pub lease_seconds: u64,
    /// Seconds until an attempt without progress is ended, though its worker lives.
    pub progress_stall_seconds: u64,
    /// How often a job is tried.
    pub max_attempts: u32,
    /// Seconds that an upload may pause.
    pub upload_timeout_seconds: u64,
    /// Seconds that a watch may go unread.
    pub watch_stall_seconds: u64,
    /// Most watches of one caller at once; 0 for no limit.
    pub max_watches_per_caller: u32,
    /// Seconds that a download may go unread.
    pub download_stall_seconds: u64,
    /// Most uploads and downloads of one caller at once; 0 for no limit.
    pub max_transfers_per_caller: u32,
    /// Mebibytes of memory that bytes on their way may take, of all uploads and downloads together.
    pub transfer_memory_mebibytes: u64,
    /// Most connections at once, and fewer where the process may not open twice as many files.
    pub max_connections: u32,
    /// Most connections of one address at once, and at most half of all.
    pub max_connections_per_address: u32,
    /// Seconds that a connection may be open without a call; 0 for ever.
    pub connection_idle_seconds: u64,
    /// Seconds after which bytes that nobody published are removed.
    pub abandoned_after_seconds: u64,
    /// Whether hooks may be called without TLS.
    pub hook_allow_http: bool,
    /// Whether hooks may be called at addresses that are not public.
    pub hook_allow_private: bool,
    /// File of the certificates that hooks' are checked with; those of public authorities where none is named.
    pub hook_ca: Option<PathBuf>,
    /// Seconds after which a message that a hook did not acknowledge is given up.
    pub hook_give_up_seconds: u64,
    /// Days that an upload is kept after it was last used; 0 for ever.
    pub keep_uploads_days: u64,
    /// Days that what a job made is kept after its end; 0 for as long as the job.
    pub keep_outputs_days: u64,
    /// Days that a job is kept after its end; 0 for ever.
    pub keep_jobs_days: u64,
    /// Whether the server runs a worker of its own.
    pub embedded_worker: bool,
    /// Program of that worker.
    pub worker_binary: Option<PathBuf>,
    /// What that worker computes on.
    pub worker_device: WorkerDevice,
    /// File of the master key.
    pub master_key_file: Option<PathBuf>,
    /// How often a scene without the mark may be said to match by chance.
    pub false_positive_rate: f64,
    /// Seconds that work may take to end when the server stops.
    pub stop_seconds: u64,
    /// How log lines are written.
    pub log_format: LogFormat,
    /// What is logged.
    pub log_filter: String,
    /// The master key, from the environment only: neither a file of settings nor a flag is a place for a secret.
    #[serde(skip)]
    pub master_key: Option<SecretString>,
}

/// Who may call.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Access {
    /// Anybody who can reach the server.
    Open,
    /// Whoever shows a token.
    Tokens,
}

/// What the embedded worker computes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum WorkerDevice {
    /// The GPU when there is one, else the CPU.
    Auto,
    /// wgpu, through Vulkan.
    Wgpu,
    /// The CPU.
    Cpu,
}

impl WorkerDevice {
    /// As the worker's `--device` takes it.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Wgpu => "wgpu",
            Self::Cpu => "cpu",
        }
    }
}

/// How log lines are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum LogFormat {
    /// For people.
    Text,
    /// One JSON object a line.
    Json,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            listen: SocketAddr::from((Ipv4Addr::LOCALHOST, 50051)),
            metrics_listen: None,
            page_listen: None,
            access: Access::Open,
            allow_open_network: false,
            allow_raw_verification: false,
            tls_certificate: None,
            tls_key: None,
            tls_client_ca: None,
            data_dir: "guardsplat-data".into(),
            database: None,
            artifacts: None,
            signed_url_seconds: 0,
            max_artifact_bytes: 4 << 30,
            max_queued_jobs: 10_000,
            max_queued_jobs_per_project: 0,
            max_artifact_bytes_per_project: 0,
            max_submissions_per_minute: 6_000,
            max_claims_per_minute: 6_000,
            max_calls_per_minute: 60_000,
            max_priority: 10,
            max_job_memory_mebibytes: 0,
            max_job_gigapixels: 16,
            lease_seconds: 30,
            progress_stall_seconds: 30 * 60,
            max_attempts: 3,
            upload_timeout_seconds: 60,
            watch_stall_seconds: 60,
            max_watches_per_caller: 1_000,
            download_stall_seconds: 60,
            max_transfers_per_caller: 64,
            transfer_memory_mebibytes: 128,
            max_connections: 4_096,
            max_connections_per_address: 1_024,
            connection_idle_seconds: 300,
            abandoned_after_seconds: 24 * 60 * 60,
            hook_allow_http: false,
            hook_allow_private: false,
            hook_ca: None,
            hook_give_up_seconds: 3 * 24 * 60 * 60,
            keep_uploads_days: 0,
            keep_outputs_days: 0,
            keep_jobs_days: 0,
            embedded_worker: true,
            worker_binary: None,
            worker_device: WorkerDevice::Auto,
            master_key_file: None,
            false_positive_rate: guardsplat_codeword::DEFAULT_FALSE_POSITIVE_RATE,
            stop_seconds: 20,
            log_format: LogFormat::Text,
            log_filter: "info".into(),
            master_key: None,
        }
    }
}

impl Settings {
    /// What says which master key is used.
    pub fn key_source(&self) -> KeySource<'_> {
        match (&self.master_key, &self.master_key_file) {
            (Some(digits), _) => KeySource::Environment(digits),
            (None, Some(file)) => KeySource::File(file),
            (None, None) => KeySource::DataFolder,
        }
    }

    /// Bytes of memory that a job may take, where that is limited.
    pub fn max_job_memory(&self) -> Option<u64> {
        Some(self.max_job_memory_mebibytes << 20).filter(|bytes| *bytes > 0)
    }

    /// When a worker that says nothing is given up.
    pub fn lease(&self) -> Duration {
        Duration::from_secs(self.lease_seconds)
    }

    /// How long an upload may pause.
    pub fn upload_timeout(&self) -> Duration {
        Duration::from_secs(self.upload_timeout_seconds)
    }

    /// How long a watch may go unread.
    pub fn watch_stall(&self) -> Duration {
        Duration::from_secs(self.watch_stall_seconds)
    }

    /// How long a download may go unread.
    pub fn download_stall(&self) -> Duration {
        Duration::from_secs(self.download_stall_seconds)
    }

    /// Bytes of memory for bytes on their way.
    pub fn transfer_memory(&self) -> u64 {
        self.transfer_memory_mebibytes << 20
    }

    /// How long a connection may be open without a call, where that is limited.
    pub fn connection_idle(&self) -> Option<Duration> {
        Some(Duration::from_secs(self.connection_idle_seconds)).filter(|time| !time.is_zero())
    }

    /// When bytes that nobody published are removed.
    pub fn abandoned_after(&self) -> Duration {
        Duration::from_secs(self.abandoned_after_seconds)
    }

    /// How long work may take to end when the server stops.
    pub fn stop_limit(&self) -> Duration {
        Duration::from_secs(self.stop_seconds)
    }
}

#[cfg(test)]
mod tests;
