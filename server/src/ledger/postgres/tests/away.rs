//! The database goes away, and comes back: calls fail in time and as what may be tried again, and nothing need be
//! started anew.
use std::time::{Duration, Instant};

use super::super::super::conformance::fixture::*;
use super::super::super::{JobQueue, JobStore, Ledger, LedgerError, PostgresLedger, RemoteChange};
use super::several::{listening, next};
use super::{Cluster, Place};

/// A call that can't succeed ends within this, with room for a busy machine.
const BOUND: Duration = Duration::from_secs(15);

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_that_stops_and_starts_is_waited_for() {
    // One of its own: the others go on.
    let Some(cluster) = Cluster::start() else { return };
    cluster.create("ledger", None);
    let url = cluster.url("ledger").into();
    let one = PostgresLedger::open(&url).await.unwrap();
    let two = PostgresLedger::open(&url).await.unwrap();
    let mut heard = listening(&two, &one).await;
    let lease = claim(&one, at(1)).await.unwrap();
    let before = one.list_jobs("default", &[], None, 10).await.unwrap();

    cluster.stop();
    let begun = Instant::now();
    let (made, read, checked, reported) = tokio::join!(
        one.create_job(new_job(), at(2)),
        one.get_job(lease.job.id),
        one.check(),
        two.report(lease.job.id, &lease.token, None, LEASE, at(2)),
    );
    assert!(begun.elapsed() < BOUND, "{:?}", begun.elapsed());
    refused!(made, LedgerError::Unavailable(_));
    refused!(read, LedgerError::Unavailable(_));
    refused!(checked, LedgerError::Unavailable(_));
    refused!(reported, LedgerError::Unavailable(_));

    cluster.resume();
    // The first call succeeds, and what was acknowledged is there.
    one.check().await.unwrap();
    assert_eq!(two.list_jobs("default", &[], None, 10).await.unwrap(), before);
    two.report(lease.job.id, &lease.token, None, LEASE, at(3))
        .await
        .unwrap();
    // The other one hears again: first, that it may have missed something.
    loop {
        match next(&mut heard).await {
            RemoteChange::Anything => break,
            RemoteChange::Job { .. } => {}
        }
    }
    let id = queue(&one, at(4)).await;
    loop {
        match next(&mut heard).await {
            RemoteChange::Job { id: changed, .. } if changed == id => break,
            _ => {}
        }
    }
    one.close().await;
    two.close().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn connections_that_are_ended_are_made_again() {
    let Some(place) = Place::fresh().await else { return };
    let (one, two) = (place.ledger().await, place.ledger().await);
    for round in 0..5 {
        let mut heard = listening(&two, &one).await;
        assert!(place.end_connections().await >= 2);
        let id = queue(&*one, at(round)).await;
        assert_eq!(job(&*two, id).await.id, id);
        // What happened meanwhile was missed, and that is told.
        while next(&mut heard).await != RemoteChange::Anything {}
    }
    // Amid calls, too: each of them is tried again, or says that it can be.
    let tasks: Vec<_> = (0..8)
        .map(|_| {
            let ledger = one.clone();
            tokio::spawn(async move {
                let mut made = Vec::new();
                for i in 0..40 {
                    match ledger.create_job(new_job(), at(i)).await {
                        Ok(job) => made.push(job.id),
                        Err(error) => assert!(matches!(error, LedgerError::Unavailable(_)), "{error:?}"),
                    }
                }
                made
            })
        })
        .collect();
    for _ in 0..5 {
        tokio::time::sleep(Duration::from_millis(30)).await;
        place.end_connections().await;
    }
    for task in tasks {
        for id in task.await.unwrap() {
            assert_eq!(job(&*two, id).await.id, id, "it was acknowledged");
        }
    }
    one.check().await.unwrap();
}

#[tokio::test]
async fn one_that_takes_no_writes_is_not_well() {
    let Some(place) = Place::fresh().await else { return };
    let ledger = place.ledger().await;
    ledger.check().await.unwrap();
    let set = |to: &str| {
        format!(
            "ALTER DATABASE \"{}\" SET default_transaction_read_only = {to}",
            place.name
        )
    };
    for (to, well) in [("on", false), ("off", true)] {
        let alter = sqlx::AssertSqlSafe(set(to));
        let mut db = place.raw().await;
        sqlx::query("SET default_transaction_read_only = off")
            .execute(&mut db)
            .await
            .unwrap();
        sqlx::query(alter).execute(&mut db).await.unwrap();
        drop(db);
        place.end_connections().await;
        match ledger.check().await {
            Ok(()) => assert!(well),
            Err(error) => assert!(!well && matches!(error, LedgerError::Unavailable(_)), "{error:?}"),
        }
    }
}

#[tokio::test]
async fn a_lock_that_is_held_ends_in_time() {
    let Some(place) = Place::fresh().await else { return };
    let ledger = place.ledger().await;
    let id = queue(&*ledger, at(0)).await;
    let mut db = place.raw().await;
    for statement in ["BEGIN", "SELECT 1 FROM jobs FOR UPDATE"] {
        sqlx::query(sqlx::AssertSqlSafe(statement))
            .execute(&mut db)
            .await
            .unwrap();
    }
    // Others are taken meanwhile.
    let other = queue(&*ledger, at(1)).await;
    claim_of(&*ledger, other, at(2)).await;
    let begun = Instant::now();
    refused!(ledger.cancel_job(id, at(2)).await, LedgerError::Unavailable(_));
    assert!(begun.elapsed() < BOUND, "{:?}", begun.elapsed());
    sqlx::query("ROLLBACK").execute(&mut db).await.unwrap();
    ledger.cancel_job(id, at(3)).await.unwrap();
}

#[tokio::test]
async fn a_closed_ledger_says_so() {
    let Some(place) = Place::fresh().await else { return };
    let ledger = place.ledger().await;
    ledger.close().await;
    refused!(ledger.cancel_job(uuid::Uuid::nil(), 0).await, LedgerError::Closed);
    refused!(ledger.check().await, LedgerError::Closed);
    ledger.close().await;
}
