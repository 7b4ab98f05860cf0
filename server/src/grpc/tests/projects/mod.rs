//! Projects on one server, each with one of everything: what they have of each other, and what their tokens allow.
mod foreign;
mod scopes;
mod turns;

use guardsplat_proto::v1::artifact_service_client::ArtifactServiceClient;
use guardsplat_proto::v1::asset::Original;
use guardsplat_proto::v1::hook_service_client::HookServiceClient;
use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::registry_service_client::RegistryServiceClient;
use guardsplat_proto::v1::*;

use super::calls::asking;
use super::harness::{Server, key_spec, metadata, sha256, upload_messages};
use crate::access::Scope::{self, Admin, Embed, Verify};
use crate::service::clock;

/// What a project can do but carry out jobs.
const ALL: [Scope; 3] = [Embed, Verify, Admin];

/// A project with one of everything.
pub(super) struct Project {
    pub token: String,
    artifact: String,
    key: String,
    owner: String,
    asset: String,
    commitment: String,
    pub job: String,
    token_name: String,
    hook: String,
    delivery: String,
    upload: String,
}

const SCENE: &[u8] = b"a scene";

impl Project {
    pub async fn new(server: &Server, name: &str, worker: &str) -> Self {
        let token = server.token(name, &ALL).await;
        let channel = server.channel.clone();
        let mut jobs = JobServiceClient::new(channel.clone());
        let mut registry = RegistryServiceClient::new(channel.clone());
        let mut hooks = HookServiceClient::new(channel.clone());
        let hook = Hook {
            url: "https://shop.example/hook".into(),
            ..Hook::default()
        };
        let request = CreateHookRequest { hook: Some(hook) };
        let hook = hooks
            .create_hook(asking(&token, request))
            .await
            .unwrap()
            .into_inner()
            .hook;
        let upload = asking(
            &token,
            tokio_stream::iter(upload_messages(metadata("a.ply", SCENE), SCENE)),
        );
        let artifact = ArtifactServiceClient::new(channel.clone())
            .upload_artifact(upload)
            .await;
        let artifact = artifact.unwrap().into_inner().name;
        let made = jobs
            .create_job(asking(&token, create(key_spec(64))))
            .await
            .unwrap()
            .into_inner();
        let key = server.finish_key(&made.name, 64, worker).await;
        let told = hooks
            .list_deliveries(asking(&token, ListDeliveriesRequest::default()))
            .await;
        let delivery = told.unwrap().into_inner().deliveries.remove(0).name;
        let owner = CreateOwnerRequest {
            owner: Some(Owner {
                display_name: name.into(),
                ..Owner::default()
            }),
            request_id: REQUEST.into(),
        };
        let owner = registry
            .create_owner(asking(&token, owner))
            .await
            .unwrap()
            .into_inner()
            .name;
        let asset = asset(&owner, &key, Original::Sha256(sha256(SCENE)));
        let asset = registry.create_asset(asking(&token, asset)).await.unwrap().into_inner();
        let job = CreateJobRequest {
            request_id: REQUEST.into(),
            ..create(embed(&artifact, &key))
        };
        let job = jobs.create_job(asking(&token, job)).await.unwrap().into_inner().name;
        let id: uuid::Uuid = token.split('_').nth(1).unwrap().parse().unwrap();
        let begun = server
            .api
            .name_of_upload(name, id, clock::now(), metadata("a.ply", SCENE), false);
        Self {
            upload: begun.unwrap(),
            artifact,
            key,
            owner,
            asset: asset.name,
            commitment: asset.commitment,
            job,
            token_name: format!("tokens/{id}"),
            hook: hook.unwrap().name,
            delivery,
            token,
        }
    }
}

/// Both projects call their requests the same, which is nobody's business but their own.
const REQUEST: &str = "5f0c54a6-6b0d-4d6f-9a80-6a7a0b1f4f11";

fn create(spec: Spec) -> CreateJobRequest {
    CreateJobRequest {
        job: Some(Job {
            spec: Some(spec),
            ..Job::default()
        }),
        request_id: String::new(),
    }
}

fn embed(scene: &str, key: &str) -> Spec {
    Spec::Embed(EmbedSpec {
        scene: scene.into(),
        key: key.into(),
        message: "0123456789abcdef".into(),
        ..EmbedSpec::default()
    })
}

fn asset(owner: &str, key: &str, original: Original) -> CreateAssetRequest {
    CreateAssetRequest {
        asset: Some(Asset {
            owner: owner.into(),
            key: key.into(),
            original: Some(original),
            ..Asset::default()
        }),
        request_id: String::new(),
    }
}
