//! When the worker is to leave: SIGTERM or SIGINT, or the end of its standard input.
use std::io::Read;
use std::time::{Duration, Instant};

use tokio::sync::watch;

/// Signals that come so soon after the first are the same request: a terminal sends one to every process, and the
/// server that started the worker passes its own on.
const SAME_REQUEST: Duration = Duration::from_secs(1);

/// Whether the worker is to leave.
#[derive(Clone)]
pub struct ShutdownSignal(watch::Receiver<bool>);

impl ShutdownSignal {
    /// Waits until the worker is to leave.
    pub async fn asked(&mut self) {
        // The sender lives in tasks that end with the process only; were it gone, nobody could ask any more.
        if self.0.wait_for(|leaving| *leaving).await.is_err() {
            std::future::pending::<()>().await;
        }
    }
}

/// Listens from now on. A second signal ends the process at once.
pub fn listen(stop_with_stdin: bool) -> std::io::Result<ShutdownSignal> {
    let (sender, receiver) = watch::channel(false);
    let mut signals = Signals::new()?;
    let signalled = sender.clone();
    tokio::spawn(async move {
        signals.next().await;
        let first = Instant::now();
        tracing::info!("asked to leave; a second signal ends the worker at once");
        signalled.send_replace(true);
        loop {
            signals.next().await;
            if first.elapsed() >= SAME_REQUEST {
                tracing::warn!("a second signal; leaving at once");
                std::process::exit(1);
            }
        }
    });
    if stop_with_stdin {
        // A thread, because a read of standard input can't be called off; it ends with the process.
        std::thread::spawn(move || {
            let mut input = std::io::stdin().lock();
            let mut ignored = [0; 256];
            loop {
                match input.read(&mut ignored) {
                    Ok(0) => break,
                    Err(error) if error.kind() != std::io::ErrorKind::Interrupted => break,
                    _ => {}
                }
            }
            tracing::info!("standard input has ended; leaving");
            sender.send_replace(true);
        });
    }
    Ok(ShutdownSignal(receiver))
}

/// The signals that ask for an end.
#[cfg(unix)]
struct Signals {
    terminate: tokio::signal::unix::Signal,
    interrupt: tokio::signal::unix::Signal,
}

#[cfg(unix)]
impl Signals {
    fn new() -> std::io::Result<Self> {
        use tokio::signal::unix::{SignalKind, signal};
        Ok(Self {
            terminate: signal(SignalKind::terminate())?,
            interrupt: signal(SignalKind::interrupt())?,
        })
    }

    async fn next(&mut self) {
        tokio::select! {
            _ = self.terminate.recv() => {}
            _ = self.interrupt.recv() => {}
        }
    }
}

/// The signal that asks for an end.
#[cfg(not(unix))]
struct Signals;

#[cfg(not(unix))]
impl Signals {
    fn new() -> std::io::Result<Self> {
        Ok(Self)
    }

    async fn next(&mut self) {
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
    }
}
