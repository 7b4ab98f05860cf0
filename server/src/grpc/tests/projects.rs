//! Two projects on one server: every call by one about what is the other's.
use guardsplat_proto::v1::artifact_service_client::ArtifactServiceClient;
use guardsplat_proto::v1::asset::Original;
use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::hook_service_client::HookServiceClient;
use guardsplat_proto::v1::job::{Spec, State};
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::registry_service_client::RegistryServiceClient;
use guardsplat_proto::v1::*;
use prost::Message;
use tonic::{Code, Status};
use tonic_types::StatusExt;

use super::calls::{asking, call, paths};
use super::harness::{
    Server, key_output, key_spec, metadata, not_found, refused, sha256, upload_messages, verify_spec,
};
use crate::access::Scope::{self, Admin, Embed, Verify, Worker};
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

/// What a call does with what is another project's.
enum Foreign {
    /// It says that each of these does not exist: the message, and what is named as missing.
    Missing(Vec<(Vec<u8>, String)>),
    /// It answers with what is the caller's own, which the answer has, and with nothing of the other's.
    Own(Vec<u8>, String),
    /// It names nothing that could be another's.
    NamesNothing,
    /// Workers carry out jobs of all projects, by their leases.
    ByLease,
}

/// A new call fails here until somebody says what it does with what is another project's.
fn foreign(path: &str, own: &Project, other: &Project) -> Foreign {
    use Foreign::{ByLease, Missing, NamesNothing, Own};
    let one = |message: Vec<u8>, name: &str| Missing(vec![(message, name.to_owned())]);
    macro_rules! named {
        ($request:ident, $field:ident $(, $more:ident: $value:expr)*) => {
            one(
                $request {
                    name: other.$field.clone(),
                    $($more: $value,)*
                }
                .encode_to_vec(),
                &other.$field,
            )
        };
    }
    let Some((service, method)) = path
        .strip_prefix("/guardsplat.v1.")
        .and_then(|path| path.split_once('/'))
    else {
        return NamesNothing; // health and reflection
    };
    match method {
        _ if service == "WorkerService" => ByLease,
        "CreateJob" => {
            let verify = |spec: VerifySpec| {
                Spec::Verify(VerifySpec {
                    suspects: vec![own.artifact.clone()],
                    key: own.key.clone(),
                    ..spec
                })
            };
            let marked = EmbedSpec {
                scene: own.artifact.clone(),
                key: own.key.clone(),
                asset: other.asset.clone(),
                ..EmbedSpec::default()
            };
            let specs = [
                (embed(&other.artifact, &own.key), &other.artifact),
                (embed(&own.artifact, &other.key), &other.key),
                (Spec::Embed(marked), &other.asset),
                (verify_spec(&other.artifact, &own.key), &other.artifact),
                (verify_spec(&own.artifact, &other.key), &other.key),
                (
                    verify(VerifySpec {
                        cameras: other.artifact.clone(),
                        ..VerifySpec::default()
                    }),
                    &other.artifact,
                ),
                (
                    verify(VerifySpec {
                        asset: other.asset.clone(),
                        ..VerifySpec::default()
                    }),
                    &other.asset,
                ),
                (
                    verify(VerifySpec {
                        owner: other.owner.clone(),
                        ..VerifySpec::default()
                    }),
                    &other.owner,
                ),
            ];
            Missing(
                specs
                    .map(|(spec, name)| (create(spec).encode_to_vec(), name.clone()))
                    .to_vec(),
            )
        }
        "GetJob" => named!(GetJobRequest, job),
        "CancelJob" => named!(CancelJobRequest, job),
        "RequeueJob" => named!(RequeueJobRequest, job),
        "ListJobAttempts" => named!(ListJobAttemptsRequest, job),
        "WatchJob" => named!(WatchJobRequest, job, cursor: String::new()),
        // What they have of others: workers.rs.
        "ListWorkers" => NamesNothing,
        "ListJobs" => Own(Vec::new(), own.job.clone()),
        "AppendUpload" => {
            let request = AppendUploadRequest {
                upload: other.upload.clone(),
                ..AppendUploadRequest::default()
            };
            one(request.encode_to_vec(), &other.upload)
        }
        "FinishUpload" => {
            let request = FinishUploadRequest {
                upload: other.upload.clone(),
            };
            one(request.encode_to_vec(), &other.upload)
        }
        "DownloadArtifact" => named!(DownloadArtifactRequest, artifact, offset: 0),
        "GetDownloadUrl" => named!(GetDownloadUrlRequest, artifact),
        "GetArtifact" => named!(GetArtifactRequest, artifact),
        "DeleteArtifact" => named!(DeleteArtifactRequest, artifact),
        "GetKey" => named!(GetKeyRequest, key),
        "ListKeys" => Own(Vec::new(), own.key.clone()),
        "UpdateKeyState" => {
            let request = UpdateKeyStateRequest {
                name: other.key.clone(),
                state: key::State::Revoked.into(),
                reason: "spite".into(),
            };
            one(request.encode_to_vec(), &other.key)
        }
        "GetOwner" => named!(GetOwnerRequest, owner),
        "ListOwners" => Own(Vec::new(), own.owner.clone()),
        "CreateAsset" => {
            let hash = || Original::Sha256(sha256(SCENE));
            let artifact = Original::Artifact(other.artifact.clone());
            let requests = [
                (asset(&other.owner, &own.key, hash()), &other.owner),
                (asset(&own.owner, &other.key, hash()), &other.key),
                (asset(&own.owner, &own.key, artifact), &other.artifact),
            ];
            Missing(
                requests
                    .map(|(request, name)| (request.encode_to_vec(), name.clone()))
                    .to_vec(),
            )
        }
        "GetAsset" => named!(GetAssetRequest, asset),
        "ListAssets" => Own(Vec::new(), own.asset.clone()),
        "GetCommitment" => named!(GetCommitmentRequest, commitment),
        "ExportCommitment" => named!(ExportCommitmentRequest, commitment),
        "RevealCommitment" => named!(RevealCommitmentRequest, commitment),
        "ListCommitments" | "GetHead" => Own(Vec::new(), own.commitment.clone()),
        "RevokeToken" => named!(RevokeTokenRequest, token_name),
        "ListTokens" => Own(Vec::new(), own.token_name.clone()),
        "GetHook" => named!(GetHookRequest, hook),
        "DeleteHook" => named!(DeleteHookRequest, hook),
        "ListHooks" => Own(Vec::new(), own.hook.clone()),
        "ListDeliveries" => Own(Vec::new(), own.delivery.clone()),
        "RedeliverDelivery" => named!(RedeliverDeliveryRequest, delivery),
        "UploadArtifact" | "StartUpload" | "CreateOwner" | "CreateToken" | "CreateHook" | "GetPublicKey" => {
            NamesNothing
        }
        _ => panic!("say what {path} does with what is another project's"),
    }
}

fn holds(bytes: &[u8], text: &str) -> bool {
    bytes.windows(text.len()).any(|window| window == text.as_bytes())
}

#[tokio::test]
async fn what_is_another_project_s_does_not_exist() {
    let server = Server::with_tokens().await;
    let worker = server.token("operator", &[Worker]).await;
    let studio = Project::new(&server, "studio", &worker).await;
    let other = Project::new(&server, "other", &worker).await;
    for (own, foreign_one) in [(&studio, &other), (&other, &studio)] {
        for path in paths() {
            match foreign(&path, own, foreign_one) {
                Foreign::Missing(calls) => {
                    for (message, name) in calls {
                        let answer = call(&server.channel, &path, Some(&own.token), message).await;
                        assert!(answer.is_err(), "{path}");
                        assert_eq!(not_found(answer), name, "{path}");
                    }
                }
                Foreign::Own(message, name) => {
                    let answer = call(&server.channel, &path, Some(&own.token), message).await;
                    let answer = answer.unwrap().unwrap_or_default();
                    assert!(holds(&answer, &name), "{path}");
                    for theirs in [
                        &foreign_one.job,
                        &foreign_one.artifact,
                        &foreign_one.key,
                        &foreign_one.owner,
                        &foreign_one.asset,
                        &foreign_one.commitment,
                        &foreign_one.token_name,
                        &foreign_one.hook,
                        &foreign_one.delivery,
                    ] {
                        assert!(!holds(&answer, theirs), "{path} tells of {theirs}");
                    }
                }
                Foreign::NamesNothing | Foreign::ByLease => {}
            }
        }
    }
    // What was tried changed nothing.
    for project in [&studio, &other] {
        let request = asking(
            &project.token,
            GetJobRequest {
                name: project.job.clone(),
            },
        );
        let job = JobServiceClient::new(server.channel.clone()).get_job(request).await;
        assert_eq!(job.unwrap().into_inner().state(), State::Queued);
    }
}

#[tokio::test]
async fn workers_read_what_running_jobs_need_and_nothing_else() {
    let server = Server::with_tokens().await;
    let worker = server.token("operator", &[Worker]).await;
    let studio = Project::new(&server, "studio", &worker).await;
    let download = async || {
        let request = DownloadArtifactRequest {
            name: studio.artifact.clone(),
            offset: 0,
        };
        let path = "/guardsplat.v1.ArtifactService/DownloadArtifact";
        let bytes = call(&server.channel, path, Some(&worker), request.encode_to_vec()).await;
        let request = GetDownloadUrlRequest {
            name: studio.artifact.clone(),
        };
        let path = "/guardsplat.v1.ArtifactService/GetDownloadUrl";
        let url = call(&server.channel, path, Some(&worker), request.encode_to_vec()).await;
        assert_eq!(url.is_ok(), bytes.is_ok());
        bytes
    };
    assert_eq!(not_found(download().await), studio.artifact);
    let (job, token) = server.take_as(&worker).await;
    assert_eq!(job.name, studio.job);
    download().await.unwrap();
    let release = ReleaseJobRequest {
        name: job.name,
        lease_token: token,
    };
    let path = "/guardsplat.v1.WorkerService/ReleaseJob";
    call(&server.channel, path, Some(&worker), release.encode_to_vec())
        .await
        .unwrap();
    assert_eq!(not_found(download().await), studio.artifact);
}

/// `CreateJob` and `CancelJob` need the scope of the job's kind.
#[tokio::test]
async fn jobs_need_the_scope_of_their_kind() {
    let server = Server::with_tokens().await;
    let worker = server.token("operator", &[Worker]).await;
    let studio = Project::new(&server, "studio", &worker).await;
    let send = async |scope, request: CreateJobRequest| {
        let token = server.token("studio", &[scope]).await;
        JobServiceClient::new(server.channel.clone())
            .create_job(asking(&token, request))
            .await
    };
    let lacks = |answer: Result<_, Status>, scope: &str| {
        let details = refused::<tonic::Response<Job>>(answer, Code::PermissionDenied, "SCOPE_MISSING");
        assert_eq!(details.error_info().unwrap().metadata["scopes"], scope);
    };
    lacks(send(Verify, create(key_spec(8))).await, "embed");
    lacks(
        send(Verify, create(embed(&studio.artifact, &studio.key))).await,
        "embed",
    );
    lacks(
        send(Embed, create(verify_spec(&studio.artifact, &studio.key))).await,
        "verify",
    );
    send(Embed, create(embed(&studio.artifact, &studio.key))).await.unwrap();
    lacks(
        send(Verify, create(verify_spec(&studio.artifact, &studio.key))).await,
        "admin",
    );
    let claim = Spec::Verify(VerifySpec {
        suspects: vec![studio.artifact.clone()],
        key: studio.key.clone(),
        search: true,
        ..VerifySpec::default()
    });
    send(Verify, create(claim)).await.unwrap();
    let token = server.token("studio", &[Verify]).await;
    let cancel = asking(&token, CancelJobRequest { name: studio.job });
    lacks(
        JobServiceClient::new(server.channel.clone()).cancel_job(cancel).await,
        "embed",
    );
}

/// A request id that another project used first is the caller's own to use, and one's own is told as it was given.
#[tokio::test]
async fn request_ids_are_a_project_s_own() {
    let server = Server::with_tokens().await;
    let mut jobs = JobServiceClient::new(server.channel.clone());
    let mut names = Vec::new();
    for project in ["studio", "other", "default"] {
        let token = server.token(project, &[Embed]).await;
        let request = |bits| CreateJobRequest {
            request_id: REQUEST.into(),
            ..create(key_spec(bits))
        };
        let first = jobs
            .create_job(asking(&token, request(8)))
            .await
            .unwrap()
            .into_inner()
            .name;
        let again = jobs
            .create_job(asking(&token, request(8)))
            .await
            .unwrap()
            .into_inner()
            .name;
        assert_eq!(again, first);
        names.push(first);
        let status = jobs.create_job(asking(&token, request(9))).await.unwrap_err();
        let info = status.get_details_error_info().unwrap();
        assert_eq!(
            (info.reason.as_str(), info.metadata["request_id"].as_str()),
            ("REQUEST_ID_REUSED", REQUEST)
        );
    }
    assert!(names[0] != names[1] && names[1] != names[2]);
}

impl Server {
    /// Has a worker take the next job, which must be there.
    pub async fn take_as(&self, worker: &str) -> (Job, String) {
        let request = LeaseJobRequest {
            worker: "w".into(),
            wait: None,
            ..LeaseJobRequest::default()
        };
        let lease = self
            .worker
            .clone()
            .lease_job(asking(worker, request))
            .await
            .unwrap()
            .into_inner();
        (lease.job.expect("a job waits"), lease.lease_token)
    }

    /// Has a worker make the key that a job is to make.
    pub async fn finish_key(&self, job: &str, bits: u32, worker: &str) -> String {
        // Jobs of other projects wait too; they go back when this is done.
        let mut others = Vec::new();
        let lease_token = loop {
            let (taken, token) = self.take_as(worker).await;
            if taken.name == job {
                break token;
            }
            others.push((taken.name, token));
        };
        let file = b"the key file";
        let first = OutputMetadata {
            job: job.into(),
            lease_token: lease_token.clone(),
            upload: Some(metadata("key", file)),
            secret: true,
        };
        let payloads = [
            upload_output_request::Payload::Metadata(first),
            upload_output_request::Payload::Chunk(file.to_vec()),
        ];
        let messages = payloads.map(|payload| UploadOutputRequest { payload: Some(payload) });
        let upload = asking(worker, tokio_stream::iter(messages));
        let output = self
            .worker
            .clone()
            .upload_output(upload)
            .await
            .unwrap()
            .into_inner()
            .name;
        let complete = CompleteJobRequest {
            name: job.into(),
            lease_token,
            result: Some(Output::KeyOutput(key_output(bits, &output))),
            ..CompleteJobRequest::default()
        };
        self.worker
            .clone()
            .complete_job(asking(worker, complete))
            .await
            .unwrap();
        for (name, lease_token) in others {
            let release = asking(worker, ReleaseJobRequest { name, lease_token });
            self.worker.clone().release_job(release).await.unwrap();
        }
        let id = crate::service::names::ResourceKind::Job.parse("name", job).unwrap();
        let row = crate::ledger::JobStore::get_job(&*self.ledger(), id)
            .await
            .unwrap()
            .unwrap();
        match row.result {
            Some(crate::ledger::JobResult::CreateKey(result)) => result.key,
            other => panic!("{other:?}"),
        }
    }
}
