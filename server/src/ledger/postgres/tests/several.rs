//! Several servers over one database: who extends leases, and how they hear of each other.
use std::time::Duration;

use tokio::sync::broadcast::Receiver;
use tokio::time::timeout;

use super::super::super::conformance::fixture::*;
use super::super::super::{JobQueue, JobStore, Ledger, PostgresLedger, RemoteChange};
use super::Place;

/// By then whatever is waited for has happened.
const SOON: Duration = Duration::from_secs(20);

pub(super) async fn next(heard: &mut Receiver<RemoteChange>) -> RemoteChange {
    timeout(SOON, heard.recv()).await.expect("nothing is heard").unwrap()
}

/// Waits until a ledger hears of others.
pub(super) async fn listening(ledger: &PostgresLedger, other: &PostgresLedger) -> Receiver<RemoteChange> {
    let mut heard = ledger.remote_changes().unwrap();
    for _ in 0..100 {
        let wanted = queue(other, at(0)).await;
        // That it began to listen says nothing of what was announced just before.
        while let Ok(Ok(news)) = timeout(SOON / 100, heard.recv()).await {
            if matches!(news, RemoteChange::Job { id, .. } if id == wanted) {
                return heard;
            }
        }
    }
    panic!("nothing is heard");
}

#[tokio::test]
async fn what_one_server_changes_the_others_hear() {
    let Some(place) = Place::fresh().await else { return };
    let (one, two) = (place.ledger().await, place.ledger().await);
    let mut heard = listening(&two, &one).await;
    let mut own = one.remote_changes().unwrap();
    let mut expect = async |id, queue_grew, queue_moved| {
        let wanted = RemoteChange::Job {
            id,
            queue_grew,
            queue_moved,
        };
        assert_eq!(next(&mut heard).await, wanted);
    };
    let first = claim(&*one, at(1)).await.unwrap();
    expect(first.job.id, false, true).await;
    let id = queue(&*one, at(2)).await;
    expect(id, true, false).await;
    one.report(first.job.id, &first.token, Some(progress(1)), LEASE, at(2))
        .await
        .unwrap();
    expect(first.job.id, false, false).await;
    // The lease is extended, and that is all.
    one.report(first.job.id, &first.token, Some(progress(1)), LEASE, at(3))
        .await
        .unwrap();
    one.release(first.job.id, &first.token, at(4)).await.unwrap();
    expect(first.job.id, true, true).await;
    one.cancel_job(id, at(5)).await.unwrap();
    expect(id, false, true).await;
    let first = claim(&*one, at(6)).await.unwrap();
    expect(first.job.id, false, true).await;
    complete(&*one, &first, &[], at(7)).await;
    expect(first.job.id, false, false).await;
    // Nobody hears of what it did itself: the first thing it hears is what the other does.
    let theirs = queue(&*two, at(8)).await;
    loop {
        match next(&mut own).await {
            RemoteChange::Anything => {}
            RemoteChange::Job { id, .. } => break assert_eq!(id, theirs),
        }
    }
}

/// A server that is restarted again and again must not keep alive the leases of workers that are gone.
#[tokio::test]
async fn a_server_that_begins_beside_another_extends_no_lease() {
    let Some(place) = Place::fresh().await else { return };
    let (one, two) = (place.ledger().await, place.ledger().await);
    let id = queue(&*one, at(0)).await;
    let lease = claim_of(&*one, id, at(0)).await;
    one.reap(at(28)).await.unwrap();
    two.renew_leases(LEASE, at(29)).await.unwrap();
    assert_eq!(two.reap(at(30)).await.unwrap(), [id]);
    assert!(is_lost(&one.report(id, &lease.token, None, LEASE, at(31)).await));

    // When none was there, the first one extends them, and the next one leaves it at that.
    let lease = claim_of(&*one, id, at(100)).await;
    one.reap(at(101)).await.unwrap();
    two.renew_leases(LEASE, at(1000)).await.unwrap();
    one.renew_leases(LEASE, at(1002)).await.unwrap();
    assert_eq!(one.reap(at(1029)).await.unwrap(), NONE);
    one.report(id, &lease.token, None, LEASE, at(1029)).await.unwrap();
    assert_eq!(one.reap(at(1030)).await.unwrap(), NONE);
    // A time that lies in the future tells nothing.
    let future = sqlx::query("UPDATE presence SET time = $1").bind(at(5000));
    future.execute(&mut place.raw().await).await.unwrap();
    two.renew_leases(LEASE, at(1058)).await.unwrap();
    assert_eq!(one.reap(at(1087)).await.unwrap(), NONE);
    assert_eq!(one.reap(at(1088)).await.unwrap(), [id]);
}

#[tokio::test]
async fn servers_that_begin_at_once_make_the_tables_once() {
    let Some(place) = Place::empty().await else { return };
    let tasks: Vec<_> = (0..4)
        .map(|_| {
            let url = place.url();
            tokio::spawn(async move { PostgresLedger::open(&url).await.unwrap() })
        })
        .collect();
    let mut ids = Vec::new();
    for task in tasks {
        ids.push(queue(&task.await.unwrap(), at(0)).await);
    }
    assert_eq!(
        place
            .ledger()
            .await
            .list_jobs("default", &[], None, 10)
            .await
            .unwrap()
            .len(),
        ids.len()
    );
}
