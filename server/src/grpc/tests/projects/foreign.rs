//! Two projects on one server: every call by one about what is the other's.
use guardsplat_proto::v1::asset::Original;
use guardsplat_proto::v1::job::{Spec, State};
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::*;
use prost::Message;

use super::super::calls::{asking, call, paths};
use super::super::harness::{Server, not_found, sha256, verify_spec};
use super::{Project, SCENE, asset, create, embed};
use crate::access::Scope::Worker;

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
                        original: other.artifact.clone(),
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
