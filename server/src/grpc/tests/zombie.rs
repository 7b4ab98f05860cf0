//! A worker that was given up comes back: nothing of what it says counts.
use std::time::Duration;

use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::failure::Reason;
use guardsplat_proto::v1::job::State;
use guardsplat_proto::v1::{
    DownloadKeyRequest, EmbedResult, FailJobRequest, Failure, ReleaseJobRequest, ReportJobRequest,
};
use tonic::Code;

use super::harness::{Server, invalid, key_output, key_spec, refused};
use crate::service::Limits;

#[tokio::test]
async fn a_server_that_was_away_takes_no_lease() {
    let limits = Limits {
        lease: Duration::from_secs(1),
        ..Limits::default()
    };
    let server = Server::with(limits.clone()).await;
    let name = server.create(key_spec(8)).await.name;
    let (_, token) = server.take().await;
    let server = server.restart_after(Duration::from_millis(1500), limits).await;
    // Its housekeeping has looked for leases that expired.
    tokio::time::sleep(Duration::from_millis(500)).await;
    let report = ReportJobRequest {
        name: name.clone(),
        lease_token: token.clone(),
        progress: None,
    };
    server.worker.clone().report_job(report).await.unwrap();
    let file = server.stored(&name, &token, b"key", true).await;
    let output = Output::KeyOutput(key_output(8, &file));
    server.complete(&name, &token, output).await.unwrap();
    assert_eq!(server.job(&name).await.attempt, 1);
}

#[tokio::test]
async fn a_zombie_is_refused_everywhere() {
    let limits = Limits {
        lease: Duration::from_secs(1),
        ..Limits::default()
    };
    let server = Server::with(limits).await;
    let name = server.embed_job().await.name;
    let (_, zombie) = server.take().await;
    let scene = server.stored(&name, &zombie, b"of the zombie", false).await;
    let comparison = server.stored(&name, &zombie, b"its picture", false).await;
    // It stops. Its lease expires, and another worker gets the job.
    let lease = server.lease(Duration::from_secs(20)).await;
    let (job, token) = (lease.job.unwrap(), lease.lease_token);
    assert_eq!((job.name.as_str(), job.attempt), (name.as_str(), 2));

    let lost = "LEASE_LOST";
    let mut worker = server.worker.clone();
    let report = ReportJobRequest {
        name: name.clone(),
        lease_token: zombie.clone(),
        progress: None,
    };
    let details = refused(worker.report_job(report).await, Code::Aborted, lost);
    assert_eq!(details.error_info().unwrap().metadata["name"], name);
    let key = DownloadKeyRequest {
        job: name.clone(),
        lease_token: zombie.clone(),
    };
    refused(worker.download_key(key).await, Code::Aborted, lost);
    refused(server.output(&name, &zombie, b"late", false).await, Code::Aborted, lost);
    let result = |scene: &str| {
        let (scene, comparison) = (scene.into(), comparison.clone());
        Output::EmbedResult(EmbedResult {
            scene,
            comparison,
            ..Default::default()
        })
    };
    refused(
        server.complete(&name, &zombie, result(&scene)).await,
        Code::Aborted,
        lost,
    );
    let failure = Some(Failure {
        reason: Reason::Internal.into(),
        message: String::new(),
    });
    let fail = FailJobRequest {
        name: name.clone(),
        lease_token: zombie.clone(),
        failure,
        ..Default::default()
    };
    refused(worker.fail_job(fail).await, Code::Aborted, lost);
    let release = ReleaseJobRequest {
        name: name.clone(),
        lease_token: zombie,
    };
    refused(worker.release_job(release).await, Code::Aborted, lost);
    // Nor can its successor pass off what the zombie made.
    assert_eq!(
        invalid(server.complete(&name, &token, result(&scene)).await),
        ["result"]
    );
    assert_eq!(server.job(&name).await.state(), State::Running);

    let report = ReportJobRequest {
        name: name.clone(),
        lease_token: token.clone(),
        progress: None,
    };
    worker.report_job(report).await.unwrap();
    let scene = server.stored(&name, &token, b"marked", false).await;
    let comparison = server.stored(&name, &token, b"picture", false).await;
    let result = EmbedResult {
        scene,
        comparison,
        ..Default::default()
    };
    server
        .complete(&name, &token, Output::EmbedResult(result))
        .await
        .unwrap();
    assert_eq!(server.job(&name).await.state(), State::Succeeded);
}
