//! What jobs make: seen when the job is complete, and not before.
use uuid::Uuid;

use super::super::{Completion, JobId, JobKind, JobState, KeyRow, KeyState, Ledger, LedgerError, NewJob, NewKey};
use super::Factory;
use super::fixture::*;

pub(crate) async fn outputs_are_published_by_completion_only(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let id = queue(&*ledger, at(0)).await;
    let lease = claim_of(&*ledger, id, at(1)).await;
    let (named, unnamed) = (
        output(&*ledger, &lease, false, at(2)).await,
        output(&*ledger, &lease, false, at(2)).await,
    );
    assert!(!visible(&*ledger, named).await);
    let row = complete(&*ledger, &lease, &[named], at(3)).await;
    assert_eq!(
        (row.state, row.result, row.end_time),
        (JobState::Succeeded, Some(result_of(JobKind::Embed, 9)), Some(at(3)))
    );
    assert_eq!(ledger.get_artifact(named).await.unwrap().unwrap().job, Some(id));
    assert!(!visible(&*ledger, unnamed).await);
    // A published output can be the input of another job.
    let next = NewJob {
        spec: spec_of(JobKind::Verify),
        inputs: vec![named],
        ..new_job()
    };
    ledger.create_job(next, at(4)).await.unwrap();
    refused!(ledger.delete_artifact(named, at(5)).await, LedgerError::InUse { .. });
}

pub(crate) async fn completion_publishes_all_or_nothing(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let (id, other) = (queue(&*ledger, at(0)).await, queue(&*ledger, at(1)).await);
    let lease = claim_of(&*ledger, id, at(1)).await;
    let good = output(&*ledger, &lease, false, at(2)).await;
    let unfinished = pending_output(&*ledger, &lease, false, at(2)).await;
    let secret = output(&*ledger, &lease, true, at(2)).await;
    let of_other = output(&*ledger, &claim_of(&*ledger, other, at(2)).await, false, at(2)).await;
    let uploaded = upload(&*ledger, at(2)).await;
    for wrong in [unfinished, secret, of_other, uploaded, Uuid::now_v7()] {
        let done = ledger
            .complete(id, &lease.token, completion(9, &[good, wrong]), at(3))
            .await;
        refused!(done, LedgerError::NotAnOutput(artifact) if artifact == wrong);
        assert!(!visible(&*ledger, good).await);
        assert_eq!(job(&*ledger, id).await, lease.job);
    }
    complete(&*ledger, &lease, &[good], at(4)).await;
    assert!(visible(&*ledger, good).await);
    assert!(!visible(&*ledger, secret).await);
}

fn new_key(artifact: Uuid) -> NewKey {
    NewKey {
        id: Uuid::now_v7(),
        display_name: "house key".into(),
        bits: 48,
        clip: "tower".into(),
        clip_sha256: "cd".repeat(32),
        seeded: true,
        artifact,
    }
}

fn with_key(key: &NewKey) -> Completion {
    Completion {
        key: Some(key.clone()),
        result: result_of(JobKind::CreateKey, 9),
        ..completion(9, &[])
    }
}

/// Has a job make a key.
pub(super) async fn make_key(ledger: &dyn Ledger, now: i64) -> (JobId, NewKey) {
    make_key_of(ledger, 48, now).await
}

/// Has a job make a key of so many bits.
pub(super) async fn make_key_of(ledger: &dyn Ledger, bits: u32, now: i64) -> (JobId, NewKey) {
    let id = ledger
        .create_job(
            NewJob {
                spec: spec_of(JobKind::CreateKey),
                ..new_job()
            },
            now,
        )
        .await
        .unwrap()
        .id;
    let lease = claim_of(ledger, id, now).await;
    let key = NewKey {
        bits,
        ..new_key(output(ledger, &lease, true, now).await)
    };
    ledger.complete(id, &lease.token, with_key(&key), now).await.unwrap();
    // A worker that did not hear the answer says it again, for which the server thinks of another name.
    let again = NewKey {
        id: Uuid::now_v7(),
        ..key.clone()
    };
    let said_again = ledger.complete(id, &lease.token, with_key(&again), now).await.unwrap();
    assert_eq!(said_again.state, JobState::Succeeded);
    assert_eq!(ledger.get_key(again.id).await.unwrap(), None);
    (id, key)
}

pub(crate) async fn keys_are_published_and_their_files_never(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let making = NewJob {
        spec: spec_of(JobKind::CreateKey),
        ..new_job()
    };
    let id = ledger.create_job(making, at(0)).await.unwrap().id;
    let lease = claim_of(&*ledger, id, at(0)).await;
    // And nothing else than a key comes out of making one.
    let mixed_up = ledger.complete(id, &lease.token, completion(9, &[]), at(0)).await;
    refused!(mixed_up, LedgerError::ResultOfAnotherKind(job) if job == id);
    let open = new_key(output(&*ledger, &lease, false, at(0)).await);
    let done = ledger.complete(id, &lease.token, with_key(&open), at(1)).await;
    refused!(done, LedgerError::NotAnOutput(artifact) if artifact == open.artifact);
    assert_eq!(ledger.get_key(open.id).await.unwrap(), None);

    let (job, key) = make_key(&*ledger, at(2)).await;
    let expected = KeyRow {
        project: OURS.into(),
        id: key.id,
        display_name: "house key".into(),
        bits: 48,
        clip: "tower".into(),
        clip_sha256: "cd".repeat(32),
        seeded: true,
        create_time: at(2),
        job,
        artifact: key.artifact,
        state: KeyState::Active,
        state_reason: String::new(),
        state_time: None,
    };
    assert_eq!(ledger.get_key(key.id).await.unwrap(), Some(expected));
    assert!(!visible(&*ledger, key.artifact).await);
    assert!(ledger.get_any_artifact(key.artifact).await.unwrap().unwrap().secret);
    refused!(
        ledger.delete_artifact(key.artifact, at(3)).await,
        LedgerError::NotFound { .. }
    );
    ledger.forget_artifact(key.artifact).await.unwrap();
    assert!(ledger.get_any_artifact(key.artifact).await.unwrap().is_some());
    assert_eq!(ledger.abandoned_artifacts(at(100), 10).await.unwrap(), []);
    ledger
        .create_job(
            NewJob {
                key: Some(key.id),
                ..new_job()
            },
            at(4),
        )
        .await
        .unwrap();
}

pub(crate) async fn keys_come_in_pages(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let mut expected = Vec::new();
    for i in 0..7 {
        expected.insert(0, make_key(&*ledger, at(i / 3)).await.1.id);
    }
    let mut seen = Vec::new();
    let mut before = None;
    loop {
        let page = ledger.list_keys(OURS, before, 2).await.unwrap();
        let Some(last) = page.last() else { break };
        before = Some((last.create_time, last.id));
        seen.extend(page.iter().map(|key| key.id));
    }
    assert_eq!(seen, expected);
}
