//! What the token of a worker or of a project may do, and whose a request id is.
use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::*;
use prost::Message;
use tonic::{Code, Status};
use tonic_types::StatusExt;

use super::super::calls::{asking, call};
use super::super::harness::{Server, key_spec, not_found, refused, verify_spec};
use super::{Project, REQUEST, create, embed};
use crate::access::Scope::{Embed, Verify, Worker};

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
