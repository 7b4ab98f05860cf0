//! The worker of a server: leases jobs, carries them out with the engine, and hands back what came out.
//!
//! One task talks to the server, a thread of its own computes ([`accelerator`]). Heartbeats go on meanwhile
//! ([`lease`]), and bring word when a job was cancelled or given to another worker.
mod accelerator;
mod attempt;
mod backoff;
mod capabilities;
mod convert;
mod create_key_job;
mod credentials;
mod direct;
mod embed_job;
mod engine_cache;
mod error;
mod lease;
mod server;
mod shutdown;
mod transfer;
mod verify_job;
mod work_directory;
mod worker;

use std::path::PathBuf;

use guardsplat_engine::device::DeviceChoice;
use guardsplat_proto::connect::Target;

use crate::credentials_program::Certificate;
use accelerator::Accelerator;
use capabilities::WorkerCapabilities;
pub use error::{Error, Result};
use server::Server;
use work_directory::WorkDirectory;
use worker::Worker;

/// Most characters of a machine's name in a worker's.
const HOST_CHARACTERS: usize = 40;

/// What a worker is started with.
pub struct Options {
    /// The server, and how it is reached.
    pub server: Target,
    /// Where to compute.
    pub device: DeviceChoice,
    /// Bytes of memory that a job may take; all that the machine has unless given.
    pub memory: Option<u64>,
    /// What the worker calls itself.
    pub name: Option<String>,
    /// Whether the end of standard input asks the worker to leave.
    pub stop_with_stdin: bool,
    /// Where the files of jobs are kept for as long as these last.
    pub work_dir: Option<PathBuf>,
    /// Who signs content credentials.
    pub certificate: Certificate,
}

/// Works until it is asked to leave.
///
/// # Errors
/// Bad options, a device that can't be opened or is lost, an engine that panics, and a server that will have nothing to
/// do with this worker.
pub fn run(options: &Options) -> Result<()> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(Error::io("the worker's event loop"))?;
    let result = runtime.block_on(work(options));
    // Whatever still reads or writes a file is of no use any more.
    runtime.shutdown_background();
    result
}

async fn work(options: &Options) -> Result<()> {
    let server = Server::new(&options.server)?;
    credentials::check(&options.certificate)?;
    let leaving = shutdown::listen(options.stop_with_stdin).map_err(Error::io("signals"))?;
    let parent = options.work_dir.clone().unwrap_or_else(std::env::temp_dir);
    let folder = WorkDirectory::new(&parent)?;
    let (accelerator, device) = Accelerator::start(options.device, options.memory).await?;
    let name = options.name.clone().unwrap_or_else(default_name);
    tracing::info!(worker = name, device, server = options.server.url, "ready for jobs");
    let mut worker = Worker {
        server,
        leaving,
        folder,
        accelerator,
        certificate: options.certificate.clone(),
        capabilities: WorkerCapabilities::new(name, &device, options.memory),
    };
    worker.serve().await
}

/// The machine's name and the process's number.
fn default_name() -> String {
    let host = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let host: String = host.trim().chars().take(HOST_CHARACTERS).collect();
    let host = if host.is_empty() { "worker" } else { &host };
    format!("{host}-{}", std::process::id())
}
