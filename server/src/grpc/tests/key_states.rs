//! Keys that are retired or revoked: what is refused, what goes on, and what is told.
use std::time::Duration;

use guardsplat_proto::v1::failure::Reason;
use guardsplat_proto::v1::job::{Spec, State as JobState};
use guardsplat_proto::v1::key::State;
use guardsplat_proto::v1::{
    Asset, CreateAssetRequest, CreateOwnerRequest, DownloadKeyRequest, EmbedSpec, Job, Key, Owner,
    UpdateKeyStateRequest, asset::Original,
};
use tonic::{Code, Status};
use uuid::Uuid;

use super::harness::{Server, invalid, not_found, refused, verify_spec};
use crate::service::Limits;

async fn update(server: &Server, name: &str, state: State, reason: &str) -> Result<Key, Status> {
    let request = UpdateKeyStateRequest {
        name: name.into(),
        state: state.into(),
        reason: reason.into(),
    };
    let answer = server.keys.clone().update_key_state(request).await?;
    Ok(answer.into_inner())
}

fn embed(scene: &str, key: &str) -> Job {
    let spec = EmbedSpec {
        scene: scene.into(),
        key: key.into(),
        message: "beef".into(),
        ..Default::default()
    };
    Job {
        spec: Some(Spec::Embed(spec)),
        ..Default::default()
    }
}

fn verify(scene: &str, key: &str) -> Job {
    Job {
        spec: Some(verify_spec(scene, key)),
        ..Default::default()
    }
}

async fn download(server: &Server, job: &str, token: &str) -> Result<Vec<u8>, Status> {
    let request = DownloadKeyRequest {
        job: job.into(),
        lease_token: token.into(),
    };
    let mut stream = server.worker.clone().download_key(request).await?.into_inner();
    let mut bytes = Vec::new();
    while let Some(message) = stream.message().await? {
        bytes.extend(message.chunk);
    }
    Ok(bytes)
}

#[tokio::test]
async fn states_go_forwards_and_are_told() {
    let server = Server::start().await;
    let key = server.key(16, b"key file").await;
    let retired = update(&server, &key, State::Retired, "too few bits").await.unwrap();
    assert_eq!(
        (retired.state(), retired.state_reason.as_str()),
        (State::Retired, "too few bits")
    );
    assert!(retired.state_time.is_some());
    // Said again, because the answer was lost, it stays as it is.
    assert_eq!(update(&server, &key, State::Retired, "").await.unwrap(), retired);
    let details = refused(
        update(&server, &key, State::Active, "").await,
        Code::FailedPrecondition,
        "KEY_STATE_FINAL",
    );
    assert_eq!(details.error_info().unwrap().metadata["state"], "retired");
    assert_eq!(details.precondition_failure().unwrap().violations[0].subject, key);
    let revoked = update(&server, &key, State::Revoked, "stolen").await.unwrap();
    for state in [State::Active, State::Retired] {
        let answer = update(&server, &key, state, "").await;
        refused(answer, Code::FailedPrecondition, "KEY_STATE_FINAL");
    }
    let server = server.restart(Limits::default()).await;
    assert_eq!(update(&server, &key, State::Revoked, "again").await.unwrap(), revoked);
    assert_eq!(revoked.state_reason, "stolen");
}

#[tokio::test]
async fn updates_are_checked() {
    let server = Server::start().await;
    let key = server.key(16, b"key file").await;
    assert_eq!(invalid(update(&server, "keys/x", State::Retired, "").await), ["name"]);
    assert_eq!(invalid(update(&server, &key, State::Unspecified, "").await), ["state"]);
    assert_eq!(invalid(update(&server, &key, State::Revoked, "").await), ["reason"]);
    for reason in ["x".repeat(501), "two\nlines".into()] {
        assert_eq!(
            invalid(update(&server, &key, State::Retired, &reason).await),
            ["reason"]
        );
    }
    let request = UpdateKeyStateRequest {
        state: 17,
        ..Default::default()
    };
    let fields = invalid(server.keys.clone().update_key_state(request).await);
    assert_eq!(fields, ["name", "state"]);
    let nobody = format!("keys/{}", Uuid::now_v7());
    assert_eq!(not_found(update(&server, &nobody, State::Retired, "").await), nobody);
    update(&server, &key, State::Retired, &"é".repeat(500)).await.unwrap();
}

#[tokio::test]
async fn a_retired_key_verifies_and_marks_no_more() {
    let server = Server::start().await;
    let key = server.key(16, b"key file").await;
    let scene = server.upload("scene.ply", b"scene").await.name;
    let request_id = Uuid::new_v4().to_string();
    let before = server
        .submit(embed(&scene, &key), &request_id)
        .await
        .unwrap()
        .into_inner();
    update(&server, &key, State::Retired, "").await.unwrap();
    let details = refused(
        server.submit(embed(&scene, &key), "").await,
        Code::FailedPrecondition,
        "KEY_NOT_ACTIVE",
    );
    assert_eq!(details.error_info().unwrap().metadata["name"], key);
    server.submit(verify(&scene, &key), "").await.unwrap();
    // What was queued before is the same request still, and is carried out.
    let again = server
        .submit(embed(&scene, &key), &request_id)
        .await
        .unwrap()
        .into_inner();
    assert_eq!(again.name, before.name);
    for _ in 0..2 {
        let (job, token) = server.take().await;
        assert_eq!(download(&server, &job.name, &token).await.unwrap(), b"key file");
    }
}

#[tokio::test]
async fn a_revoked_key_does_nothing() {
    let server = Server::start().await;
    let key = server.key(16, b"key file").await;
    let scene = server.upload("scene.ply", b"scene").await.name;
    update(&server, &key, State::Revoked, "stolen").await.unwrap();
    for job in [embed(&scene, &key), verify(&scene, &key)] {
        let details = refused(server.submit(job, "").await, Code::FailedPrecondition, "KEY_REVOKED");
        assert_eq!(details.precondition_failure().unwrap().violations[0].subject, key);
    }
    assert_eq!(server.lease(Duration::ZERO).await.job, None);
}

#[tokio::test]
async fn a_job_whose_key_is_revoked_meanwhile_fails_and_says_why() {
    let server = Server::start().await;
    let key = server.key(16, b"key file").await;
    let scene = server.upload("scene.ply", b"scene").await.name;
    for job in [embed(&scene, &key), verify(&scene, &key)] {
        server.submit(job, "").await.unwrap();
    }
    let (first, first_token) = server.take().await;
    update(&server, &key, State::Revoked, "the laptop was stolen")
        .await
        .unwrap();
    let (second, second_token) = server.take().await;
    for (job, token) in [(first, first_token), (second, second_token)] {
        let answer = download(&server, &job.name, &token).await;
        refused(answer, Code::FailedPrecondition, "KEY_REVOKED");
        let job = server.job(&job.name).await;
        let failure = job.failure.clone().unwrap();
        assert_eq!(
            (job.state(), failure.reason(), job.attempt),
            (JobState::Failed, Reason::InvalidInput, 1)
        );
        assert!(
            failure.message.contains(&key) && failure.message.contains("the laptop was stolen"),
            "{failure:?}"
        );
        // The worker, which knows of nothing but a refusal, changes nothing by what it says next.
        refused(download(&server, &job.name, &token).await, Code::Aborted, "LEASE_LOST");
    }
}

#[tokio::test]
async fn keys_that_are_not_active_take_no_assets() {
    let server = Server::start().await;
    let key = server.key(16, b"key file").await;
    let owner = Owner {
        display_name: "studio".into(),
        ..Owner::default()
    };
    let request = CreateOwnerRequest {
        owner: Some(owner),
        request_id: String::new(),
    };
    let owner = server
        .registry
        .clone()
        .create_owner(request)
        .await
        .unwrap()
        .into_inner();
    let register = async || {
        let asset = Asset {
            owner: owner.name.clone(),
            key: key.clone(),
            original: Some(Original::Sha256("0".repeat(64))),
            ..Asset::default()
        };
        let request = CreateAssetRequest {
            asset: Some(asset),
            request_id: String::new(),
        };
        server.registry.clone().create_asset(request).await
    };
    assert_eq!(register().await.unwrap().into_inner().payload_number, 1);
    for (state, reason) in [(State::Retired, "KEY_NOT_ACTIVE"), (State::Revoked, "KEY_REVOKED")] {
        update(&server, &key, state, "because").await.unwrap();
        refused(register().await, Code::FailedPrecondition, reason);
    }
}
