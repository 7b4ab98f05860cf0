//! What is wrong on the wire gets a clear answer, and the server goes on. The server's own tests have all the cases;
//! these go through its process, to its disk.
use std::time::Duration;

use guardsplat_proto::v1::artifact_service_client::ArtifactServiceClient;
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::upload_artifact_request::Payload;
use guardsplat_proto::v1::worker_service_client::WorkerServiceClient;
use guardsplat_proto::v1::{
    GetArtifactRequest, LeaseJobRequest, ListJobsRequest, UploadArtifactRequest, UploadMetadata,
};
use guardsplat_tests::process::until;
use guardsplat_tests::{Service, TestEnvironment};
use sha2::{Digest, Sha256};
use tokio_stream::StreamExt as _;
use tonic::{Code, Request, Status};
use tonic_types::StatusExt;

const MEBIBYTE: usize = 1 << 20;

fn part(payload: Payload) -> UploadArtifactRequest {
    UploadArtifactRequest { payload: Some(payload) }
}

fn metadata(data: &[u8]) -> Payload {
    Payload::Metadata(UploadMetadata {
        display_name: "scene.ply".into(),
        size_bytes: data.len() as i64,
        sha256: hex::encode(Sha256::digest(data)),
    })
}

/// The field that a refusal names.
#[track_caller]
fn field(status: &Status) -> String {
    assert_eq!(status.code(), Code::InvalidArgument, "{status}");
    let details = status.get_error_details();
    assert_eq!(details.error_info().unwrap().reason, "INVALID_FIELD");
    details.bad_request().unwrap().field_violations[0].field.clone()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn wrong_calls_are_told_what_is_wrong() {
    let service = Service::start(TestEnvironment::new(), "");
    let channel = service.channel().await;
    let mut artifacts = ArtifactServiceClient::new(channel.clone());
    let data = vec![7; MEBIBYTE + 1];
    let mut upload = async |first: Payload, chunk: Vec<u8>| {
        let parts = [part(first), part(Payload::Chunk(chunk))];
        artifacts.upload_artifact(tokio_stream::iter(parts)).await.unwrap_err()
    };
    // A chunk that is too long, even by one byte; bytes that are not those announced.
    assert_eq!(field(&upload(metadata(&data), data.clone()).await), "chunk");
    let mut damaged = data[..1000].to_vec();
    damaged[500] ^= 1;
    let status = upload(metadata(&data[..1000]), damaged).await;
    assert_eq!(field(&status), "metadata.sha256");
    assert!(
        status.message().contains("SHA-256") || status.message().contains("sha256"),
        "{status}"
    );
    // More than a message may hold.
    let status = upload(metadata(&data), vec![7; 5 * MEBIBYTE]).await;
    assert!(
        matches!(status.code(), Code::OutOfRange | Code::ResourceExhausted),
        "{status}"
    );
    service.keeps(0);

    for name in [
        "artifacts/../../ledger.sqlite",
        "../artifacts/x",
        "artifacts/",
        "artifacts/%2e%2e",
    ] {
        let status = artifacts
            .get_artifact(GetArtifactRequest { name: name.into() })
            .await
            .unwrap_err();
        assert_eq!(field(&status), "name", "{name}");
    }

    // A page token of another query.
    for bits in [8, 9] {
        service.submit(&format!("key create --bits {bits}"));
    }
    let mut jobs = JobServiceClient::new(channel.clone());
    let request = ListJobsRequest {
        page_size: 1,
        ..ListJobsRequest::default()
    };
    let page_token = jobs.list_jobs(request).await.unwrap().into_inner().next_page_token;
    let states = vec![1];
    let status = jobs
        .list_jobs(ListJobsRequest {
            page_size: 1,
            page_token,
            states,
            ..ListJobsRequest::default()
        })
        .await
        .unwrap_err();
    assert_eq!(field(&status), "page_token");

    // A deadline that passes; long polls are where it matters.
    for name in service.json("jobs list", 0)["jobs"].as_array().unwrap() {
        service.json(&format!("jobs cancel {}", name["name"].as_str().unwrap()), 0);
    }
    let mut request = Request::new(LeaseJobRequest {
        worker: "hasty".into(),
        wait: Duration::from_secs(30).try_into().ok(),
        ..LeaseJobRequest::default()
    });
    request.set_timeout(Duration::from_millis(200));
    let status = WorkerServiceClient::new(channel).lease_job(request).await.unwrap_err();
    assert!(
        matches!(status.code(), Code::DeadlineExceeded | Code::Cancelled),
        "{status}"
    );

    // A key that nobody made.
    service.environment.write("in.ply", "ply");
    let nobody = "keys/0190a5d0-0000-7000-8000-00000000000a";
    let error = &service.json(&format!("embed in.ply -o out.ply --key {nobody} --message 00"), 1)["error"];
    assert_eq!(
        (&error["code"], &error["resource"]),
        (&"NOT_FOUND".into(), &nobody.into()),
        "{error}"
    );
    service.keeps(0);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_upload_that_a_kill_cut_off_is_collected() {
    let mut service = Service::start(TestEnvironment::new(), "--abandoned-after-seconds 1");
    service.environment.write("whole.ply", "ply, and so on");
    let whole = service.json("artifact put whole.ply", 0);
    let data = vec![7; 3 * MEBIBYTE];
    let (sender, receiver) = tokio::sync::mpsc::channel(3);
    sender.send(part(metadata(&data))).await.unwrap();
    for chunk in data.chunks(MEBIBYTE).take(2) {
        sender.send(part(Payload::Chunk(chunk.to_vec()))).await.unwrap();
    }
    let mut artifacts = ArtifactServiceClient::new(service.channel().await);
    let upload = tokio::spawn(async move {
        let parts = tokio_stream::wrappers::ReceiverStream::new(receiver);
        artifacts.upload_artifact(parts.map(|part| part)).await
    });
    until("the first bytes are on disk", || {
        (service.kept().iter().sum::<u64>() > 100_000).then_some(())
    });
    service.kill();
    assert!(upload.await.unwrap().is_err());
    drop(sender);

    service.restart();
    until("what was left is collected", || {
        (service.kept().iter().sum::<u64>() < 1000).then_some(())
    });
    // What was whole is still there.
    let name = whole["name"].as_str().unwrap();
    service.json(&format!("artifact get {name} -o again.ply"), 0);
    assert_eq!(service.environment.read("again.ply"), b"ply, and so on");
}
