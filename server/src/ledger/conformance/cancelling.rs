//! Ending jobs because somebody asked.
use super::super::{JobState, LedgerError};
use super::Factory;
use super::fixture::*;

pub(crate) async fn cancelling_a_queued_job_ends_it(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let id = queue(&*ledger, at(0)).await;
    let row = ledger.cancel_job(id, at(1)).await.unwrap();
    assert_eq!(
        (row.state, row.end_time, row.revision),
        (JobState::Cancelled, Some(at(1)), 2)
    );
    assert_eq!(row, job(&*ledger, id).await);
    assert!(claim(&*ledger, at(2)).await.is_none());
    refused!(
        ledger.cancel_job(id, at(3)).await,
        LedgerError::Finished {
            state: JobState::Cancelled,
            ..
        }
    );

    // One that waits for another attempt, too.
    let id = queue(&*ledger, at(4)).await;
    let lease = claim_of(&*ledger, id, at(5)).await;
    ledger
        .fail(id, &lease.token, failure("x"), true, false, at(6))
        .await
        .unwrap();
    let row = ledger.cancel_job(id, at(7)).await.unwrap();
    assert_eq!(
        (row.state, row.run_after, row.failure),
        (JobState::Cancelled, None, None)
    );
    assert!(claim(&*ledger, at(1000)).await.is_none());
}

pub(crate) async fn cancelling_a_running_job_asks_for_its_end(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let id = queue(&*ledger, at(0)).await;
    let lease = claim_of(&*ledger, id, at(1)).await;
    let row = ledger.cancel_job(id, at(2)).await.unwrap();
    assert_eq!(
        (row.state, row.cancel_requested, row.revision),
        (JobState::Running, true, 3)
    );
    assert_eq!(
        ledger.cancel_job(id, at(3)).await.unwrap(),
        row,
        "asking twice changes nothing"
    );
    assert!(ledger.report(id, &lease.token, None, LEASE, at(4)).await.unwrap());
    let row = ledger.fail(id, &lease.token, None, false, true, at(5)).await.unwrap();
    assert_eq!(
        (row.state, row.failure, row.end_time),
        (JobState::Cancelled, None, Some(at(5)))
    );
    assert!(!row.cancel_requested);
    refused!(ledger.cancel_job(id, at(6)).await, LedgerError::Finished { .. });
}

pub(crate) async fn a_cancelled_job_is_not_tried_again(factory: &dyn Factory) {
    let ledger = factory.open().await;
    for way in 0..3 {
        let id = queue(&*ledger, at(0)).await;
        let lease = claim_of(&*ledger, id, at(1)).await;
        ledger.cancel_job(id, at(2)).await.unwrap();
        match way {
            0 => drop(
                ledger
                    .fail(id, &lease.token, failure("x"), true, false, at(3))
                    .await
                    .unwrap(),
            ),
            1 => drop(ledger.release(id, &lease.token, at(3)).await.unwrap()),
            _ => assert_eq!(ledger.reap(at(31)).await.unwrap(), [id]),
        }
        assert_eq!(job(&*ledger, id).await.state, JobState::Cancelled, "way {way}");
        assert!(claim(&*ledger, at(1000)).await.is_none());
    }
}

pub(crate) async fn a_job_may_finish_although_it_was_cancelled(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let id = queue(&*ledger, at(0)).await;
    let lease = claim_of(&*ledger, id, at(1)).await;
    ledger.cancel_job(id, at(2)).await.unwrap();
    assert_eq!(complete(&*ledger, &lease, &[], at(3)).await.state, JobState::Succeeded);
}

pub(crate) async fn only_a_cancelled_job_ends_as_cancelled(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let id = queue(&*ledger, at(0)).await;
    let lease = claim_of(&*ledger, id, at(1)).await;
    let claimed = ledger.fail(id, &lease.token, None, false, true, at(2)).await;
    refused!(claimed, LedgerError::CancelNotRequested(job) if job == id);
    assert_eq!(job(&*ledger, id).await, lease.job);
}
