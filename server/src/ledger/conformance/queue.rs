//! The order of the queue.
use std::collections::HashSet;
use std::sync::Arc;

use super::super::{JobId, Ledger};
use super::Factory;
use super::fixture::*;

pub(crate) async fn first_in_first_out(factory: &dyn Factory) {
    let ledger = factory.open().await;
    assert!(claim(&*ledger, at(0)).await.is_none());
    let mut ids = Vec::new();
    for i in 0..6 {
        ids.push(queue(&*ledger, at(i / 3)).await);
    }
    // A clock that was set back doesn't hold jobs up.
    for id in ids {
        let lease = claim_of(&*ledger, id, at(-1000)).await;
        assert_eq!((lease.job.attempt, lease.job.start_time), (1, Some(at(-1000))));
    }
    assert!(claim(&*ledger, at(10)).await.is_none());
}

pub(crate) async fn positions_count_the_jobs_ahead(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let mut ids = Vec::new();
    for i in 0..3 {
        ids.push(queue(&*ledger, at(i)).await);
    }
    assert_eq!(job(&*ledger, ids[2]).await.queue_position, Some(2));
    assert_eq!(ledger.queue_depth().await.unwrap(), 3);
    claim_of(&*ledger, ids[0], at(5)).await;
    assert_eq!(job(&*ledger, ids[0]).await.queue_position, None);
    assert_eq!(job(&*ledger, ids[2]).await.queue_position, Some(1));
    ledger.cancel_job(ids[1], at(6)).await.unwrap();
    assert_eq!(job(&*ledger, ids[2]).await.queue_position, Some(0));
    assert_eq!(ledger.queue_depth().await.unwrap(), 1);
}

/// Claims until `total` jobs have been given out, by whoever.
async fn claim_many(ledger: Arc<dyn Ledger>, given: Arc<std::sync::Mutex<Vec<JobId>>>, total: usize) {
    while given.lock().unwrap().len() < total {
        if let Some(lease) = claim(&*ledger, at(100)).await {
            given.lock().unwrap().push(lease.job.id);
        } else {
            tokio::task::yield_now().await;
        }
    }
}

pub(crate) async fn many_claims_never_share_a_job(factory: &dyn Factory) {
    const JOBS: usize = 200;
    let ledgers = factory.open_several(4).await;
    let given = Arc::new(std::sync::Mutex::new(Vec::new()));
    let mut tasks = Vec::new();
    for ledger in ledgers.iter().chain(&ledgers) {
        tasks.push(tokio::spawn(claim_many(ledger.clone(), given.clone(), JOBS)));
        let ledger = ledger.clone();
        tasks.push(tokio::spawn(async move {
            for i in 0..JOBS / 8 {
                queue(&*ledger, at(i as i64)).await;
            }
        }));
    }
    for task in tasks {
        task.await.unwrap();
    }
    let given = given.lock().unwrap();
    assert_eq!(given.len(), JOBS);
    assert_eq!(given.iter().collect::<HashSet<_>>().len(), JOBS);
}
