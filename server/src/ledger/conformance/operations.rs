//! What operators ask: counts, attempts and their ends, and another try for a job that failed.
use super::super::{
    Failure, FailureReason, JobKind, JobState, LedgerError, NewJob, Outcome, ResourceRequirements, Running, Tally,
    Waiting,
};
use super::Factory;
use super::fixture::*;

/// Number, outcome, and the reason of each attempt, newest first.
async fn outcomes(ledger: &dyn super::Ledger, id: super::super::JobId) -> Vec<(i32, Outcome, Option<FailureReason>)> {
    let attempts = ledger.attempts(id).await.unwrap();
    let each = attempts
        .into_iter()
        .map(|a| (a.number, a.outcome, a.failure.map(|failure| failure.reason)));
    each.collect()
}

pub(crate) async fn every_attempt_is_kept_with_its_end(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let id = queue(&*ledger, at(0)).await;
    assert_eq!(ledger.attempts(id).await.unwrap(), []);

    let lease = claim_of(&*ledger, id, at(1)).await;
    let attempts = ledger.attempts(id).await.unwrap();
    assert_eq!(attempts.len(), 1);
    assert_eq!(
        (
            attempts[0].worker.as_str(),
            attempts[0].start_time,
            attempts[0].end_time
        ),
        ("worker-1", at(1), None)
    );
    assert_eq!(attempts[0].outcome, Outcome::UnderWay);
    ledger.release(id, &lease.token, at(2)).await.unwrap();
    // A report is no end.
    let lease = claim_of(&*ledger, id, at(3)).await;
    ledger
        .report(id, &lease.token, Some(progress(1)), LEASE, at(4))
        .await
        .unwrap();
    let failed = ledger.fail(id, &lease.token, failure("out of memory"), true, false, at(5));
    failed.await.unwrap();
    claim_of(&*ledger, id, at(10)).await;
    ledger.reap(at(1000)).await.unwrap();
    let lease = claim_of(&*ledger, id, at(2000)).await;
    complete(&*ledger, &lease, &[], at(2001)).await;

    assert_eq!(
        outcomes(&*ledger, id).await,
        [
            (4, Outcome::Succeeded, None),
            (3, Outcome::Failed, Some(FailureReason::WorkerLost)),
            (2, Outcome::Failed, Some(FailureReason::Internal)),
            (1, Outcome::Released, None),
        ]
    );
    let attempts = ledger.attempts(id).await.unwrap();
    assert_eq!(attempts[2].end_time, Some(at(5)));
    let told = Failure {
        reason: FailureReason::Internal,
        message: "out of memory".into(),
    };
    assert_eq!(attempts[2].failure, Some(told));
    assert_eq!(attempts[1].end_time, Some(at(1000)));
    // And after the ledger was closed and opened.
    let before = attempts;
    drop(ledger);
    assert_eq!(factory.open().await.attempts(id).await.unwrap(), before);
}

pub(crate) async fn the_newest_twenty_attempts_are_kept(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let id = queue(&*ledger, at(0)).await;
    for i in 0..23 {
        let lease = claim_of(&*ledger, id, at(i)).await;
        ledger.release(id, &lease.token, at(i)).await.unwrap();
    }
    let lease = claim_of(&*ledger, id, at(30)).await;
    ledger.cancel_job(id, at(31)).await.unwrap();
    ledger.fail(id, &lease.token, None, false, true, at(32)).await.unwrap();
    let kept = outcomes(&*ledger, id).await;
    assert_eq!(kept.len(), 20);
    assert_eq!(kept[0], (24, Outcome::Cancelled, None));
    assert_eq!(kept[19], (5, Outcome::Released, None));
}

/// A job that was given up, with an input.
async fn given_up(ledger: &dyn super::Ledger) -> (super::super::JobId, uuid::Uuid) {
    let input = upload(ledger, at(0)).await;
    let new = NewJob {
        inputs: vec![input],
        max_attempts: 1,
        ..new_job()
    };
    let id = ledger.create_job(new, at(1)).await.unwrap().id;
    let lease = claim_of(ledger, id, at(2)).await;
    let failed = ledger.fail(id, &lease.token, failure("out of memory"), true, false, at(3));
    let job = failed.await.unwrap();
    assert_eq!(job.state, JobState::Failed);
    assert_eq!(job.failure.unwrap().reason, FailureReason::AttemptsExhausted);
    (id, input)
}

pub(crate) async fn a_failed_job_is_queued_once_more(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let (id, input) = given_up(&*ledger).await;
    let before = job(&*ledger, id).await;
    let other = queue(&*ledger, at(4)).await;

    let queued = ledger.requeue(id, &[input], at(5)).await.unwrap();
    assert_eq!((queued.state, queued.attempt), (JobState::Queued, 0));
    assert_eq!((queued.failure, queued.end_time, queued.run_after), (None, None, None));
    assert_eq!(
        (queued.create_time, queued.revision),
        (before.create_time, before.revision + 1)
    );
    // It is nobody's second time now.
    refused!(ledger.requeue(id, &[input], at(6)).await, LedgerError::NotFailed(_));
    // It waits behind those that were there, and its input is needed again.
    refused!(ledger.delete_artifact(input, at(6)).await, LedgerError::InUse { .. });
    claim_of(&*ledger, other, at(7)).await;
    let lease = claim_of(&*ledger, id, at(7)).await;
    assert_eq!(lease.job.attempt, 1);
    complete(&*ledger, &lease, &[], at(8)).await;
    assert_eq!(
        outcomes(&*ledger, id).await,
        [
            (2, Outcome::Succeeded, None),
            (1, Outcome::Failed, Some(FailureReason::AttemptsExhausted))
        ]
    );
    refused!(ledger.requeue(id, &[input], at(9)).await, LedgerError::NotFailed(_));
}

pub(crate) async fn what_is_queued_once_more_needs_its_inputs(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let (id, input) = given_up(&*ledger).await;
    ledger.delete_artifact(input, at(4)).await.unwrap();
    refused!(
        ledger.requeue(id, &[input], at(5)).await,
        LedgerError::NotFound { kind: "artifact", .. }
    );
    ledger.forget_artifact(input).await.unwrap();
    refused!(
        ledger.requeue(id, &[input], at(5)).await,
        LedgerError::NotFound { kind: "artifact", .. }
    );
    assert_eq!(job(&*ledger, id).await.state, JobState::Failed);
    let nobody = uuid::Uuid::now_v7();
    refused!(
        ledger.requeue(nobody, &[], at(5)).await,
        LedgerError::NotFound { kind: "job", .. }
    );
}

pub(crate) async fn jobs_are_counted_by_kind_state_and_reason(factory: &dyn Factory) {
    let ledger = factory.open().await;
    assert_eq!(ledger.tally().await.unwrap(), Tally::default());
    let (failed, _) = given_up(&*ledger).await;
    let verify = |id| NewJob {
        id,
        spec: spec_of(JobKind::Verify),
        ..new_job()
    };
    let refused_one = uuid::Uuid::now_v7();
    ledger.create_job(verify(refused_one), at(10)).await.unwrap();
    let lease = claim_of(&*ledger, refused_one, at(11)).await;
    let no_retry = ledger.fail(refused_one, &lease.token, failure("no scene"), false, false, at(12));
    no_retry.await.unwrap();
    // What its scene will probably take counts, and else what it takes at least; sums do not overflow.
    let sizes = [
        (None, None),
        (Some(1), Some(2_000_000)),
        (Some(1_000_000), None),
        (Some(i64::MAX), Some(i64::MAX)),
    ];
    let mut memory = Vec::new();
    for (least, likely) in sizes {
        let running = NewJob {
            requirements: ResourceRequirements {
                memory: least,
                likely_memory: likely,
                clip: None,
            },
            ..new_job()
        };
        let id = running.id;
        ledger.create_job(running, at(20)).await.unwrap();
        claim_of(&*ledger, id, at(21)).await;
        memory.push(ledger.tally().await.unwrap().running[0].memory);
    }
    assert_eq!(memory[..3], [0, 2_000_000, 3_000_000]);
    assert_eq!(memory[3], i64::MAX as u64);
    queue(&*ledger, at(30)).await;
    queue(&*ledger, at(31)).await;
    ledger.create_job(verify(uuid::Uuid::now_v7()), at(32)).await.unwrap();

    let mut tally = ledger.tally().await.unwrap();
    tally.queued.sort_by_key(|waiting| waiting.kind as i32);
    tally.failed.sort_by_key(|&(kind, ..)| kind as i32);
    let waiting = |kind, count, since| Waiting { kind, count, since };
    assert_eq!(
        tally,
        Tally {
            queued: vec![waiting(JobKind::Embed, 2, at(30)), waiting(JobKind::Verify, 1, at(32))],
            running: vec![Running {
                kind: JobKind::Embed,
                count: 4,
                memory: memory[3],
            }],
            failed: vec![
                (JobKind::Embed, FailureReason::AttemptsExhausted, 1),
                (JobKind::Verify, FailureReason::Internal, 1)
            ],
        }
    );

    let list = async |reasons: &'static [FailureReason], before, limit| {
        let jobs = ledger.list_failed(OURS, reasons, before, limit).await.unwrap();
        jobs.into_iter().map(|job| job.id).collect::<Vec<_>>()
    };
    assert_eq!(
        list(&[FailureReason::AttemptsExhausted, FailureReason::Internal], None, 9).await,
        [refused_one, failed]
    );
    assert_eq!(list(&[FailureReason::AttemptsExhausted], None, 9).await, [failed]);
    assert_eq!(list(&[FailureReason::Internal], None, 9).await, [refused_one]);
    assert_eq!(
        list(&[FailureReason::InvalidInput, FailureReason::TargetMissed], None, 9).await,
        NONE
    );
    assert_eq!(
        list(&[FailureReason::Internal, FailureReason::AttemptsExhausted], None, 1).await,
        [refused_one]
    );
    let first = job(&*ledger, refused_one).await;
    assert_eq!(
        list(
            &[FailureReason::Internal, FailureReason::AttemptsExhausted],
            Some((first.create_time, first.id)),
            9
        )
        .await,
        [failed]
    );
    assert_eq!(
        ledger
            .list_failed(
                "other",
                &[FailureReason::Internal, FailureReason::AttemptsExhausted],
                None,
                9
            )
            .await
            .unwrap(),
        Vec::new()
    );
}

pub(crate) async fn a_job_keeps_the_trace_it_is_a_part_of(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let parent = Some("00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01".to_owned());
    let new = NewJob {
        trace_parent: parent.clone(),
        ..new_job()
    };
    let id = ledger.create_job(new, at(0)).await.unwrap().id;
    assert_eq!(claim_of(&*ledger, id, at(1)).await.job.trace_parent, parent);
    let untraced = queue(&*ledger, at(2)).await;
    assert_eq!(job(&*ledger, untraced).await.trace_parent, None);
}
