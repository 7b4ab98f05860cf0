//! The engine on a thread of its own, behind a queue: computing never keeps heartbeats waiting.
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc;

use guardsplat_engine::device::DeviceChoice;
use tokio::sync::oneshot;

use super::engine_cache::EngineCache;
use super::error::{Error, Result};

/// As much as the main thread has, which the commands run on.
const STACK: usize = 8 << 20;

/// Says whether the thread can go on.
type Work = Box<dyn FnOnce(&mut EngineCache) -> bool + Send>;

/// The way into the thread's queue.
pub struct Accelerator {
    queue: mpsc::Sender<Work>,
}

impl Accelerator {
    /// Starts the thread and opens the device on it, for jobs that may take `budget` bytes of memory; the device's name
    /// comes back too.
    ///
    /// # Errors
    /// Those of opening the device.
    pub async fn start(device: DeviceChoice, budget: Option<u64>) -> Result<(Self, String)> {
        let (queue, waiting) = mpsc::channel::<Work>();
        let (opened, is_open) = oneshot::channel();
        let run = move || {
            let mut cache = match EngineCache::open(device, budget) {
                Ok(cache) => cache,
                Err(error) => {
                    let _ = opened.send(Err(error));
                    return;
                }
            };
            let _ = opened.send(Ok(cache.device().to_owned()));
            // Ends when the worker does.
            while let Ok(work) = waiting.recv() {
                if !work(&mut cache) {
                    // Whatever state the device is in, it is not to be touched any more; the process ends anyway.
                    std::mem::forget(cache);
                    return;
                }
            }
        };
        std::thread::Builder::new()
            .name("engine".into())
            .stack_size(STACK)
            .spawn(run)
            .map_err(Error::io("the engine's thread"))?;
        let name = is_open.await.map_err(|_| gone())??;
        Ok((Self { queue }, name))
    }

    /// Does `work` on the engine's thread, after all that was given to it before.
    ///
    /// # Errors
    /// [`Error::Panicked`] when this work panics, or something did before. The thread does nothing any more then.
    pub async fn run<T: Send + 'static>(&self, work: impl FnOnce(&mut EngineCache) -> T + Send + 'static) -> Result<T> {
        let (reply, answer) = oneshot::channel();
        let work = Box::new(move |cache: &mut EngineCache| {
            // The cache is not used again after a panic.
            let done = catch_unwind(AssertUnwindSafe(|| work(cache))).map_err(|panic| words(&*panic));
            let fine = done.is_ok();
            // Nobody waits any more when the job was given up meanwhile.
            let _ = reply.send(done);
            fine
        });
        self.queue.send(work).map_err(|_| gone())?;
        answer.await.map_err(|_| gone())?.map_err(Error::Panicked)
    }

    /// Waits until the thread has nothing to do.
    ///
    /// # Errors
    /// As [`Accelerator::run`].
    pub async fn idle(&self) -> Result<()> {
        self.run(|_| ()).await
    }
}

fn gone() -> Error {
    Error::Panicked("its thread has ended".into())
}

/// What a panic says.
fn words(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied();
    let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    text.unwrap_or("without a word").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[tokio::test]
    async fn work_is_done_elsewhere_and_in_order() {
        let (accelerator, name) = Accelerator::start(DeviceChoice::Cpu, None).await.unwrap();
        assert_eq!(name, "cpu");
        let here = std::thread::current().id();
        let there = accelerator.run(|_| std::thread::current().id()).await.unwrap();
        assert_ne!(here, there);
        let (end, ended) = mpsc::channel::<()>();
        let slow = accelerator.run(move |_| ended.recv());
        // Given up while it runs.
        let short = Duration::from_millis(50);
        assert!(tokio::time::timeout(short, slow).await.is_err());
        let early = tokio::time::timeout(short, accelerator.idle()).await;
        assert!(early.is_err(), "idle while it works");
        end.send(()).unwrap();
        accelerator.idle().await.unwrap();
    }

    #[tokio::test]
    async fn a_panic_is_an_error_with_its_words_and_the_end() {
        let (accelerator, _) = Accelerator::start(DeviceChoice::Cpu, None).await.unwrap();
        let result: Result<()> = accelerator.run(|_| panic!("device on fire")).await;
        let error = result.unwrap_err();
        assert_eq!(error.to_string(), "the engine panicked: device on fire");
        assert!(error.is_fatal());
        let after = accelerator.run(|_| ()).await.unwrap_err();
        assert!(matches!(after, Error::Panicked(_)));
    }
}
