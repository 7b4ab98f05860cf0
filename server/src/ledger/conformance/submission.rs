//! Making jobs, and looking at them.
use std::collections::HashSet;

use uuid::Uuid;

use super::super::{JobKind, JobRow, JobState, LedgerError, NewJob, ResourceRequirements};
use super::Factory;
use super::fixture::*;

pub(crate) async fn a_job_is_kept_as_it_was_given(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let input = upload(&*ledger, at(0)).await;
    let new = NewJob {
        display_name: "räumlich, \u{1f600}".into(),
        spec: spec_of(JobKind::Verify),
        inputs: vec![input, input],
        priority: -10,
        requirements: ResourceRequirements {
            memory: Some(1),
            likely_memory: Some(i64::MAX),
            clip: Some("ab".repeat(32)),
        },
        ..new_job()
    };
    let made = ledger.create_job(new.clone(), at(1)).await.unwrap();
    let expected = JobRow {
        project: OURS.into(),
        id: new.id,
        display_name: new.display_name,
        spec: new.spec,
        priority: -10,
        requirements: new.requirements,
        state: JobState::Queued,
        cancel_requested: false,
        attempt: 0,
        max_attempts: 3,
        progress: None,
        result: None,
        failure: None,
        create_time: at(1),
        update_time: at(1),
        start_time: None,
        end_time: None,
        run_after: None,
        revision: 1,
        trace_parent: None,
        queue_position: Some(0),
    };
    assert_eq!(made, expected);
    assert_eq!(job(&*ledger, new.id).await, expected);
}

pub(crate) async fn the_same_request_is_the_same_job(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let id = Uuid::new_v4();
    let request = Some(id);
    let first = NewJob {
        request_id: request,
        ..new_job()
    };
    assert_eq!(ledger.find_request(id).await.unwrap(), None);
    let made = ledger.create_job(first, at(0)).await.unwrap();
    let again = NewJob {
        request_id: request,
        ..new_job()
    };
    assert_eq!(ledger.create_job(again.clone(), at(5)).await.unwrap(), made);

    let other = NewJob {
        spec: spec(321),
        fingerprint: [8; 32],
        ..again.clone()
    };
    refused!(ledger.create_job(other, at(6)).await, LedgerError::RequestIdReused(id) if Some(id) == request);

    // However far the job has come, and whatever became of what it needed.
    let lease = claim_of(&*ledger, made.id, at(7)).await;
    complete(&*ledger, &lease, &[], at(8)).await;
    let late = ledger
        .create_job(
            NewJob {
                inputs: vec![Uuid::new_v4()],
                ..again
            },
            at(9),
        )
        .await
        .unwrap();
    assert_eq!((late.id, late.state), (made.id, JobState::Succeeded));
    let found = ledger.find_request(id).await.unwrap().unwrap();
    assert_eq!((found.id, found.state), (made.id, JobState::Succeeded));
    assert_eq!(ledger.list_jobs(OURS, &[], None, 10).await.unwrap().len(), 1);
}

pub(crate) async fn a_request_is_the_same_if_its_artifacts_hold_the_same(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let first = NewJob {
        request_id: Some(Uuid::new_v4()),
        ..new_job()
    };
    let made = ledger.create_job(first.clone(), at(0)).await.unwrap();
    let again = |change: fn(&mut NewJob)| {
        let mut new = NewJob {
            id: Uuid::now_v7(),
            ..first.clone()
        };
        change(&mut new);
        ledger.create_job(new, at(1))
    };
    // Other names for the same content; the same names, but nobody knows any more what they stood for.
    let renamed = again(|new| new.spec = spec(4)).await.unwrap();
    let gone = again(|new| new.fingerprint = [8; 32]).await.unwrap();
    assert_eq!([renamed.id, gone.id], [made.id; 2]);
    assert_eq!(renamed.spec, first.spec);
    for other in [
        again(|new| (new.spec, new.fingerprint) = (spec(4), [8; 32])),
        again(|new| (new.spec, new.fingerprint) = (spec_of(JobKind::Verify), [8; 32])),
        again(|new| (new.display_name, new.fingerprint) = ("another".into(), [8; 32])),
    ] {
        refused!(other.await, LedgerError::RequestIdReused(id) if Some(id) == first.request_id);
    }
}

pub(crate) async fn one_request_sent_many_times_at_once_is_one_job(factory: &dyn Factory) {
    let ledgers = factory.open_several(4).await;
    let request = Some(Uuid::new_v4());
    let tasks: Vec<_> = (0..20)
        .map(|i| {
            let ledger = ledgers[i % 4].clone();
            let new = NewJob {
                request_id: request,
                ..new_job()
            };
            tokio::spawn(async move { ledger.create_job(new, at(0)).await.unwrap().id })
        })
        .collect();
    let mut jobs = HashSet::new();
    for task in tasks {
        jobs.insert(task.await.unwrap());
    }
    assert_eq!(jobs.len(), 1);
    assert_eq!(ledgers[0].queue_depth().await.unwrap(), 1);
}

pub(crate) async fn what_a_job_needs_must_be_there(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let nowhere = Uuid::new_v4();
    let unfinished = ledger
        .create_artifact(new_artifact(by_us(), false), at(0))
        .await
        .unwrap()
        .id;
    let deleted = upload(&*ledger, at(0)).await;
    ledger.delete_artifact(deleted, at(0)).await.unwrap();
    let secret = ledger
        .create_artifact(new_artifact(by_us(), true), at(0))
        .await
        .unwrap()
        .id;
    ledger.artifact_ready(secret, None, at(0)).await.unwrap();
    let there = upload(&*ledger, at(0)).await;

    for missing in [nowhere, unfinished, deleted, secret] {
        let new = NewJob {
            inputs: vec![there, missing],
            ..new_job()
        };
        refused!(ledger.create_job(new, at(1)).await, LedgerError::NotFound { kind: "artifact", id } if id == missing);
    }
    let new = NewJob {
        key: Some(nowhere),
        ..new_job()
    };
    refused!(ledger.create_job(new, at(1)).await, LedgerError::NotFound { kind: "key", id } if id == nowhere);
    assert_eq!(ledger.list_jobs(OURS, &[], None, 10).await.unwrap(), []);
}

pub(crate) async fn acknowledged_work_survives(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let input = upload(&*ledger, at(0)).await;
    let queued = ledger
        .create_job(
            NewJob {
                inputs: vec![input],
                ..new_job()
            },
            at(1),
        )
        .await
        .unwrap();
    let running = queue(&*ledger, at(0)).await;
    let lease = claim_of(&*ledger, running, at(2)).await;
    let before = job(&*ledger, running).await;
    drop(ledger);

    let ledger = factory.open().await;
    assert_eq!(job(&*ledger, queued.id).await, queued);
    assert_eq!(job(&*ledger, running).await, before);
    refused!(ledger.delete_artifact(input, at(3)).await, LedgerError::InUse { .. });
    // The worker never knew.
    complete(&*ledger, &lease, &[], at(4)).await;
}

pub(crate) async fn pages_have_no_gaps_or_repeats_while_jobs_are_added(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let mut there = Vec::new();
    for i in 0..25 {
        // Several at the same instant.
        there.push(queue(&*ledger, at(i / 4)).await);
    }
    let mut seen = Vec::new();
    let mut before = None;
    loop {
        let page = ledger.list_jobs(OURS, &[], before, 4).await.unwrap();
        let Some(last) = page.last() else { break };
        assert!(page.len() <= 4);
        before = Some((last.create_time, last.id));
        seen.extend(page.iter().map(|job| job.id));
        queue(&*ledger, at(100)).await;
    }
    there.reverse();
    assert_eq!(seen, there);
}

pub(crate) async fn states_select_jobs(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let mut ids = Vec::new();
    for i in 0..5 {
        ids.push(queue(&*ledger, at(i)).await);
    }
    let done = claim_of(&*ledger, ids[0], at(10)).await;
    complete(&*ledger, &done, &[], at(11)).await;
    claim_of(&*ledger, ids[1], at(12)).await;
    ledger.cancel_job(ids[2], at(13)).await.unwrap();
    let list = async |states: &[JobState], before, limit| {
        let jobs = ledger.list_jobs(OURS, states, before, limit).await.unwrap();
        jobs.into_iter().map(|job| job.id).collect::<Vec<_>>()
    };
    assert_eq!(list(&[JobState::Queued], None, 10).await, [ids[4], ids[3]]);
    assert!(list(&[JobState::Failed], None, 10).await.is_empty());
    let over = [
        JobState::Succeeded,
        JobState::Cancelled,
        JobState::Running,
        JobState::Running,
    ];
    assert_eq!(list(&over, None, 2).await, [ids[2], ids[1]]);
    assert_eq!(list(&over, Some((at(1), ids[1])), 2).await, [ids[0]]);
}
