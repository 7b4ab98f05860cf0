//! The writer: groups of changes, other processes, callers that go away.
use std::time::Duration;

use futures::future::join_all;
use uuid::Uuid;

use super::super::super::conformance::fixture::*;
use super::super::super::{JobQueue, JobStore, LedgerError, NewJob};
use super::Folder;
use super::file::raw;

/// Holds the file's write lock for as long as `while_locked` takes, as a backup or a person with a shell might.
async fn locked<T>(folder: &Folder, while_locked: impl Future<Output = T>) -> T {
    let mut other = raw(folder).await;
    sqlx::query("BEGIN IMMEDIATE").execute(&mut other).await.unwrap();
    let outcome = while_locked.await;
    sqlx::query("ROLLBACK").execute(&mut other).await.unwrap();
    outcome
}

#[tokio::test]
async fn another_process_with_the_lock_is_waited_for() {
    let folder = Folder::new();
    let ledger = folder.ledger().await;
    let there = queue(&*ledger, at(0)).await;
    let mut waiting = tokio::spawn({
        let ledger = ledger.clone();
        async move {
            // Not before the lock is taken.
            tokio::time::sleep(Duration::from_millis(100)).await;
            queue(&*ledger, at(1)).await
        }
    });
    locked(&folder, async {
        let early = tokio::time::timeout(Duration::from_millis(300), &mut waiting).await;
        assert!(early.is_err(), "the lock was not respected");
    })
    .await;
    let id = waiting.await.unwrap();
    assert_eq!(job(&*ledger, id).await.queue_position, Some(1));
    assert_eq!(job(&*ledger, there).await.queue_position, Some(0));
}

#[tokio::test]
async fn readers_do_not_wait_for_writers() {
    let folder = Folder::new();
    let ledger = folder.ledger().await;
    let id = queue(&*ledger, at(0)).await;
    locked(&folder, async {
        let read = tokio::time::timeout(Duration::from_secs(2), job(&*ledger, id));
        assert_eq!(read.await.expect("no waiting").id, id);
    })
    .await;
}

#[tokio::test]
async fn a_refused_change_harms_no_other_of_its_group() {
    let folder = Folder::new();
    let ledger = folder.ledger().await;
    let request_id = Some(Uuid::new_v4());
    let mut new: Vec<NewJob> = (0..7).map(|_| new_job()).collect();
    // A name that is taken.
    new[2].id = new[1].id;
    new[3].inputs = vec![Uuid::new_v4()];
    new[4].request_id = request_id;
    new[5] = NewJob {
        request_id,
        spec: spec(1),
        fingerprint: [1; 32],
        ..new_job()
    };
    let waiting = locked(&folder, async {
        let tasks = new.into_iter().map(|new| {
            let ledger = ledger.clone();
            tokio::spawn(async move { ledger.create_job(new, at(0)).await })
        });
        let waiting = tasks.collect::<Vec<_>>();
        tokio::time::sleep(Duration::from_millis(200)).await;
        waiting
    });
    let made: Vec<_> = join_all(waiting.await).await.into_iter().map(Result::unwrap).collect();
    let kept: Vec<bool> = made.iter().map(Result::is_ok).collect();
    assert_eq!(kept, [true, true, false, false, true, false, true], "{made:?}");
    assert!(matches!(made[2], Err(LedgerError::Database(_))));
    assert!(matches!(made[3], Err(LedgerError::NotFound { .. })));
    assert!(matches!(made[5], Err(LedgerError::RequestIdReused(_))));
    assert_eq!(ledger.queue_depth().await.unwrap(), 4);
}

#[tokio::test]
async fn a_worker_that_went_away_while_it_waited_is_given_nothing() {
    let folder = Folder::new();
    let ledger = folder.ledger().await;
    let id = queue(&*ledger, at(0)).await;
    locked(&folder, async {
        let gone = tokio::time::timeout(Duration::from_millis(100), claim(&*ledger, at(1))).await;
        assert!(gone.is_err(), "the claim did not wait");
    })
    .await;
    let lease = claim_of(&*ledger, id, at(2)).await;
    assert_eq!(lease.job.attempt, 1);
}
