//! Workers, as they describe themselves.
use guardsplat_proto::v1::Worker;
use serde::Serialize;

use super::text::{some, time};
use crate::output::printable;

const GIB: f64 = (1_u64 << 30) as f64;

/// What is known of a worker.
#[derive(Debug, Serialize)]
pub struct WorkerReport {
    name: String,
    device: String,
    version: String,
    /// Null where it does not say.
    memory_bytes: Option<u64>,
    seen_time: Option<String>,
    busy: bool,
    /// Null without one, and for one of another project.
    job: Option<String>,
    attempt: Option<i32>,
    start_time: Option<String>,
}

impl From<&Worker> for WorkerReport {
    fn from(worker: &Worker) -> Self {
        let job = some(&worker.job);
        Self {
            name: worker.name.clone(),
            device: worker.device.clone(),
            version: worker.version.clone(),
            memory_bytes: Some(worker.memory_bytes).filter(|&bytes| bytes > 0),
            seen_time: time(worker.seen_time),
            busy: worker.busy,
            attempt: job.as_ref().map(|_| worker.attempt),
            job,
            start_time: time(worker.start_time),
        }
    }
}

impl WorkerReport {
    /// For people.
    pub fn line(&self) -> String {
        let does = match (&self.job, self.attempt, self.busy) {
            (Some(job), Some(attempt), _) => format!("attempt {attempt} of {}", printable(job)),
            (_, _, true) => "a job of another project".into(),
            _ => "waits".into(),
        };
        let mut what: Vec<String> = [&self.device, &self.version]
            .into_iter()
            .filter(|text| !text.is_empty())
            .map(|text| printable(text).to_string())
            .collect();
        what.extend(self.memory_bytes.map(|bytes| format!("{:.1} GiB", bytes as f64 / GIB)));
        format!(
            "{}  {does}  last heard of {}  {}",
            printable(&self.name),
            self.seen_time.as_deref().unwrap_or("never"),
            what.join(", ")
        )
        .trim_end()
        .to_owned()
    }
}
