//! Who may delete what: not everybody who may verify, and nothing that a dispute rests on without an admin.
use guardsplat_proto::v1::asset::Original;
use guardsplat_proto::v1::registry_service_client::RegistryServiceClient;
use guardsplat_proto::v1::{
    Asset, CreateAssetRequest, CreateJobRequest, CreateOwnerRequest, DeleteArtifactRequest, Job, Owner,
};
use tonic::{Code, Status};
use uuid::Uuid;

use super::calls::asking;
use super::harness::{Server, key_spec, refused, sha256};
use crate::access::Scope::{self, Admin, Embed, Verify};
use crate::artifacts::ArtifactPath;
use crate::ledger::{NewArtifact, Origin};
use crate::service::clock;

const PROJECT: &str = "studio";

/// An artifact whose bytes do not matter.
async fn upload(server: &Server, evidence: bool) -> String {
    let id = Uuid::now_v7();
    let new = NewArtifact {
        id,
        display_name: "a file".into(),
        size: 1,
        sha256: sha256(b"a"),
        origin: Origin::Upload {
            project: PROJECT.into(),
        },
        secret: false,
        evidence,
        path: ArtifactPath::upload(id).to_string(),
    };
    let ledger = server.ledger();
    ledger.create_artifact(new, clock::now()).await.unwrap();
    ledger.artifact_ready(id, None, clock::now()).await.unwrap();
    format!("artifacts/{id}")
}

/// An asset that was registered from an artifact.
async fn register(server: &Server, token: &str, key: &str, original: &str) {
    let mut registry = RegistryServiceClient::new(server.channel.clone());
    let owner = CreateOwnerRequest {
        owner: Some(Owner {
            display_name: "somebody".into(),
            ..Owner::default()
        }),
        request_id: String::new(),
    };
    let owner = registry
        .create_owner(asking(token, owner))
        .await
        .unwrap()
        .into_inner()
        .name;
    let asset = Asset {
        owner,
        key: key.into(),
        original: Some(Original::Artifact(original.into())),
        ..Asset::default()
    };
    let asset = CreateAssetRequest {
        asset: Some(asset),
        request_id: String::new(),
    };
    registry.create_asset(asking(token, asset)).await.unwrap();
}

#[tokio::test]
async fn what_a_dispute_rests_on_is_deleted_by_admins_only() {
    let server = Server::with_tokens().await;
    let token = async |scopes: &[Scope]| server.token(PROJECT, scopes).await;
    let (admin, embed, verify) = (token(&[Admin]).await, token(&[Embed]).await, token(&[Verify]).await);
    let delete = async |token: &str, name: &str| {
        let request = DeleteArtifactRequest { name: name.into() };
        server.artifacts.clone().delete_artifact(asking(token, request)).await
    };
    let denied = |answer: Result<_, Status>, scopes: &str| {
        let details = refused::<()>(
            answer.map(|_: tonic::Response<()>| ()),
            Code::PermissionDenied,
            "SCOPE_MISSING",
        );
        assert_eq!(details.error_info().unwrap().metadata["scopes"], scopes);
    };
    let worker = server.token("operator", &[Scope::Worker]).await;
    let made = CreateJobRequest {
        job: Some(Job {
            spec: Some(key_spec(64)),
            ..Job::default()
        }),
        request_id: String::new(),
    };
    let made = server
        .jobs
        .clone()
        .create_job(asking(&embed, made))
        .await
        .unwrap()
        .into_inner();
    let key = server.finish_key(&made.name, 64, &worker).await;
    let original = upload(&server, false).await;
    register(&server, &embed, &key, &original).await;
    for name in [upload(&server, true).await, original] {
        for token in [&embed, &verify] {
            denied(delete(token, &name).await, "admin");
        }
        delete(&admin, &name).await.unwrap();
        // Deleted for everybody.
        assert_eq!(delete(&admin, &name).await.unwrap_err().code(), Code::NotFound);
    }
    // What was uploaded is for whoever uploads.
    for token in [&admin, &embed, &verify] {
        let name = upload(&server, false).await;
        delete(token, &name).await.unwrap();
    }
}
