//! Uploads: seen when they are complete, kept while needed, collected when abandoned.
use super::super::{ArtifactState, JobState, LedgerError, NewJob};
use super::Factory;
use super::fixture::*;

pub(crate) async fn uploads_are_seen_when_they_are_complete(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let new = new_artifact(by_us(), false);
    let made = ledger.create_artifact(new.clone(), at(0)).await.unwrap();
    assert_eq!((made.id, made.size, made.state), (new.id, 10, ArtifactState::Pending));
    assert_eq!(
        (made.sha256, made.path, made.display_name),
        (new.sha256, new.path, new.display_name)
    );
    assert!(!visible(&*ledger, new.id).await);
    refused!(
        ledger.delete_artifact(new.id, at(1)).await,
        LedgerError::NotFound { .. }
    );
    refused!(
        ledger.artifact_ready(new.id, Some("x"), at(1)).await,
        LedgerError::NotAnOutput(_)
    );
    let ready = ledger.artifact_ready(new.id, None, at(2)).await.unwrap();
    assert_eq!(
        (ready.state, ready.job, ready.create_time),
        (ArtifactState::Ready, None, at(0))
    );
    assert_eq!(ledger.get_artifact(new.id).await.unwrap(), Some(ready));
}

pub(crate) async fn what_a_job_needs_is_not_deleted(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let scene = upload(&*ledger, at(0)).await;
    let id = ledger
        .create_job(
            NewJob {
                inputs: vec![scene],
                ..new_job()
            },
            at(1),
        )
        .await
        .unwrap()
        .id;
    refused!(ledger.delete_artifact(scene, at(2)).await, LedgerError::InUse { artifact, job } if (artifact, job) == (scene, id));
    let lease = claim_of(&*ledger, id, at(3)).await;
    refused!(ledger.delete_artifact(scene, at(4)).await, LedgerError::InUse { .. });
    complete(&*ledger, &lease, &[], at(5)).await;
    ledger.delete_artifact(scene, at(6)).await.unwrap();
    assert!(!visible(&*ledger, scene).await);
    refused!(ledger.delete_artifact(scene, at(7)).await, LedgerError::NotFound { .. });

    // Its bytes are still to go; afterwards the job goes on without it.
    let collected = ledger.abandoned_artifacts(0, 10).await.unwrap();
    assert_eq!(
        collected.iter().map(|a| (a.id, a.state)).collect::<Vec<_>>(),
        [(scene, ArtifactState::Deleted)]
    );
    ledger.forget_artifact(scene).await.unwrap();
    assert_eq!(ledger.get_any_artifact(scene).await.unwrap(), None);
    assert_eq!(job(&*ledger, id).await.state, JobState::Succeeded);
}

pub(crate) async fn abandoned_uploads_are_collected(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let whole = upload(&*ledger, at(0)).await;
    let half = ledger
        .create_artifact(new_artifact(by_us(), false), at(1))
        .await
        .unwrap()
        .id;
    let young = ledger
        .create_artifact(new_artifact(by_us(), false), at(5))
        .await
        .unwrap()
        .id;
    assert_eq!(ledger.abandoned_artifacts(at(1), 10).await.unwrap(), []);
    for _ in 0..2 {
        // Until they are forgotten they are told again: the bytes may not have gone the first time.
        let abandoned = ledger.abandoned_artifacts(at(5), 10).await.unwrap();
        assert_eq!(abandoned.iter().map(|a| a.id).collect::<Vec<_>>(), [half]);
    }
    refused!(
        ledger.artifact_ready(half, None, at(6)).await,
        LedgerError::NotFound { .. }
    );
    ledger.forget_artifact(half).await.unwrap();
    assert_eq!(ledger.abandoned_artifacts(at(5), 10).await.unwrap(), []);
    // What is wanted is not forgotten.
    for kept in [whole, young] {
        ledger.forget_artifact(kept).await.unwrap();
        assert!(ledger.get_any_artifact(kept).await.unwrap().is_some());
    }
    ledger.artifact_ready(young, None, at(7)).await.unwrap();
    assert!(visible(&*ledger, young).await);
}

pub(crate) async fn outputs_of_attempts_that_are_over_are_collected(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let id = queue(&*ledger, at(0)).await;
    let first = claim_of(&*ledger, id, at(0)).await;
    let mut left = vec![output(&*ledger, &first, false, at(1)).await];
    left.push(pending_output(&*ledger, &first, true, at(2)).await);
    assert_eq!(
        ledger.abandoned_artifacts(at(10), 10).await.unwrap(),
        [],
        "the attempt goes on"
    );
    ledger.reap(at(30)).await.unwrap();
    let second = claim_of(&*ledger, id, at(40)).await;
    let published = output(&*ledger, &second, false, at(41)).await;
    let unnamed = output(&*ledger, &second, false, at(42)).await;
    let abandoned = ledger.abandoned_artifacts(at(100), 10).await.unwrap();
    assert_eq!(abandoned.iter().map(|a| a.id).collect::<Vec<_>>(), left);
    complete(&*ledger, &second, &[published], at(50)).await;
    left.push(unnamed);
    for expected in [&left[..1], &left[1..]] {
        let abandoned = ledger
            .abandoned_artifacts(at(100), expected.len() as u32)
            .await
            .unwrap();
        assert_eq!(abandoned.iter().map(|a| a.id).collect::<Vec<_>>(), expected);
        for artifact in expected {
            ledger.forget_artifact(*artifact).await.unwrap();
        }
    }
    assert!(visible(&*ledger, published).await);
}
