//! The command line. A flag stands above every other layer, and is empty unless it was given.
use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

use super::{Access, DatabaseUrl, LogFormat, Settings, WorkerDevice};
use crate::offline;

/// The GuardSplat server: takes jobs over gRPC, keeps them, and gives them to workers.
///
/// Settings come from, in this order: defaults, a file, environment variables (GUARDSPLAT_ and the setting's name in
/// capitals), flags. The master key is taken from GUARDSPLAT_MASTER_KEY (64 hexadecimal digits), the file that
/// --master-key-file names, or master.key in the data folder, which is made at the first start.
#[derive(Clone, Debug, Parser)]
#[command(name = "guardsplat-server", version, args_override_self = true)]
pub struct Arguments {
    /// Settings.
    #[command(flatten)]
    pub flags: Flags,
    /// What to do instead of serving.
    #[command(subcommand)]
    pub command: Option<Command>,
}

/// What there is to do besides serving.
#[derive(Clone, Debug, Subcommand)]
pub enum Command {
    // Doc comments would not be allowed here: each command has its own.
    #[command(flatten)]
    #[allow(missing_docs)]
    Offline(offline::Command),
    #[command(flatten)]
    #[allow(missing_docs)]
    Packaging(guardsplat_packaging::Command),
}

// No comment for people here: clap would put it in place of the program's.
#[allow(missing_docs)]
#[derive(Clone, Debug, Default, Args)]
pub struct Flags {
    /// Settings file [default: /etc/guardsplat/server.toml, if it is there]
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Address and port to listen on; port 0 takes any that is free [default: 127.0.0.1:50051]
    #[arg(long, value_name = "ADDRESS:PORT")]
    pub listen: Option<SocketAddr>,
    /// Address and port of /metrics, /livez and /readyz, over plain HTTP [default: none]
    #[arg(long, value_name = "ADDRESS:PORT")]
    pub metrics_listen: Option<SocketAddr>,
    /// Address and port of the page for browsers, which needs --access tokens [default: none]
    #[arg(long, value_name = "ADDRESS:PORT")]
    pub page_listen: Option<SocketAddr>,
    /// Who may call: anybody, or whoever shows a token [default: open]
    #[arg(long, value_name = "WHO")]
    pub access: Option<Access>,
    /// Whether other machines may reach a server that is open to anybody [default: false]
    #[arg(long, value_name = "true|false")]
    pub allow_open_network: Option<bool>,
    /// Whether all who verify may do so without a claim on an asset, and be told every bit [default: false]
    #[arg(long, value_name = "true|false")]
    pub allow_raw_verification: Option<bool>,
    /// File of the server's certificate (PEM), with which it speaks TLS only [default: none, without TLS]
    #[arg(long, value_name = "FILE")]
    pub tls_certificate: Option<PathBuf>,
    /// File of the certificate's key (PEM) [default: none]
    #[arg(long, value_name = "FILE")]
    pub tls_key: Option<PathBuf>,
    /// File of the certificates (PEM) that clients' must be signed by [default: none, clients need none]
    #[arg(long, value_name = "FILE")]
    pub tls_client_ca: Option<PathBuf>,
    /// Folder of everything that is kept [default: guardsplat-data]
    #[arg(long, value_name = "FOLDER")]
    pub data_dir: Option<PathBuf>,
    /// PostgreSQL database of the ledger, as postgres://USER@HOST/DATABASE. All users of this machine see what is said
    /// here: give a password in the variable, the file, or libpq's PGPASSFILE [default: ledger.sqlite in the folder]
    #[arg(long, value_name = "URL")]
    pub database: Option<DatabaseUrl>,
    /// Where artifacts are: s3://BUCKET/PREFIX, gs://BUCKET/PREFIX, az://CONTAINER/PREFIX or file:///FOLDER; credentials
    /// are taken from the environment [default: artifacts in the data folder]
    #[arg(long, value_name = "URL")]
    pub artifacts: Option<String>,
    /// Seconds that an address is good for at which clients fetch an artifact from the store itself, or send it there;
    /// 0 for none [default: 0]
    #[arg(long, value_name = "SECONDS")]
    pub signed_url_seconds: Option<u64>,
    /// Most bytes of an artifact [default: 4294967296]
    #[arg(long, value_name = "BYTES")]
    pub max_artifact_bytes: Option<u64>,
    /// Most jobs that may wait [default: 10000]
    #[arg(long, value_name = "JOBS")]
    pub max_queued_jobs: Option<u64>,
    /// Most jobs of one project that may wait; 0 is no limit but that of all [default: 0]
    #[arg(long, value_name = "JOBS")]
    pub max_queued_jobs_per_project: Option<u64>,
    /// Most bytes of artifacts that one project may have; 0 is no limit [default: 0]
    #[arg(long, value_name = "BYTES")]
    pub max_artifact_bytes_per_project: Option<u64>,
    /// Most jobs, uploads and registrations of one caller in a minute; 0 is no limit [default: 6000]
    #[arg(long, value_name = "CALLS")]
    pub max_submissions_per_minute: Option<u32>,
    /// Most jobs of one caller that verify in a minute; 0 is no limit [default: 6000]
    #[arg(long, value_name = "JOBS")]
    pub max_claims_per_minute: Option<u32>,
    /// Most other calls of one caller in a minute; 0 is no limit [default: 60000]
    #[arg(long, value_name = "CALLS")]
    pub max_calls_per_minute: Option<u32>,
    /// The highest priority that a job may be submitted with, -10 to 10 [default: 10]
    #[arg(long, value_name = "PRIORITY", allow_negative_numbers = true)]
    pub max_priority: Option<i32>,
    /// Most mebibytes of memory that a job may take; 0 is no limit but the workers' machines [default: 0]
    #[arg(long, value_name = "MEBIBYTES")]
    pub max_job_memory_mebibytes: Option<u64>,
    /// Most billions of pixels of views that a job may draw; 0 is no limit [default: 16]
    #[arg(long, value_name = "GIGAPIXELS")]
    pub max_job_gigapixels: Option<u64>,
    /// Seconds until a worker that says nothing is given up [default: 30]
    #[arg(long, value_name = "SECONDS")]
    pub lease_seconds: Option<u64>,
    /// Seconds until an attempt without progress is ended, though its worker lives [default: 1800]
    #[arg(long, value_name = "SECONDS")]
    pub progress_stall_seconds: Option<u64>,
    /// How often a job is tried [default: 3]
    #[arg(long, value_name = "TIMES")]
    pub max_attempts: Option<u32>,
    /// Seconds that an upload may pause [default: 60]
    #[arg(long, value_name = "SECONDS")]
    pub upload_timeout_seconds: Option<u64>,
    /// Seconds that a watch may go unread before it is let go [default: 60]
    #[arg(long, value_name = "SECONDS")]
    pub watch_stall_seconds: Option<u64>,
    /// Most watches of one caller at once; 0 is no limit [default: 1000]
    #[arg(long, value_name = "WATCHES")]
    pub max_watches_per_caller: Option<u32>,
    /// Seconds that a download may go unread before it is let go [default: 60]
    #[arg(long, value_name = "SECONDS")]
    pub download_stall_seconds: Option<u64>,
    /// Most uploads and downloads of one caller at once; 0 is no limit [default: 64]
    #[arg(long, value_name = "TRANSFERS")]
    pub max_transfers_per_caller: Option<u32>,
    /// Mebibytes of memory that bytes on their way may take, of all uploads and downloads [default: 128]
    #[arg(long, value_name = "MEBIBYTES")]
    pub transfer_memory_mebibytes: Option<u64>,
    /// Most connections at once; fewer where the process may not open twice as many files [default: 4096]
    #[arg(long, value_name = "CONNECTIONS")]
    pub max_connections: Option<u32>,
    /// Most connections of one address at once, and at most half of all [default: 1024]
    #[arg(long, value_name = "CONNECTIONS")]
    pub max_connections_per_address: Option<u32>,
    /// Seconds that a connection may be open without a call; 0 for ever [default: 300]
    #[arg(long, value_name = "SECONDS")]
    pub connection_idle_seconds: Option<u64>,
    /// Seconds after which bytes that nobody published are removed [default: 86400]
    #[arg(long, value_name = "SECONDS")]
    pub abandoned_after_seconds: Option<u64>,
    /// Whether hooks may be called without TLS [default: false]
    #[arg(long, value_name = "true|false")]
    pub hook_allow_http: Option<bool>,
    /// Whether hooks may be called at addresses that are not public [default: false]
    #[arg(long, value_name = "true|false")]
    pub hook_allow_private: Option<bool>,
    /// File of the certificates (PEM) that hooks' are checked with [default: none, those of public authorities]
    #[arg(long, value_name = "FILE")]
    pub hook_ca: Option<PathBuf>,
    /// Seconds after which a message that a hook did not acknowledge is given up [default: 259200]
    #[arg(long, value_name = "SECONDS")]
    pub hook_give_up_seconds: Option<u64>,
    /// Days that an upload is kept after it was last used; 0 for ever [default: 0]
    #[arg(long, value_name = "DAYS")]
    pub keep_uploads_days: Option<u64>,
    /// Days that what a job made is kept after its end; 0 for as long as the job [default: 0]
    #[arg(long, value_name = "DAYS")]
    pub keep_outputs_days: Option<u64>,
    /// Days that a job is kept after its end; 0 for ever [default: 0]
    #[arg(long, value_name = "DAYS")]
    pub keep_jobs_days: Option<u64>,
    /// Whether to run a worker of its own [default: true]
    #[arg(long, value_name = "true|false")]
    pub embedded_worker: Option<bool>,
    /// Program of that worker [default: guardsplat-worker beside this program]
    #[arg(long, value_name = "FILE")]
    pub worker_binary: Option<PathBuf>,
    /// What that worker computes on [default: auto]
    #[arg(long, value_name = "DEVICE")]
    pub worker_device: Option<WorkerDevice>,
    /// File of the master key, 64 hexadecimal digits [default: master.key in the data folder, made at the first start]
    #[arg(long, value_name = "FILE")]
    pub master_key_file: Option<PathBuf>,
    /// How often a scene without the mark may be said to match, 1e-30 to 0.1 [default: 1e-6]
    #[arg(long, value_name = "RATE")]
    pub false_positive_rate: Option<f64>,
    /// Seconds that work may take to end when the server stops [default: 20]
    #[arg(long, value_name = "SECONDS")]
    pub stop_seconds: Option<u64>,
    /// How log lines are written [default: text]
    #[arg(long, value_name = "FORMAT")]
    pub log_format: Option<LogFormat>,
    /// What is logged, in the syntax of RUST_LOG [default: info]
    #[arg(long, value_name = "FILTER")]
    pub log_filter: Option<String>,
}

impl Flags {
    /// Sets what was given.
    pub(super) fn apply(self, settings: &mut Settings) {
        // Taken apart in full, so that a new flag can't be forgotten here.
        let Self {
            config: _,
            listen,
            metrics_listen,
            page_listen,
            access,
            allow_open_network,
            allow_raw_verification,
            tls_certificate,
            tls_key,
            tls_client_ca,
            data_dir,
            database,
            artifacts,
            signed_url_seconds,
            max_artifact_bytes,
            max_queued_jobs,
            max_queued_jobs_per_project,
            max_artifact_bytes_per_project,
            max_submissions_per_minute,
            max_claims_per_minute,
            max_calls_per_minute,
            max_priority,
            max_job_memory_mebibytes,
            max_job_gigapixels,
            lease_seconds,
            progress_stall_seconds,
            max_attempts,
            upload_timeout_seconds,
            watch_stall_seconds,
            max_watches_per_caller,
            download_stall_seconds,
            max_transfers_per_caller,
            transfer_memory_mebibytes,
            max_connections,
            max_connections_per_address,
            connection_idle_seconds,
            abandoned_after_seconds,
            hook_allow_http,
            hook_allow_private,
            hook_ca,
            hook_give_up_seconds,
            keep_uploads_days,
            keep_outputs_days,
            keep_jobs_days,
            embedded_worker,
            worker_binary,
            worker_device,
            master_key_file,
            false_positive_rate,
            stop_seconds,
            log_format,
            log_filter,
        } = self;
        set(&mut settings.listen, listen);
        set(&mut settings.metrics_listen, metrics_listen.map(Some));
        set(&mut settings.page_listen, page_listen.map(Some));
        set(&mut settings.access, access);
        set(&mut settings.allow_open_network, allow_open_network);
        set(&mut settings.allow_raw_verification, allow_raw_verification);
        set(&mut settings.tls_certificate, tls_certificate.map(Some));
        set(&mut settings.tls_key, tls_key.map(Some));
        set(&mut settings.tls_client_ca, tls_client_ca.map(Some));
        set(&mut settings.data_dir, data_dir);
        set(&mut settings.database, database.map(Some));
        set(&mut settings.artifacts, artifacts.map(Some));
        set(&mut settings.signed_url_seconds, signed_url_seconds);
        set(&mut settings.max_artifact_bytes, max_artifact_bytes);
        set(&mut settings.max_queued_jobs, max_queued_jobs);
        set(&mut settings.max_queued_jobs_per_project, max_queued_jobs_per_project);
        set(
            &mut settings.max_artifact_bytes_per_project,
            max_artifact_bytes_per_project,
        );
        set(&mut settings.max_submissions_per_minute, max_submissions_per_minute);
        set(&mut settings.max_claims_per_minute, max_claims_per_minute);
        set(&mut settings.max_calls_per_minute, max_calls_per_minute);
        set(&mut settings.max_priority, max_priority);
        set(&mut settings.max_job_memory_mebibytes, max_job_memory_mebibytes);
        set(&mut settings.max_job_gigapixels, max_job_gigapixels);
        set(&mut settings.lease_seconds, lease_seconds);
        set(&mut settings.progress_stall_seconds, progress_stall_seconds);
        set(&mut settings.max_attempts, max_attempts);
        set(&mut settings.upload_timeout_seconds, upload_timeout_seconds);
        set(&mut settings.watch_stall_seconds, watch_stall_seconds);
        set(&mut settings.max_watches_per_caller, max_watches_per_caller);
        set(&mut settings.download_stall_seconds, download_stall_seconds);
        set(&mut settings.max_transfers_per_caller, max_transfers_per_caller);
        set(&mut settings.transfer_memory_mebibytes, transfer_memory_mebibytes);
        set(&mut settings.max_connections, max_connections);
        set(&mut settings.max_connections_per_address, max_connections_per_address);
        set(&mut settings.connection_idle_seconds, connection_idle_seconds);
        set(&mut settings.abandoned_after_seconds, abandoned_after_seconds);
        set(&mut settings.hook_allow_http, hook_allow_http);
        set(&mut settings.hook_allow_private, hook_allow_private);
        set(&mut settings.hook_ca, hook_ca.map(Some));
        set(&mut settings.hook_give_up_seconds, hook_give_up_seconds);
        set(&mut settings.keep_uploads_days, keep_uploads_days);
        set(&mut settings.keep_outputs_days, keep_outputs_days);
        set(&mut settings.keep_jobs_days, keep_jobs_days);
        set(&mut settings.embedded_worker, embedded_worker);
        set(&mut settings.worker_binary, worker_binary.map(Some));
        set(&mut settings.worker_device, worker_device);
        set(&mut settings.master_key_file, master_key_file.map(Some));
        set(&mut settings.false_positive_rate, false_positive_rate);
        set(&mut settings.stop_seconds, stop_seconds);
        set(&mut settings.log_format, log_format);
        set(&mut settings.log_filter, log_filter);
    }
}

fn set<T>(setting: &mut T, given: Option<T>) {
    if let Some(value) = given {
        *setting = value;
    }
}
