//! What every ledger must do with tokens and projects.
use std::sync::Arc;

use guardsplat_commitment::SigningKey;
use uuid::Uuid;

use super::super::{
    ArtifactId, AssetFilter, Completion, JobKind, JobState, Ledger, LedgerError, NewAsset, NewJob, NewKey, NewOwner,
    NewToken, Origin, TokenRow, Usage,
};
use super::Factory;
use super::fixture::*;
use super::outputs::make_key;
use crate::access::{Scope, Scopes};

fn new_token(project: &str) -> NewToken {
    let id = Uuid::now_v7();
    let mut hash = [7; 32];
    hash[..16].copy_from_slice(id.as_bytes());
    NewToken {
        id,
        hash,
        display_name: "the shop".into(),
        project: project.into(),
        scopes: [Scope::Embed, Scope::Worker].into_iter().collect(),
        expire_time: Some(at(90)),
    }
}

async fn keep(ledger: &dyn Ledger, new: &NewToken, now: i64) -> TokenRow {
    ledger.create_token(new.clone(), now).await.expect("a token is kept")
}

pub async fn a_token_is_kept_and_found_by_its_hash(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let new = new_token("studio");
    let kept = keep(&*ledger, &new, at(1)).await;
    let expected = TokenRow {
        id: new.id,
        display_name: "the shop".into(),
        project: "studio".into(),
        scopes: new.scopes,
        create_time: at(1),
        expire_time: Some(at(90)),
        last_use_time: None,
        revoke_time: None,
    };
    assert_eq!(kept, expected);
    assert_eq!(ledger.find_token(&new.hash).await.unwrap(), Some(expected.clone()));
    assert_eq!(ledger.get_token(new.id).await.unwrap(), Some(expected.clone()));
    let mut other = new.hash;
    other[31] ^= 1;
    assert_eq!(ledger.find_token(&other).await.unwrap(), None);
    assert_eq!(ledger.get_token(Uuid::now_v7()).await.unwrap(), None);
    // Two tokens never share a hash: one of them could be used with the rights of the other.
    let twin = NewToken {
        id: Uuid::now_v7(),
        ..new
    };
    refused!(ledger.create_token(twin, at(2)).await, LedgerError::Database(_));
    drop(ledger);
    let ledger = factory.open().await;
    assert_eq!(ledger.find_token(&new.hash).await.unwrap(), Some(expected));
}

pub async fn a_revoked_token_stays_revoked(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let new = new_token("studio");
    let other = keep(&*ledger, &new_token("studio"), at(1)).await;
    keep(&*ledger, &new, at(1)).await;
    for now in [at(5), at(9)] {
        let revoked = ledger.revoke_token(new.id, now).await.unwrap();
        assert_eq!(revoked.revoke_time, Some(at(5)));
        assert_eq!(ledger.find_token(&new.hash).await.unwrap(), Some(revoked));
    }
    assert_eq!(ledger.get_token(other.id).await.unwrap(), Some(other));
    refused!(
        ledger.revoke_token(Uuid::now_v7(), at(5)).await,
        LedgerError::NotFound { kind: "token", .. }
    );
}

pub async fn the_use_of_a_token_is_noted(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let new = NewToken {
        expire_time: None,
        scopes: Scopes::all(),
        ..new_token("studio")
    };
    keep(&*ledger, &new, at(1)).await;
    for (now, noted) in [(at(3), at(3)), (at(2), at(3)), (at(4), at(4))] {
        ledger.touch_token(new.id, now).await.unwrap();
        let row = ledger.get_token(new.id).await.unwrap().unwrap();
        assert_eq!((row.last_use_time, row.expire_time), (Some(noted), None));
        assert_eq!(row.scopes, Scopes::all());
    }
    ledger.touch_token(Uuid::now_v7(), at(4)).await.unwrap();
}

pub async fn tokens_come_in_pages_of_their_project(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let mut expected = Vec::new();
    for i in 0..5 {
        // Some were made at the same time.
        let row = keep(&*ledger, &new_token("studio"), at(i / 2)).await;
        keep(&*ledger, &new_token("other"), at(i / 2)).await;
        expected.push(row);
    }
    expected.sort_by_key(|row| std::cmp::Reverse((row.create_time, row.id)));
    let mut found: Vec<TokenRow> = Vec::new();
    loop {
        let before = found.last().map(|row| (row.create_time, row.id));
        let page = ledger.list_tokens(Some("studio"), before, 2).await.unwrap();
        if page.is_empty() {
            break;
        }
        found.extend(page);
    }
    assert_eq!(found, expected);
    assert_eq!(ledger.list_tokens(None, None, 100).await.unwrap().len(), 10);
    assert_eq!(ledger.list_tokens(Some("nobody"), None, 100).await.unwrap(), []);
}

const THEIRS: &str = "theirs";

/// An upload of another project.
async fn their_upload(ledger: &dyn Ledger, now: i64) -> ArtifactId {
    let origin = Origin::Upload { project: THEIRS.into() };
    let id = ledger
        .create_artifact(new_artifact(origin, false), now)
        .await
        .unwrap()
        .id;
    let row = ledger.artifact_ready(id, None, now).await.unwrap();
    assert_eq!(row.project, THEIRS);
    id
}

fn their_job() -> NewJob {
    NewJob {
        project: THEIRS.into(),
        ..new_job()
    }
}

pub async fn lists_are_of_a_project(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let ours = queue(&*ledger, at(0)).await;
    let theirs = ledger.create_job(their_job(), at(1)).await.unwrap();
    assert_eq!((theirs.project.as_str(), theirs.queue_position), (THEIRS, Some(1)));
    for states in [&[][..], &[JobState::Queued]] {
        for (project, id) in [(OURS, ours), (THEIRS, theirs.id)] {
            let jobs = ledger.list_jobs(project, states, None, 10).await.unwrap();
            assert_eq!(jobs.iter().map(|job| job.id).collect::<Vec<_>>(), [id]);
        }
        assert_eq!(ledger.list_jobs("nobody", states, None, 10).await.unwrap(), []);
    }
    let owner = |project: &str| NewOwner {
        id: Uuid::now_v7(),
        project: project.into(),
        display_name: "studio".into(),
        request_id: None,
    };
    let ours = ledger.create_owner(owner(OURS), at(0)).await.unwrap();
    let theirs = ledger.create_owner(owner(THEIRS), at(0)).await.unwrap();
    assert_eq!(ledger.list_owners(OURS, None, 10).await.unwrap(), [ours]);
    assert_eq!(ledger.list_owners(THEIRS, None, 10).await.unwrap(), [theirs]);
}

pub async fn a_job_names_what_is_of_its_project(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let key = make_key(&*ledger, at(0)).await.1.id;
    let (ours, theirs) = (upload(&*ledger, at(0)).await, their_upload(&*ledger, at(0)).await);
    let job = |project: &str, input, key| NewJob {
        project: project.into(),
        inputs: vec![input],
        key,
        ..new_job()
    };
    for (new, kind) in [
        (job(OURS, theirs, None), "artifact"),
        (job(THEIRS, ours, None), "artifact"),
        (job(THEIRS, theirs, Some(key)), "key"),
    ] {
        match ledger.create_job(new, at(1)).await {
            Err(LedgerError::NotFound { kind: told, .. }) => assert_eq!(told, kind),
            other => panic!("{other:?}"),
        }
    }
    ledger.create_job(job(OURS, ours, Some(key)), at(1)).await.unwrap();
    ledger.create_job(job(THEIRS, theirs, None), at(1)).await.unwrap();
}

pub async fn what_a_job_makes_is_of_its_project(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let job = NewJob {
        spec: spec_of(JobKind::CreateKey),
        ..their_job()
    };
    let id = ledger.create_job(job, at(0)).await.unwrap().id;
    let lease = claim_of(&*ledger, id, at(1)).await;
    let seen = output(&*ledger, &lease, false, at(2)).await;
    let secret = output(&*ledger, &lease, true, at(2)).await;
    let key = NewKey {
        id: Uuid::now_v7(),
        display_name: String::new(),
        bits: 8,
        clip: "clip".into(),
        clip_sha256: "ab".repeat(32),
        seeded: false,
        artifact: secret,
    };
    let name = key.id;
    let completion = Completion {
        key: Some(key),
        result: result_of(JobKind::CreateKey, 1),
        ..completion(1, &[seen])
    };
    ledger.complete(id, &lease.token, completion, at(3)).await.unwrap();
    for id in [seen, secret] {
        assert_eq!(ledger.get_any_artifact(id).await.unwrap().unwrap().project, THEIRS);
    }
    assert_eq!(ledger.get_key(name).await.unwrap().unwrap().project, THEIRS);
    assert_eq!(ledger.list_keys(OURS, None, 10).await.unwrap(), []);
    assert_eq!(ledger.list_keys(THEIRS, None, 10).await.unwrap().len(), 1);
}

pub async fn an_asset_names_what_is_of_its_project(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let signer = Arc::new(SigningKey::from_seed(&[7; 32]).unwrap());
    let key = make_key(&*ledger, at(0)).await.1.id;
    let mut owners = Vec::new();
    for project in [OURS, THEIRS] {
        let new = NewOwner {
            id: Uuid::now_v7(),
            project: project.into(),
            display_name: "studio".into(),
            request_id: None,
        };
        owners.push(ledger.create_owner(new, at(0)).await.unwrap().id);
    }
    let asset = |project: &str, owner| NewAsset {
        id: Uuid::now_v7(),
        project: project.into(),
        commitment: Uuid::now_v7(),
        owner,
        display_name: "a robot".into(),
        sha256: [3; 32],
        artifact: None,
        key,
        sealed_nonce: vec![1],
        nonce_hash: [4; 32],
        request_id: None,
    };
    for (new, kind) in [(asset(OURS, owners[1]), "owner"), (asset(THEIRS, owners[1]), "key")] {
        match ledger.create_asset(new, signer.clone(), at(1)).await {
            Err(LedgerError::NotFound { kind: told, .. }) => assert_eq!(told, kind),
            other => panic!("{other:?}"),
        }
    }
    let row = ledger
        .create_asset(asset(OURS, owners[0]), signer, at(1))
        .await
        .unwrap();
    assert_eq!(row.project, OURS);
    let filter = AssetFilter {
        owner: Some(owners[0]),
        key: None,
    };
    for filter in [AssetFilter::default(), filter] {
        let listed = ledger.list_assets(OURS, filter, None, 5).await.unwrap();
        assert_eq!(listed, std::slice::from_ref(&row));
        assert_eq!(ledger.list_assets(THEIRS, filter, None, 5).await.unwrap(), []);
    }
    assert_eq!(ledger.list_commitments(OURS, 0, 5).await.unwrap().len(), 1);
    assert_eq!(ledger.list_commitments(THEIRS, 0, 5).await.unwrap(), []);
    assert!(ledger.head(OURS).await.unwrap().is_some());
    assert_eq!(ledger.head(THEIRS).await.unwrap(), None);
}

pub async fn a_request_is_of_a_project(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let request_id = Some(Uuid::new_v4());
    let job = |project: &str| NewJob {
        project: project.into(),
        request_id,
        ..new_job()
    };
    let first = ledger.create_job(job(OURS), at(0)).await.unwrap();
    refused!(
        ledger.create_job(job(THEIRS), at(1)).await,
        LedgerError::RequestIdReused(_)
    );
    assert_eq!(ledger.create_job(job(OURS), at(1)).await.unwrap().id, first.id);
    let owner = |project: &str| NewOwner {
        id: Uuid::now_v7(),
        project: project.into(),
        display_name: "studio".into(),
        request_id,
    };
    ledger.create_owner(owner(OURS), at(0)).await.unwrap();
    refused!(
        ledger.create_owner(owner(THEIRS), at(1)).await,
        LedgerError::RequestIdReused(_)
    );
}

pub async fn what_a_running_job_reads_is_known(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let (input, other) = (upload(&*ledger, at(0)).await, upload(&*ledger, at(0)).await);
    let new = NewJob {
        inputs: vec![input],
        ..new_job()
    };
    let id = ledger.create_job(new, at(0)).await.unwrap().id;
    let read = async |id| ledger.is_being_read(id).await.unwrap();
    assert!(!read(input).await, "the job waits");
    let lease = claim_of(&*ledger, id, at(1)).await;
    assert_eq!((read(input).await, read(other).await), (true, false));
    complete(&*ledger, &lease, &[], at(2)).await;
    assert!(!read(input).await, "the job is over");
}

pub async fn what_a_project_takes_is_counted(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let used = async |project: &str| ledger.usage(project).await.unwrap();
    assert_eq!(used(THEIRS).await, Usage::default());
    let first = their_upload(&*ledger, at(0)).await;
    their_upload(&*ledger, at(0)).await;
    upload(&*ledger, at(0)).await;
    // One that is on its way counts for nothing yet.
    let origin = Origin::Upload { project: THEIRS.into() };
    ledger
        .create_artifact(new_artifact(origin, false), at(0))
        .await
        .unwrap();
    let job = ledger.create_job(their_job(), at(1)).await.unwrap().id;
    let both = Usage {
        queued_jobs: 1,
        artifact_bytes: 20,
        reserved_bytes: 0,
    };
    assert_eq!(used(THEIRS).await, both);
    ledger.delete_artifact(first, at(2)).await.unwrap();
    claim_of(&*ledger, job, at(2)).await;
    let less = Usage {
        queued_jobs: 0,
        artifact_bytes: 10,
        reserved_bytes: 0,
    };
    assert_eq!(used(THEIRS).await, less);
}
