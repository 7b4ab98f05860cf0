//! Work of the engine on a thread of its own, while the calling thread tells of progress and listens for signals.
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::Duration;

use guardsplat_engine::stop::Stop;
use guardsplat_engine::{Error, Result};
use pyo3::prelude::*;

use crate::errors::{exception, failure};

/// Time between two looks for signals.
const LISTEN: Duration = Duration::from_millis(50);
/// What a program's first thread has, on which the worker computes.
const STACK: usize = 8 << 20;

/// What is going on, in the terms of the service's API.
#[derive(Clone, Copy, Default)]
pub struct Event {
    /// `optimising` or `reading`.
    pub stage: &'static str,
    /// Steps, views or pictures done.
    pub done: usize,
    /// Of so many.
    pub total: usize,
    /// Share of right bits in the last step's views.
    pub bit_accuracy: Option<f64>,
    /// Their PSNR in dB, where they differ.
    pub psnr_db: Option<f64>,
}

/// Heeds an end, and tells what is going on.
pub struct Context {
    /// Asked for an end by a signal, or by an exception of who hears of progress.
    pub stop: Stop,
    events: Sender<Event>,
}

impl Context {
    /// Tells of progress.
    pub fn tell(&self, event: Event) {
        // Nobody is left to hear when the caller has given up.
        let _ = self.events.send(event);
    }

    /// Tells that so many of all are done.
    pub fn at(&self, stage: &'static str, done: usize, total: usize) {
        self.tell(Event {
            stage,
            done,
            total,
            ..Event::default()
        });
    }
}

/// Runs `work` without holding Python's lock. `progress` is `None` or what users gave as such; a signal's exception, such as
/// KeyboardInterrupt, or one that it raises, ends the work and is raised then.
pub fn run<T: Send>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Context) -> Result<T> + Send,
) -> PyResult<T> {
    let listener = py
        .import("guardsplat._progress")?
        .getattr("listener")?
        .call1((progress,))?;
    let stop = Stop::default();
    let (events, told) = channel();
    let told = Mutex::new(told);
    let context = Context {
        stop: stop.clone(),
        events,
    };
    let (outcome, raised) = thread::scope(|scope| {
        let thread = thread::Builder::new().name("guardsplat".into()).stack_size(STACK);
        // The context goes with the work, so that the channel closes at its end.
        let thread = thread.spawn_scoped(scope, move || work(&context)).map_err(|error| {
            exception(
                py,
                &Error::Io {
                    path: "thread".into(),
                    source: error,
                },
            )
        })?;
        let mut raised = None;
        while let Some(event) = next(py, &told) {
            if raised.is_some() {
                continue;
            }
            let heard = event.map_or(Ok(()), |event| tell(&listener, event));
            if let Err(error) = heard.and_then(|()| py.check_signals()) {
                stop.request();
                raised = Some(error);
            }
        }
        let outcome = py.detach(|| thread.join());
        PyResult::Ok((outcome, raised))
    })?;
    listener.call_method0("close")?;
    if let Some(error) = raised {
        return Err(error);
    }
    match outcome {
        Ok(outcome) => outcome.map_err(|error| exception(py, &error)),
        // A bug of ours, told as such.
        Err(_) => Err(failure("the engine panicked; what it said is on standard error")),
    }
}

/// The next event, `Some(None)` after a while without one, `None` when there will be no more.
fn next(py: Python<'_>, told: &Mutex<Receiver<Event>>) -> Option<Option<Event>> {
    let received = py.detach(|| match told.lock() {
        Ok(told) => told.recv_timeout(LISTEN),
        Err(_) => Err(RecvTimeoutError::Disconnected),
    });
    match received {
        Ok(event) => Some(Some(event)),
        Err(RecvTimeoutError::Timeout) => Some(None),
        Err(RecvTimeoutError::Disconnected) => None,
    }
}

fn tell(listener: &Bound<'_, PyAny>, event: Event) -> PyResult<()> {
    let Event {
        stage,
        done,
        total,
        bit_accuracy,
        psnr_db,
    } = event;
    listener.call1((stage, done, total, bit_accuracy, psnr_db))?;
    Ok(())
}
