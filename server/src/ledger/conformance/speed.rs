//! How fast jobs are given out of a long queue; a measurement, not a test.
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use futures::future::join_all;

use super::super::NewJob;
use super::Factory;
use super::fixture::*;

const QUEUED: usize = 10_000;
const CLAIMS: usize = 1_000;

/// The numbers of projects that are worth a look.
pub const PROJECTS: [usize; 3] = [1, 10, 1000];

/// Gives out a part of 10,000 queued jobs of so many projects, in two lanes each.
pub(crate) async fn claims_of_a_long_queue(name: &str, factory: &dyn Factory, projects: usize) {
    let ledgers = factory.open_several(8).await;
    let made = &AtomicUsize::new(0);
    join_all(ledgers.iter().flat_map(|ledger| [ledger; 8]).map(|ledger| async move {
        while let i @ 0..QUEUED = made.fetch_add(1, Ordering::Relaxed) {
            let new = NewJob {
                project: format!("project-{}", i % projects),
                priority: (i / projects % 2) as i32,
                spec: spec(7),
                ..new_job()
            };
            ledger.create_job(new, at(i as i64 / 1000)).await.unwrap();
        }
    }))
    .await;
    let ahead = ledgers[0].queue().await.unwrap();
    let begun = Instant::now();
    for id in ahead.iter().rev().take(100) {
        assert!(job(&*ledgers[0], *id).await.queue_position.is_some());
    }
    let position = begun.elapsed() / 100;
    for claimers in [1, 8] {
        let given = &AtomicUsize::new(0);
        let begun = Instant::now();
        join_all(ledgers.iter().take(claimers).map(|ledger| async move {
            while given.fetch_add(1, Ordering::Relaxed) < CLAIMS {
                claim(&**ledger, at(100)).await.expect("a job");
            }
        }))
        .await;
        let seconds = begun.elapsed().as_secs_f64();
        println!(
            "{name}, {QUEUED} queued of {projects} projects: {:.0} claims a second, {claimers} at once; \
             a position in {:.1} ms",
            CLAIMS as f64 / seconds,
            position.as_secs_f64() * 1e3
        );
    }
}
