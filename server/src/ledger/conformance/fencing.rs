//! Nobody writes but the attempt that has the job.
use uuid::Uuid;

use super::super::{JobKind, JobState, Lease, Ledger, LedgerError, Origin};
use super::Factory;
use super::fixture::*;

/// Tries everything that a worker can write, and sees that all of it is refused and nothing changed.
async fn all_refused(ledger: &dyn Ledger, zombie: &Lease, written: &[Uuid], now: i64) {
    let (id, token) = (zombie.job.id, zombie.token.as_str());
    let before = job(ledger, id).await;
    assert!(is_lost(&ledger.leased_job(id, token).await));
    assert!(is_lost(&ledger.report(id, token, Some(progress(66)), LEASE, now).await));
    assert!(is_lost(&ledger.complete(id, token, completion(66, &[]), now).await));
    assert!(is_lost(&ledger.complete(id, token, completion(66, written), now).await));
    for (retryable, cancelled) in [(true, false), (false, false), (false, true)] {
        assert!(is_lost(
            &ledger
                .fail(id, token, failure("zombie"), retryable, cancelled, now)
                .await
        ));
    }
    assert!(is_lost(&ledger.release(id, token, now).await));
    let origin = Origin::Output {
        job: id,
        token: token.into(),
    };
    assert!(is_lost(&ledger.create_artifact(new_artifact(origin, false), now).await));
    for artifact in written {
        let state = ledger.get_any_artifact(*artifact).await.unwrap().unwrap().state;
        assert!(is_lost(&ledger.artifact_ready(*artifact, Some(token), now).await));
        refused!(
            ledger.artifact_ready(*artifact, None, now).await,
            LedgerError::LeaseLost(_)
        );
        assert_eq!(ledger.get_any_artifact(*artifact).await.unwrap().unwrap().state, state);
        assert!(!visible(ledger, *artifact).await);
    }
    assert_eq!(job(ledger, id).await, before);
}

pub(crate) async fn tokens_differ_and_are_the_only_key(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let (one, two) = (queue(&*ledger, at(0)).await, queue(&*ledger, at(1)).await);
    let (first, second) = (
        claim_of(&*ledger, one, at(2)).await,
        claim_of(&*ledger, two, at(2)).await,
    );
    assert!(first.token.len() >= 32);
    assert!(!format!("{first:?}").contains(&first.token));
    assert_ne!(first.token, second.token);
    // The token of another job, a wrong one and none at all.
    for token in [second.token.as_str(), "", "0123456789abcdef"] {
        assert!(is_lost(&ledger.complete(one, token, completion(1, &[]), at(3)).await));
        assert!(is_lost(&ledger.leased_job(one, token).await));
    }
    assert_eq!(ledger.leased_job(one, &first.token).await.unwrap().id, one);
}

pub(crate) async fn a_reaped_zombie_can_write_nothing(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let id = queue(&*ledger, at(0)).await;
    let zombie = claim_of(&*ledger, id, at(0)).await;
    let stored = output(&*ledger, &zombie, false, at(1)).await;
    let pending = pending_output(&*ledger, &zombie, false, at(1)).await;
    ledger.reap(at(30)).await.unwrap();
    all_refused(&*ledger, &zombie, &[stored, pending], at(31)).await;
}

pub(crate) async fn a_zombie_can_not_disturb_its_successor(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let id = queue(&*ledger, at(0)).await;
    let zombie = claim_of(&*ledger, id, at(0)).await;
    let stale = output(&*ledger, &zombie, false, at(1)).await;
    let pending = pending_output(&*ledger, &zombie, false, at(1)).await;
    ledger.reap(at(30)).await.unwrap();
    let successor = claim_of(&*ledger, id, at(40)).await;
    assert_ne!(successor.token, zombie.token);
    all_refused(&*ledger, &zombie, &[stale, pending], at(41)).await;

    // The successor can't publish what the zombie wrote, either.
    for left in [stale, pending] {
        let theft = ledger.complete(id, &successor.token, completion(1, &[left]), at(42));
        refused!(theft.await, LedgerError::NotAnOutput(artifact) if artifact == left);
        let theft = ledger.artifact_ready(left, Some(&successor.token), at(42)).await;
        refused!(theft, LedgerError::NotAnOutput(artifact) if artifact == left);
    }
    let good = output(&*ledger, &successor, false, at(43)).await;
    let done = complete(&*ledger, &successor, &[good], at(44)).await;
    assert_eq!(
        (done.state, done.result),
        (JobState::Succeeded, Some(result_of(JobKind::Embed, 9)))
    );
    all_refused(&*ledger, &zombie, &[stale, pending], at(45)).await;
    // Not even what its successor said.
    let echo = ledger.complete(id, &zombie.token, completion(9, &[good]), at(46)).await;
    assert!(is_lost(&echo));
    assert!(visible(&*ledger, good).await);
}

pub(crate) async fn a_completion_may_be_said_again(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let id = queue(&*ledger, at(0)).await;
    let lease = claim_of(&*ledger, id, at(1)).await;
    let scene = output(&*ledger, &lease, false, at(2)).await;
    let done = complete(&*ledger, &lease, &[scene], at(3)).await;
    drop(ledger);

    // However late, and after a restart.
    let ledger = factory.open().await;
    let again = complete(&*ledger, &lease, &[scene], at(1000)).await;
    assert_eq!(again, done);
    assert_eq!(job(&*ledger, id).await, done);
    assert!(visible(&*ledger, scene).await);
    // Something else, or somebody else, is refused.
    for (token, said) in [(lease.token.as_str(), 8), ("0123456789abcdef", 9), ("", 9)] {
        let refused = ledger.complete(id, token, completion(said, &[scene]), at(1001)).await;
        assert!(is_lost(&refused), "{token} {said}");
    }
    assert_eq!(job(&*ledger, id).await, done);
}

pub(crate) async fn a_finished_job_takes_nothing_more(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let id = queue(&*ledger, at(0)).await;
    let lease = claim_of(&*ledger, id, at(1)).await;
    complete(&*ledger, &lease, &[], at(2)).await;
    all_refused(&*ledger, &lease, &[], at(3)).await;

    let id = queue(&*ledger, at(4)).await;
    let lease = claim_of(&*ledger, id, at(5)).await;
    ledger
        .fail(id, &lease.token, failure("bad"), false, false, at(6))
        .await
        .unwrap();
    all_refused(&*ledger, &lease, &[], at(7)).await;
    assert_eq!(ledger.reap(at(1000)).await.unwrap(), NONE);
}

pub(crate) async fn unknown_things_are_not_found(factory: &dyn Factory) {
    let ledger = factory.open().await;
    ledger.check().await.unwrap();
    let id = Uuid::now_v7();
    assert_eq!(ledger.get_job(id).await.unwrap(), None);
    assert_eq!(ledger.get_any_artifact(id).await.unwrap(), None);
    assert_eq!(ledger.get_key(id).await.unwrap(), None);
    refused!(
        ledger.cancel_job(id, at(0)).await,
        LedgerError::NotFound { kind: "job", .. }
    );
    refused!(
        ledger.leased_job(id, "x").await,
        LedgerError::NotFound { kind: "job", .. }
    );
    refused!(
        ledger.report(id, "x", None, LEASE, at(0)).await,
        LedgerError::NotFound { kind: "job", .. }
    );
    refused!(
        ledger.release(id, "x", at(0)).await,
        LedgerError::NotFound { kind: "job", .. }
    );
    let origin = Origin::Output {
        job: id,
        token: "x".into(),
    };
    refused!(
        ledger.create_artifact(new_artifact(origin, false), at(0)).await,
        LedgerError::NotFound { kind: "job", .. }
    );
    refused!(
        ledger.artifact_ready(id, None, at(0)).await,
        LedgerError::NotFound { kind: "artifact", .. }
    );
    refused!(
        ledger.delete_artifact(id, at(0)).await,
        LedgerError::NotFound { kind: "artifact", .. }
    );
    ledger.forget_artifact(id).await.unwrap();
}
