//! The embedded worker: a process of its own that the server starts, watches and starts again.
//!
//! A process, because a job that crashes its worker must not take the server with it, and because the server is free of
//! GPU code. The worker's standard input is a pipe that nothing is ever written to: when the server is gone, however it
//! went, the pipe ends, and the worker ends with it.
use std::ffi::OsString;
use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};
use std::process::{ExitStatus, Stdio};
use std::time::Duration;

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use secrecy::{ExposeSecret, SecretString};
use tokio::process::{Child, Command};
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tokio::time::{Instant, sleep, timeout};

use crate::access::TOKEN_VARIABLE;
use crate::artifacts::is_of_stores;
use crate::error::{Error, Result};
use crate::secrets::MASTER_KEY_VARIABLE;
use crate::settings::{DATABASE_VARIABLE, Settings};

/// Name of the worker's program beside the server's.
const PROGRAM: &str = "guardsplat-worker";
/// Variables with which a worker finds other servers; the server that starts it is none of those.
const OF_CLIENTS: [&str; 5] = [
    TOKEN_VARIABLE,
    "GUARDSPLAT_TOKEN_FILE",
    "GUARDSPLAT_CA",
    "GUARDSPLAT_CERT",
    "GUARDSPLAT_CERT_KEY",
];
/// Most bytes of the host in the worker's name.
const HOST_BYTES: usize = 32;

/// How a worker is started.
#[derive(Clone, Debug)]
pub struct WorkerProcess {
    /// Its program.
    pub program: PathBuf,
    /// Its arguments.
    pub arguments: Vec<OsString>,
    /// The token that it shows, where the server asks for one.
    pub token: Option<SecretString>,
}

impl WorkerProcess {
    /// As the settings have it, for a server that listens at `address`. A program that is not there is an error now
    /// rather than a line in the log later.
    pub fn new(settings: &Settings, address: SocketAddr) -> Result<Self> {
        let program = match &settings.worker_binary {
            Some(program) => program.clone(),
            None => beside_this_program()?,
        };
        if !program.is_file() {
            return Err(Error::Startup(format!(
                "the embedded worker's program {} is not there; name it with worker_binary, or switch the worker off \
                 with embedded_worker = false",
                program.display()
            )));
        }
        // A bare name would be looked for on the search path instead of where it was just found.
        let program = std::path::absolute(program).map_err(|error| Error::internal("finding the worker", error))?;
        let url = format!("http://{}", reachable(address));
        let device = settings.worker_device.as_str();
        let mut arguments = ["run", "--server", &url, "--stop-with-stdin", "--device", device].to_vec();
        let memory = settings.max_job_memory_mebibytes;
        let mebibytes = memory.to_string();
        if memory > 0 {
            arguments.extend(["--memory", &mebibytes]);
        }
        let name = name();
        arguments.extend(["--name", &name]);
        Ok(Self {
            program,
            arguments: arguments.into_iter().map(OsString::from).collect(),
            token: None,
        })
    }

    fn command(&self) -> io::Result<Command> {
        let mut command = Command::new(&self.program);
        command
            .args(&self.arguments)
            .env_remove(MASTER_KEY_VARIABLE)
            .env_remove(DATABASE_VARIABLE)
            .env_remove("PGPASSWORD")
            .stdin(Stdio::piped())
            // Standard output is the server's own; what a worker says goes to the log.
            .stdout(io::stderr().as_fd().try_clone_to_owned()?)
            // Ctrl-C at a terminal goes to the server alone, which then ends the worker in good order.
            .process_group(0)
            .kill_on_drop(true);
        for variable in OF_CLIENTS {
            command.env_remove(variable);
        }
        for (variable, _) in std::env::vars_os() {
            if variable.to_str().is_some_and(is_of_stores) {
                command.env_remove(variable);
            }
        }
        if let Some(token) = &self.token {
            // Arguments are seen by everybody on the machine, a variable by its owner.
            command.env(TOKEN_VARIABLE, token.expose_secret());
        }
        Ok(command)
    }
}

/// How long to wait before a worker that ended is started again.
#[derive(Clone, Copy, Debug)]
pub struct Backoff {
    /// The first time; it doubles from there.
    pub first: Duration,
    /// At most.
    pub longest: Duration,
    /// A worker that ran for so long was well, and the next pause is the first again.
    pub well_after: Duration,
}

impl Default for Backoff {
    fn default() -> Self {
        let [first, longest, well_after] = [1, 60, 120].map(Duration::from_secs);
        Self {
            first,
            longest,
            well_after,
        }
    }
}

/// A worker that is kept running.
#[derive(Debug)]
pub struct EmbeddedWorker {
    stop: oneshot::Sender<Duration>,
    task: JoinHandle<()>,
}

impl EmbeddedWorker {
    /// Starts a worker, and starts it again whenever it ends.
    pub fn start(worker: WorkerProcess, backoff: Backoff) -> Self {
        let (stop, stopped) = oneshot::channel();
        Self {
            stop,
            task: tokio::spawn(supervise(worker, backoff, stopped)),
        }
    }

    /// Asks the worker to end and waits until it has. Past `limit` it is killed.
    pub async fn stop(self, limit: Duration) {
        // It fails only if the task is over already.
        let _ = self.stop.send(limit);
        if let Err(error) = self.task.await {
            tracing::error!(%error, "the embedded worker's supervision broke");
        }
    }
}

async fn supervise(worker: WorkerProcess, backoff: Backoff, mut stopped: oneshot::Receiver<Duration>) {
    let mut pause = backoff.first;
    loop {
        let started = Instant::now();
        match worker.command().and_then(|mut command| command.spawn()) {
            Ok(mut child) => {
                // Waiting for a child closes its standard input, which would end it.
                let stdin = child.stdin.take();
                tracing::info!(pid = child.id(), "started the embedded worker");
                tokio::select! {
                    ended = child.wait() => report(ended),
                    limit = &mut stopped => return terminate(child, limit.unwrap_or_default()).await,
                }
                drop(stdin);
            }
            Err(error) => {
                tracing::error!(program = %worker.program.display(), %error, "the embedded worker can't be started");
            }
        }
        if started.elapsed() >= backoff.well_after {
            pause = backoff.first;
        }
        tracing::info!("the embedded worker is started again in {pause:?}");
        tokio::select! {
            () = sleep(pause) => {}
            _ = &mut stopped => return,
        }
        pause = (pause * 2).min(backoff.longest);
    }
}

fn report(ended: io::Result<ExitStatus>) {
    match ended {
        Ok(status) => tracing::warn!(%status, "the embedded worker ended"),
        Err(error) => tracing::error!(%error, "the embedded worker can't be waited for"),
    }
}

async fn terminate(mut child: Child, limit: Duration) {
    // The number stays the child's own until the child was waited for.
    if let Some(pid) = child.id().and_then(|pid| i32::try_from(pid).ok())
        && let Err(error) = kill(Pid::from_raw(pid), Signal::SIGTERM)
    {
        tracing::warn!(%error, "the embedded worker can't be asked to end");
    }
    match timeout(limit, child.wait()).await {
        Ok(Ok(status)) => tracing::info!(%status, "stopped the embedded worker"),
        Ok(Err(error)) => tracing::error!(%error, "the embedded worker can't be waited for"),
        Err(_) => {
            tracing::warn!("the embedded worker did not end within {limit:?} and is killed");
            if let Err(error) = child.kill().await {
                tracing::error!(%error, "the embedded worker can't be killed");
            }
        }
    }
}

fn beside_this_program() -> Result<PathBuf> {
    let this = std::env::current_exe().map_err(|error| Error::internal("finding this program", error))?;
    Ok(this.parent().unwrap_or(Path::new(".")).join(PROGRAM))
}

/// Where a process of this machine reaches a server that listens at `address`.
fn reachable(address: SocketAddr) -> SocketAddr {
    let ip = match address.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
        ip => ip,
    };
    SocketAddr::new(ip, address.port())
}

fn name() -> String {
    let host = nix::unistd::gethostname()
        .ok()
        .and_then(|host| host.into_string().ok())
        .unwrap_or_default();
    let host: String = host
        .chars()
        .filter(|c| c.is_ascii_alphanumeric() || "-.".contains(*c))
        .take(HOST_BYTES)
        .collect();
    format!("embedded-{host}-{}", std::process::id())
}

#[cfg(test)]
mod tests;
