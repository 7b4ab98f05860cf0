//! Attempts: counted, bounded, repeated after a pause, or handed back.
use super::super::{FailureReason, JobState, LedgerError, NewJob, retry::backoff};
use super::Factory;
use super::fixture::*;

pub(crate) async fn the_fourth_claim_gets_nothing(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let deadly = queue(&*ledger, at(0)).await;
    for attempt in 1..=3 {
        let now = at(attempt * 1000);
        assert_eq!(claim_of(&*ledger, deadly, now).await.job.attempt, attempt as i32);
        assert_eq!(ledger.reap(now + 30_000_000).await.unwrap(), [deadly]);
    }
    let given_up = job(&*ledger, deadly).await;
    assert_eq!((given_up.state, given_up.attempt), (JobState::Failed, 3));
    assert_eq!(given_up.end_time, Some(at(3030)));
    let failure = given_up.failure.unwrap();
    assert_eq!(failure.reason, FailureReason::AttemptsExhausted);
    assert!(failure.message.contains("did not report"), "{}", failure.message);
    assert!(claim(&*ledger, at(9000)).await.is_none());
    let next = queue(&*ledger, at(9001)).await;
    claim_of(&*ledger, next, at(9002)).await;
}

/// The bound stands in the claim itself, whatever went wrong before.
pub(crate) async fn a_job_without_attempts_is_never_given_out(factory: &dyn Factory) {
    let ledger = factory.open().await;
    for _ in 0..2 {
        ledger
            .create_job(
                NewJob {
                    max_attempts: 0,
                    ..new_job()
                },
                at(0),
            )
            .await
            .unwrap();
    }
    let dead = ledger
        .create_job(
            NewJob {
                max_attempts: 0,
                ..new_job()
            },
            at(0),
        )
        .await
        .unwrap()
        .id;
    let next = queue(&*ledger, at(1)).await;
    claim_of(&*ledger, next, at(2)).await;
    let dead = job(&*ledger, dead).await;
    assert_eq!((dead.state, dead.attempt, dead.revision), (JobState::Failed, 0, 2));
    assert_eq!((dead.start_time, dead.end_time), (None, Some(at(2))));
    assert_eq!(dead.failure.unwrap().reason, FailureReason::AttemptsExhausted);
}

pub(crate) async fn a_failed_attempt_waits_before_the_next(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let flaky = queue(&*ledger, at(0)).await;
    let mut now = at(1);
    for attempt in 1..=2 {
        let lease = claim_of(&*ledger, flaky, now).await;
        let failed = ledger
            .fail(flaky, &lease.token, failure("out of memory"), true, false, now)
            .await
            .unwrap();
        assert_eq!((failed.state, failed.attempt), (JobState::Queued, attempt));
        assert_eq!(failed.run_after, Some(now + backoff(attempt)));
        assert_eq!(failed.failure, failure("out of memory"));
        now += backoff(attempt);
        assert!(claim(&*ledger, now - 1).await.is_none());
    }
    // One that was queued meanwhile goes first; the repeated one has taken its place behind it.
    let other = queue(&*ledger, now - 1).await;
    claim_of(&*ledger, other, now).await;
    let lease = claim_of(&*ledger, flaky, now).await;
    assert_eq!(
        (lease.job.run_after, lease.job.failure, lease.job.attempt),
        (None, None, 3)
    );
    let failed = ledger
        .fail(flaky, &lease.token, failure("again"), true, false, now)
        .await
        .unwrap();
    assert_eq!(
        (failed.state, failed.end_time, failed.run_after),
        (JobState::Failed, Some(now), None)
    );
    let last = failed.failure.unwrap();
    assert_eq!(last.reason, FailureReason::AttemptsExhausted);
    assert!(last.message.contains("again"), "{}", last.message);
}

pub(crate) async fn a_final_failure_is_not_repeated(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let hopeless = queue(&*ledger, at(0)).await;
    let lease = claim_of(&*ledger, hopeless, at(1)).await;
    let failed = ledger
        .fail(hopeless, &lease.token, failure("no such field"), false, false, at(2))
        .await
        .unwrap();
    assert_eq!(
        (failed.state, failed.failure),
        (JobState::Failed, failure("no such field"))
    );
    assert_eq!(failed.end_time, Some(at(2)));
    assert!(claim(&*ledger, at(9000)).await.is_none());
}

pub(crate) async fn a_failure_may_be_told_in_any_words(factory: &dyn Factory) {
    let ledger = factory.open().await;
    for retryable in [true, false] {
        let id = queue(&*ledger, at(0)).await;
        let lease = claim_of(&*ledger, id, at(1)).await;
        let words = failure("what was \0 read: \u{fffe} \u{1f600}\n");
        let failed = ledger
            .fail(id, &lease.token, words, retryable, false, at(2))
            .await
            .unwrap();
        let message = failed.failure.unwrap().message;
        assert!(message.contains(" read: \u{fffe} \u{1f600}\n"), "{message:?}");
    }
}

pub(crate) async fn a_released_job_is_not_charged_and_keeps_its_place(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let first = queue(&*ledger, at(0)).await;
    let second = queue(&*ledger, at(1)).await;
    // More often than there are attempts.
    for i in 0..5 {
        let lease = claim_of(&*ledger, first, at(10 + i)).await;
        assert_eq!(lease.job.attempt, 1);
        let released = ledger.release(first, &lease.token, at(10 + i)).await.unwrap();
        assert_eq!(
            (released.state, released.attempt, released.run_after),
            (JobState::Queued, 0, None)
        );
        assert_eq!(released.failure, None);
        assert!(is_lost(
            &ledger.report(first, &lease.token, None, LEASE, at(11 + i)).await
        ));
    }
    claim_of(&*ledger, first, at(20)).await;
    claim_of(&*ledger, second, at(20)).await;
}

pub(crate) async fn reports_extend_the_lease_and_carry_progress(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let id = queue(&*ledger, at(0)).await;
    let lease = claim_of(&*ledger, id, at(0)).await;
    let given = lease.job.revision;
    assert_eq!(given, 2);
    for i in 1..5 {
        let cancel = ledger.report(id, &lease.token, None, LEASE, at(i * 20)).await.unwrap();
        assert!(!cancel);
        assert_eq!(ledger.reap(at(i * 20 + 29)).await.unwrap(), NONE);
    }
    assert_eq!(
        job(&*ledger, id).await.revision,
        given,
        "a heartbeat without news is no change"
    );
    for _ in 0..2 {
        ledger
            .report(id, &lease.token, Some(progress(5)), LEASE, at(90))
            .await
            .unwrap();
        let row = job(&*ledger, id).await;
        assert_eq!(
            (row.progress, row.revision, row.update_time),
            (Some(progress(5)), given + 1, at(90))
        );
    }
    // Progress stays after the end, and begins anew with an attempt.
    ledger
        .fail(id, &lease.token, failure("x"), true, false, at(95))
        .await
        .unwrap();
    assert_eq!(job(&*ledger, id).await.progress, Some(progress(5)));
    assert_eq!(claim_of(&*ledger, id, at(200)).await.job.progress, None);
}

pub(crate) async fn leases_outlast_the_absence_of_the_server(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let (one, two) = (queue(&*ledger, at(0)).await, queue(&*ledger, at(1)).await);
    let lost = claim_of(&*ledger, one, at(10)).await;
    let alive = claim_of(&*ledger, two, at(10)).await;
    let before = [job(&*ledger, one).await, job(&*ledger, two).await];
    drop(ledger);

    let ledger = factory.open().await;
    ledger.renew_leases(LEASE, at(1000)).await.unwrap();
    // Nothing that anybody watches has changed, and a lease never gets shorter.
    assert_eq!([job(&*ledger, one).await, job(&*ledger, two).await], before);
    ledger.renew_leases(LEASE, at(500)).await.unwrap();
    assert_eq!(ledger.reap(at(1029)).await.unwrap(), NONE);
    // Who is there reports; who is not is missed one lease later.
    ledger.report(two, &alive.token, None, LEASE, at(1020)).await.unwrap();
    assert_eq!(ledger.reap(at(1030)).await.unwrap(), [one]);
    assert!(is_lost(&ledger.report(one, &lost.token, None, LEASE, at(1031)).await));
    complete(&*ledger, &alive, &[], at(1031)).await;
}

pub(crate) async fn expired_leases_are_ended_once(factory: &dyn Factory) {
    let ledgers = factory.open_several(4).await;
    let mut ids = Vec::new();
    for i in 0..40 {
        ids.push(queue(&*ledgers[0], at(i)).await);
        claim_of(&*ledgers[0], ids[i as usize], at(100)).await;
    }
    // The last one reports in time.
    let last = queue(&*ledgers[0], at(40)).await;
    let healthy = claim_of(&*ledgers[0], last, at(120)).await;
    let tasks = ledgers.iter().cloned().map(|ledger| {
        tokio::spawn(async move {
            let mut ended = ledger.reap(at(130)).await.unwrap();
            ended.extend(ledger.reap(at(130)).await.unwrap());
            ended
        })
    });
    let mut ended = Vec::new();
    for task in tasks.collect::<Vec<_>>() {
        ended.extend(task.await.unwrap());
    }
    ended.sort();
    assert_eq!(ended, ids);
    for id in ids {
        let row = job(&*ledgers[1], id).await;
        assert_eq!((row.state, row.attempt, row.revision), (JobState::Queued, 1, 3));
    }
    complete(&*ledgers[2], &healthy, &[], at(131)).await;
}

pub(crate) async fn a_lost_worker_is_noticed(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let id = queue(&*ledger, at(0)).await;
    let other = queue(&*ledger, at(1)).await;
    claim_of(&*ledger, id, at(10)).await;
    let healthy = claim_of(&*ledger, other, at(20)).await;
    assert_eq!(ledger.reap(at(39)).await.unwrap(), NONE);
    assert_eq!(ledger.reap(at(40)).await.unwrap(), [id]);
    assert_eq!(ledger.reap(at(40)).await.unwrap(), NONE);
    let row = job(&*ledger, id).await;
    assert_eq!((row.state, row.run_after), (JobState::Queued, Some(at(42))));
    let failure = row.failure.unwrap();
    assert_eq!(failure.reason, FailureReason::WorkerLost);
    assert!(failure.message.contains("worker-1"), "{}", failure.message);
    // Late, but nobody has missed it yet.
    refused!(
        ledger.fail(other, "x", None, true, false, at(55)).await,
        LedgerError::LeaseLost(_)
    );
    complete(&*ledger, &healthy, &[], at(55)).await;
}
