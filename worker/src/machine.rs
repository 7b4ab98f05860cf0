//! What seconds are measured on, and how: two of them can only be compared where this is the same.
use std::fmt;
use std::time::{Instant, SystemTime};

use guardsplat_evaluation::report::record::Timing;
use serde::Serialize;
use sysinfo::{CpuRefreshKind, ProcessRefreshKind, ProcessesToUpdate, System};

/// This machine, as a run of the program found it.
#[derive(Serialize)]
pub struct Machine {
    processor: String,
    cores: u32,
    threads: u32,
    /// When the run began.
    #[serde(rename = "date")]
    run: String,
    load_before: Option<f64>,
}

impl fmt::Display for Machine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            processor,
            cores,
            threads,
            run,
            ..
        } = self;
        write!(f, "{processor}, {cores} cores, {threads} threads, {run}")
    }
}

impl Machine {
    /// Looks around; to be asked before anything is computed, whose load it would see.
    pub fn here() -> Self {
        let mut system = System::new();
        system.refresh_cpu_specifics(CpuRefreshKind::nothing());
        let brand = system.cpus().first().map(|cpu| cpu.brand().trim().to_owned());
        let threads = rayon::current_num_threads();
        Self {
            processor: brand
                .filter(|name| !name.is_empty())
                .unwrap_or("an unnamed processor".into()),
            cores: std::thread::available_parallelism().map_or(threads, usize::from) as u32,
            threads: threads as u32,
            run: now(),
            load_before: sysinfo::IS_SUPPORTED_SYSTEM.then(|| System::load_average().one),
        }
    }

    /// Begins to measure.
    pub fn stopwatch(&self) -> Stopwatch<'_> {
        Stopwatch {
            machine: self,
            began: now(),
            start: Instant::now(),
            processor: processor_seconds(),
        }
    }
}

/// Measures one embedding.
pub struct Stopwatch<'a> {
    machine: &'a Machine,
    began: String,
    start: Instant,
    processor: Option<f64>,
}

impl Stopwatch<'_> {
    /// Seconds of wall time, and all else that belongs to them.
    pub fn stop(self) -> (f64, Timing) {
        let seconds = self.start.elapsed().as_secs_f64();
        let processor = self.processor.zip(processor_seconds());
        let machine = self.machine;
        let timing = Timing {
            processor: machine.processor.clone(),
            cores: machine.cores,
            threads: machine.threads,
            run: machine.run.clone(),
            began: self.began,
            load_before: machine.load_before,
            processor_seconds: processor.map(|(before, after)| (after - before).max(0.0)),
        };
        (seconds, timing)
    }
}

/// As RFC 3339, in UTC, to the second.
fn now() -> String {
    let mut now = prost_types::Timestamp::from(SystemTime::now());
    now.nanos = 0;
    now.to_string()
}

/// Processor time of this program so far, over all its threads.
fn processor_seconds() -> Option<f64> {
    let own = sysinfo::get_current_pid().ok()?;
    let mut system = System::new();
    let kind = ProcessRefreshKind::nothing().with_cpu();
    system.refresh_processes_specifics(ProcessesToUpdate::Some(&[own]), false, kind);
    Some(system.process(own)?.accumulated_cpu_time() as f64 / 1000.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_takes_processor_time_and_sleep_does_not() {
        let machine = Machine::here();
        assert!(!machine.processor.is_empty() && machine.cores > 0 && machine.threads > 0);
        assert!(machine.run.len() == 20 && machine.run.ends_with('Z'), "{}", machine.run);
        let stopwatch = machine.stopwatch();
        let end = Instant::now() + std::time::Duration::from_millis(300);
        let mut count = 0_u64;
        while Instant::now() < end {
            count = std::hint::black_box(count + 1);
        }
        let (seconds, timing) = stopwatch.stop();
        assert!(seconds >= 0.3);
        // Other tests of the same program run beside this one, and other programs take cores away.
        assert!(timing.processor_seconds.unwrap() > 0.0);
        assert_eq!(timing.run, machine.run);
    }
}
