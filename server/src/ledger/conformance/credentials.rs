//! Content credentials: there with their job, found by the mark, gone with their sidecar.
use uuid::Uuid;

use super::super::{
    ArtifactId, AssetId, Before, Completion, CredentialsOf, CredentialsRow, JobId, KeyId, Ledger, LedgerError, Mark,
    NewCredentials, NewJob,
};
use super::Factory;
use super::fixture::*;
use super::outputs::make_key;

const THEIRS: &str = "theirs";

fn made(artifact: ArtifactId, mark: &Mark, manifest: &str, value: &str) -> NewCredentials {
    NewCredentials {
        artifact,
        mark: mark.clone(),
        manifest: manifest.into(),
        soft_binding: value.into(),
        test_certificate: true,
    }
}

async fn begin(ledger: &dyn Ledger, key: KeyId, now: i64) -> super::super::Lease {
    let job = NewJob {
        key: Some(key),
        ..new_job()
    };
    let id = ledger.create_job(job, now).await.unwrap().id;
    claim_of(ledger, id, now).await
}

/// Has a scene marked with credentials; the job and the sidecar.
async fn mark(ledger: &dyn Ledger, key: KeyId, mark: &Mark, manifest: &str, now: i64) -> (JobId, ArtifactId) {
    let lease = begin(ledger, key, now).await;
    let sidecar = output(ledger, &lease, false, now).await;
    let said = Completion {
        credentials: Some(made(sidecar, mark, manifest, "value")),
        ..completion(1, &[sidecar])
    };
    for _ in 0..2 {
        // Said again, there is one all the same.
        let done = ledger.complete(lease.job.id, &lease.token, said.clone(), now).await;
        done.unwrap();
    }
    (lease.job.id, sidecar)
}

async fn find(ledger: &dyn Ledger, project: &str, of: CredentialsOf) -> Vec<CredentialsRow> {
    ledger.find_credentials(project, &of, 10).await.unwrap()
}

fn artifacts(found: &[CredentialsRow]) -> Vec<ArtifactId> {
    found.iter().map(|row| row.artifact).collect()
}

pub(crate) async fn credentials_are_found_by_their_mark(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let (key, other) = (
        make_key(&*ledger, at(0)).await.1.id,
        make_key(&*ledger, at(0)).await.1.id,
    );
    let asset: AssetId = Uuid::now_v7();
    let (by_asset, by_message) = (Mark::Asset(asset), Mark::Message("c0ffee42".into()));
    let (first, one) = mark(&*ledger, key, &by_asset, "urn:1", at(1)).await;
    let (_, two) = mark(&*ledger, key, &by_asset, "urn:2", at(2)).await;
    let (_, three) = mark(&*ledger, key, &by_message, "urn:3", at(3)).await;
    let (_, four) = mark(&*ledger, other, &by_message, "urn:4", at(4)).await;

    let of_asset = || CredentialsOf::Mark(key, by_asset.clone());
    let found = find(&*ledger, OURS, of_asset()).await;
    assert_eq!(artifacts(&found), [two, one]);
    let expected = CredentialsRow {
        artifact: one,
        path: format!("artifacts/{one}"),
        size: 10,
        job: first,
        manifest: "urn:1".into(),
        soft_binding: "value".into(),
        test_certificate: true,
    };
    assert_eq!(found[1], expected);
    let of_message = |key| CredentialsOf::Mark(key, by_message.clone());
    assert_eq!(artifacts(&find(&*ledger, OURS, of_message(key)).await), [three]);
    assert_eq!(artifacts(&find(&*ledger, OURS, of_message(other)).await), [four]);
    let binding = || CredentialsOf::Binding("value".into());
    assert_eq!(
        artifacts(&find(&*ledger, OURS, binding()).await),
        [four, three, two, one]
    );
    let newest = ledger.find_credentials(OURS, &binding(), 1).await.unwrap();
    assert_eq!(artifacts(&newest), [four]);
    let manifest = |id: &str| CredentialsOf::Manifest(id.into());
    assert_eq!(artifacts(&find(&*ledger, OURS, manifest("urn:2")).await), [two]);
    for nothing in [
        CredentialsOf::Mark(other, by_asset.clone()),
        CredentialsOf::Mark(key, Mark::Asset(Uuid::now_v7())),
        CredentialsOf::Mark(key, Mark::Message("c0ffee43".into())),
        CredentialsOf::Binding("Value".into()),
        manifest("urn:5"),
    ] {
        assert_eq!(find(&*ledger, OURS, nothing).await, []);
    }
    // Another project has none of them.
    for of in [of_asset(), of_message(key), binding(), manifest("urn:1")] {
        assert_eq!(find(&*ledger, THEIRS, of).await, []);
    }
}

pub(crate) async fn credentials_come_with_their_job_and_go_with_their_sidecar(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let key = make_key(&*ledger, at(0)).await.1.id;
    let message = Mark::Message("0".into());
    let there = async || find(&*ledger, OURS, CredentialsOf::Mark(key, message.clone())).await;

    // Nothing of an attempt that failed, or named what is not its own.
    let lease = begin(&*ledger, key, at(1)).await;
    let foreign = upload(&*ledger, at(1)).await;
    let said = Completion {
        credentials: Some(made(foreign, &message, "urn:1", "value")),
        ..completion(1, &[foreign])
    };
    let refused = ledger.complete(lease.job.id, &lease.token, said, at(1)).await;
    refused!(refused, LedgerError::NotAnOutput(id) if id == foreign);
    assert_eq!(there().await, []);
    ledger
        .fail(lease.job.id, &lease.token, failure("no"), false, false, at(1))
        .await
        .unwrap();

    let (_, first) = mark(&*ledger, key, &message, "urn:1", at(2)).await;
    let (_, second) = mark(&*ledger, key, &message, "urn:2", at(3)).await;
    assert_eq!(artifacts(&there().await), [second, first]);
    ledger.delete_artifact(second, at(4)).await.unwrap();
    assert_eq!(artifacts(&there().await), [first]);
    let manifest = CredentialsOf::Manifest("urn:2".into());
    assert_eq!(find(&*ledger, OURS, manifest).await, []);
    // Rows go with the bytes, and with the job by age.
    ledger.forget_artifact(second).await.unwrap();
    let before = Before {
        jobs: Some(at(100)),
        ..Before::default()
    };
    ledger.expire(before, 10).await.unwrap();
    assert_eq!(there().await, []);
    ledger.forget_artifact(first).await.unwrap();
    assert!(ledger.expire(before, 10).await.unwrap().jobs >= 1);
}
