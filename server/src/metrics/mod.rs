//! What is measured of the service, for Prometheus. What is counted here is this server's own; the queue and what was
//! given up are read from the ledger, and the same at all servers that share it.
//!
//! `docs/monitoring.md` says what each is for.
mod events;
mod labels;
mod page;

use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::Histogram;
use prometheus_client::metrics::info::Info;
use prometheus_client::registry::{Registry, Unit};
use tonic::Code;

use crate::access::METHODS;
use crate::ledger::{SeenWorker, Tally};
use labels::{
    AtStage, AttemptEnded, Build, Bytes, Call, Ended, GivenUp, Mark, OfKind, OfMethod, OnDevice, Part, Refused,
};

pub use events::{Watching, is_first, was_lost};
pub use labels::{code, kind, method, stage, state};
pub use page::{Page, serve};

/// What every name begins with.
const PREFIX: &str = "guardsplat";

/// Upper ends of buckets: how long a call takes, in seconds.
const CALL: [f64; 13] = [
    0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 10.0, 60.0,
];
/// How long a job waits or is worked on, in seconds.
const JOB: [f64; 14] = [
    0.1, 1.0, 5.0, 15.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1200.0, 1800.0, 3600.0, 7200.0, 14400.0,
];
/// Share of right bits: close together where marks are good.
const ACCURACY: [f64; 13] = [0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 0.97, 0.98, 0.99, 0.995, 0.999, 1.0];
/// PSNR in dB.
const PSNR: [f64; 13] = [
    20.0, 25.0, 28.0, 30.0, 32.0, 34.0, 36.0, 38.0, 40.0, 42.0, 45.0, 50.0, 60.0,
];

/// Memory that an attempt took, in bytes: 128 MiB to 256 GiB, each twice the one before.
const MEMORY: [f64; 12] = [
    134_217_728.0,
    268_435_456.0,
    536_870_912.0,
    1_073_741_824.0,
    2_147_483_648.0,
    4_294_967_296.0,
    8_589_934_592.0,
    17_179_869_184.0,
    34_359_738_368.0,
    68_719_476_736.0,
    137_438_953_472.0,
    274_877_906_944.0,
];

type Counts<L> = Family<L, Counter>;
type Gauges<L> = Family<L, Gauge>;
type Times<L> = Family<L, Histogram, fn() -> Histogram>;

/// What is measured.
#[derive(Debug)]
pub struct Metrics {
    registry: Registry,
    queued: Gauges<OfKind>,
    oldest: Family<OfKind, Gauge<f64, std::sync::atomic::AtomicU64>>,
    running: Gauges<OfKind>,
    running_memory: Gauges<OfKind>,
    workers: Gauges<OnDevice>,
    worker_memory: Gauges<OnDevice>,
    dead_letters: Gauges<GivenUp>,
    created: Counts<OfKind>,
    requeued: Counts<OfKind>,
    attempts: Counts<OfKind>,
    attempts_ended: Counts<AttemptEnded>,
    retries: Counts<OfKind>,
    ended: Counts<Ended>,
    wait: Times<OfKind>,
    run: Times<Ended>,
    stages: Times<AtStage>,
    memory: Times<OfKind>,
    device_memory: Times<OfKind>,
    marks: Counts<Mark>,
    accuracy: Histogram,
    psnr: Histogram,
    bytes: Counts<Bytes>,
    calls: Counts<Call>,
    call_time: Times<OfMethod>,
    refused: Counts<Refused>,
    watches: Gauge,
    watches_shed: Counter,
    downloads_shed: Counter,
    connections: Gauge,
    connections_turned_away: Counter,
    ready: Gauges<Part>,
}

impl Default for Metrics {
    fn default() -> Self {
        let mut registry = Registry::with_prefix(PREFIX);
        let r = &mut registry;
        let job_times = || Histogram::new(JOB);
        let metrics = Self {
            queued: add(r, "queued_jobs", "Jobs that wait for a worker", Family::default()),
            oldest: add(
                r,
                "oldest_queued_job_age_seconds",
                "How long the first queued job could have been given to a worker",
                Family::default(),
            ),
            running: add(r, "running_jobs", "Jobs that a worker has", Family::default()),
            running_memory: add(
                r,
                "running_memory_bytes",
                "Memory that running jobs probably take together, as far as their scenes told",
                Family::default(),
            ),
            workers: add(
                r,
                "workers",
                "Workers that asked for a job lately, or have one",
                Family::default(),
            ),
            worker_memory: add(
                r,
                "worker_memory_bytes",
                "Memory that jobs may take at these workers together, where they say so",
                Family::default(),
            ),
            dead_letters: add(
                r,
                "dead_letters",
                "Failed jobs that are there to be looked at",
                Family::default(),
            ),
            created: add(r, "jobs_created", "Jobs that were accepted", Family::default()),
            requeued: add(
                r,
                "jobs_requeued",
                "Failed jobs that were queued once more",
                Family::default(),
            ),
            attempts: add(r, "job_attempts", "Jobs given to workers", Family::default()),
            attempts_ended: add(r, "job_attempts_ended", "How attempts ended", Family::default()),
            retries: add(
                r,
                "job_retries",
                "Failed or lost attempts after which the job was queued again",
                Family::default(),
            ),
            ended: add(r, "jobs_ended", "Jobs that are over", Family::default()),
            wait: timed(
                r,
                "job_wait",
                "From when a job could be given to a worker until it was",
                job_times,
            ),
            run: timed(
                r,
                "job_run",
                "Length of the last attempt of a job that is over",
                job_times,
            ),
            stages: timed(
                r,
                "stage",
                "Length of a stage of an attempt, as its worker reports it",
                job_times,
            ),
            memory: add(
                r,
                "job_memory_bytes",
                "Memory that an attempt took at most, as its worker measured it",
                Family::new_with_constructor(|| Histogram::new(MEMORY)),
            ),
            device_memory: add(
                r,
                "job_device_memory_bytes",
                "Memory of its accelerator that a worker held at most during an attempt, as it measured it",
                Family::new_with_constructor(|| Histogram::new(MEMORY)),
            ),
            marks: add(
                r,
                "marks",
                "Marked scenes that were handed out, by whether the message is read from them in full",
                Family::default(),
            ),
            accuracy: add(
                r,
                "mark_bit_accuracy",
                "Mean share of right bits of a view of a marked scene that was handed out",
                Histogram::new(ACCURACY),
            ),
            psnr: add(
                r,
                "mark_psnr_db",
                "Mean PSNR in dB of a view of a marked scene that was handed out",
                Histogram::new(PSNR),
            ),
            bytes: add(
                r,
                "uploaded_bytes",
                "Bytes of artifacts that were taken in whole",
                Family::default(),
            ),
            calls: add(
                r,
                "calls",
                "Calls that were answered, by code of gRPC",
                Family::default(),
            ),
            call_time: timed(r, "call", "Until the answer to a call began", || Histogram::new(CALL)),
            refused: add(
                r,
                "calls_refused",
                "Calls refused for their token or for a limit, by reason",
                Family::default(),
            ),
            watches: add(r, "watches", "Watches that are looked after", Gauge::default()),
            watches_shed: add(
                r,
                "watches_shed",
                "Watches that were let go because their readers took nothing",
                Counter::default(),
            ),
            downloads_shed: add(
                r,
                "downloads_shed",
                "Downloads that were let go because their readers took nothing",
                Counter::default(),
            ),
            connections: add(
                r,
                "connections",
                "Connections of callers that are open",
                Gauge::default(),
            ),
            connections_turned_away: add(
                r,
                "connections_turned_away",
                "Connections that were refused, or closed for another, because there were too many",
                Counter::default(),
            ),
            ready: add(
                r,
                "ready",
                "Whether a part that the service needs is well: 1 or 0",
                Family::default(),
            ),
            registry: Registry::default(),
        };
        let build = Build {
            version: env!("CARGO_PKG_VERSION"),
        };
        registry.register("build", "Of which version the server is", Info::new(build));
        let metrics = Self { registry, ..metrics };
        metrics.begin();
        metrics
    }
}

impl Metrics {
    /// Makes the series that there can be, at zero: one that first appears with a 1 looks as if nothing had happened.
    fn begin(&self) {
        for job in labels::KINDS {
            let of = OfKind { kind: kind(job) };
            for counts in [&self.created, &self.requeued, &self.attempts, &self.retries] {
                drop(counts.get_or_create(&of));
            }
            drop(self.wait.get_or_create(&of));
            drop(self.memory.get_or_create(&of));
            drop(self.device_memory.get_or_create(&of));
            for outcome in labels::ATTEMPT_ENDS {
                let kind = kind(job);
                drop(self.attempts_ended.get_or_create(&AttemptEnded { kind, outcome }));
            }
            for end in labels::ENDS {
                drop(self.ended.get_or_create(&labels::over(job, end)));
                drop(self.run.get_or_create(&labels::over(job, end)));
            }
            for at in labels::STAGES {
                drop(self.stages.get_or_create(&AtStage {
                    kind: kind(job),
                    stage: stage(at),
                }));
            }
        }
        for recovered in ["true", "false"] {
            drop(self.marks.get_or_create(&Mark { recovered }));
        }
        for what in ["artifact", "output"] {
            drop(self.bytes.get_or_create(&Bytes { what }));
        }
        for (path, _) in METHODS {
            let (method, code) = (method(path), code(Code::Ok));
            drop(self.calls.get_or_create(&Call { method, code }));
            drop(self.call_time.get_or_create(&OfMethod { method }));
        }
        for reason in labels::REFUSALS {
            drop(self.refused.get_or_create(&Refused { reason }));
        }
    }

    /// What the ledger says now; where it says nothing there are no figures rather than old ones.
    pub fn tally(&self, tally: Option<Tally>, now: i64) {
        for gauges in [&self.queued, &self.running, &self.running_memory] {
            gauges.clear();
        }
        self.oldest.clear();
        self.dead_letters.clear();
        let Some(tally) = tally else { return };
        for job in labels::KINDS {
            let of = OfKind { kind: kind(job) };
            let waiting = tally.queued.iter().find(|waiting| waiting.kind == job);
            let age = waiting.map_or(0, |waiting| now.saturating_sub(waiting.since));
            self.queued
                .get_or_create(&of)
                .set(number(waiting.map_or(0, |waiting| waiting.count)));
            self.oldest.get_or_create(&of).set(seconds(age));
            let running = tally.running.iter().find(|running| running.kind == job);
            self.running
                .get_or_create(&of)
                .set(number(running.map_or(0, |running| running.count)));
            self.running_memory
                .get_or_create(&of)
                .set(number(running.map_or(0, |running| running.memory)));
            for reason in labels::REASONS {
                let (kind, reason) = (kind(job), labels::reason(reason.into()));
                drop(self.dead_letters.get_or_create(&GivenUp { kind, reason }));
            }
        }
        for (job, reason, count) in tally.failed {
            let (kind, reason) = (kind(job), labels::reason(reason as i32));
            self.dead_letters
                .get_or_create(&GivenUp { kind, reason })
                .set(number(count));
        }
    }

    /// The workers that are there, as the ledger has them; none where it says nothing.
    pub fn workers(&self, seen: Option<&[SeenWorker]>) {
        for gauges in [&self.workers, &self.worker_memory] {
            gauges.clear();
        }
        let Some(seen) = seen else { return };
        for device in labels::DEVICES {
            let of = OnDevice { device };
            let there = seen.iter().filter(|worker| labels::device(&worker.device) == device);
            let (count, memory) = there.fold((0, 0_i64), |(count, memory), worker| {
                (count + 1, memory.saturating_add(worker.memory.unwrap_or(0)))
            });
            self.workers.get_or_create(&of).set(count);
            self.worker_memory.get_or_create(&of).set(memory);
        }
    }

    /// All of it, as Prometheus reads it.
    pub fn text(&self) -> Result<String, std::fmt::Error> {
        let mut text = String::new();
        prometheus_client::encoding::text::encode(&mut text, &self.registry)?;
        Ok(text)
    }
}

fn add<M: prometheus_client::registry::Metric + Clone>(
    registry: &mut Registry,
    name: &str,
    help: &str,
    metric: M,
) -> M {
    registry.register(name, help, metric.clone());
    metric
}

/// Lengths of time, whose name ends with the unit.
fn timed<L>(registry: &mut Registry, name: &str, help: &str, new: fn() -> Histogram) -> Times<L>
where
    L: Clone
        + std::hash::Hash
        + Eq
        + std::fmt::Debug
        + prometheus_client::encoding::EncodeLabelSet
        + Send
        + Sync
        + 'static,
{
    let times = Family::new_with_constructor(new);
    registry.register_with_unit(name, help, Unit::Seconds, times.clone());
    times
}

/// Microseconds as seconds; a time that lies ahead is none.
fn seconds(micros: i64) -> f64 {
    micros.max(0) as f64 * 1e-6
}

fn number(count: u64) -> i64 {
    i64::try_from(count).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests;
