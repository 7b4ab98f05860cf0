//! The workers, as those see them who look after jobs.
use std::time::Duration;

use guardsplat_proto::v1::Worker;

use crate::error::Result;
use crate::ledger::WorkerRow;
use crate::service::clock::{micros, timestamp};
use crate::service::names::ResourceKind;
use crate::service::{Service, clock};

/// A worker that was not heard of for so long, and has no job, is not told of.
const TOLD_FOR: Duration = Duration::from_secs(60 * 60);
/// Most that are told of at once.
const MOST: u32 = 1000;

impl Service {
    /// Workers that are there or were lately, with their jobs as a project may know them.
    pub(crate) async fn workers_of_all(&self, project: &str) -> Result<Vec<Worker>> {
        let now = clock::now();
        let since = now.saturating_sub(micros(TOLD_FOR));
        let there = self.ledger().workers_and_jobs(since, MOST).await?;
        let lease = micros(self.limits().lease);
        Ok(there.into_iter().map(|row| told(row, project, lease, now)).collect())
    }
}

/// Whoever has a job is not seen asking for one; but each of its reports sets the end of its lease.
fn told(row: WorkerRow, project: &str, lease: i64, now: i64) -> Worker {
    let reported = row.has.as_ref().map(|job| job.lease_expires.saturating_sub(lease));
    let heard = row.time.max(reported.unwrap_or(row.time)).min(now);
    let own = row.has.as_ref().filter(|job| job.project == project);
    Worker {
        name: row.seen.name,
        device: row.seen.device,
        version: row.seen.version,
        memory_bytes: row.seen.memory.and_then(|bytes| u64::try_from(bytes).ok()).unwrap_or(0),
        seen_time: Some(timestamp(heard)),
        busy: row.has.is_some(),
        job: own.map(|job| ResourceKind::Job.name(job.id)).unwrap_or_default(),
        attempt: own.map_or(0, |job| job.attempt),
        start_time: row.has.as_ref().map(|job| timestamp(job.start_time)),
    }
}

#[cfg(test)]
mod tests {
    use uuid::Uuid;

    use super::*;
    use crate::ledger::{LeasedJob, SeenWorker};

    #[test]
    fn whoever_works_was_heard_of_by_its_reports() {
        let row = |has| WorkerRow {
            seen: SeenWorker {
                name: "w".into(),
                device: String::new(),
                version: String::new(),
                memory: Some(5),
                clips: Vec::new(),
            },
            time: 1_000_000,
            has,
        };
        let job = |lease_expires| LeasedJob {
            id: Uuid::nil(),
            project: "a".into(),
            attempt: 2,
            start_time: 1_000_000,
            lease_expires,
        };
        let heard = |row, project| {
            let worker = told(row, project, 30_000_000, 50_000_000);
            (worker.seen_time.unwrap().seconds, worker.busy, worker.attempt)
        };
        assert_eq!(heard(row(None), "a"), (1, false, 0));
        assert_eq!(heard(row(Some(job(70_000_000))), "a"), (40, true, 2));
        // Of another project's job nothing is told.
        assert_eq!(heard(row(Some(job(70_000_000))), "b"), (40, true, 0));
        assert_eq!(told(row(Some(job(0))), "b", 0, 0).job, "");
        // A server with other leases, or another clock.
        assert_eq!(heard(row(Some(job(20_000_000))), "a").0, 1);
        assert_eq!(heard(row(Some(job(900_000_000))), "a").0, 50);
    }
}
