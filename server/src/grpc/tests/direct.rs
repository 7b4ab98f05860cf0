//! Uploads that go to the store without the server: what was announced becomes an artifact, and nothing else does.
use std::fs::{self, File};
use std::path::Path;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, SystemTime};

use guardsplat_proto::v1::{
    Artifact, DeleteArtifactRequest, FinishUploadRequest, GetArtifactRequest, StartUploadRequest, StartUploadResponse,
    UploadMetadata,
};
use tonic::{Code, Status};
use uuid::Uuid;

use super::harness::{
    MAX_ARTIFACT_BYTES, Server, invalid, metadata, not_found, refused, sha256, soon, upload_messages,
};
use super::stores::{bytes, download, server};
use crate::access::DEFAULT_PROJECT;
use crate::artifacts::ArtifactPath;
use crate::artifacts::tests::endpoint::Endpoint;
use crate::service::{Limits, clock};

const LIFETIME: Duration = Duration::from_secs(60);

fn limits() -> Limits {
    Limits {
        signed_url: Some(LIFETIME),
        ..Limits::default()
    }
}

async fn start(server: &Server, metadata: UploadMetadata) -> Result<StartUploadResponse, Status> {
    let request = StartUploadRequest {
        metadata: Some(metadata),
        in_parts: false,
    };
    Ok(server.artifacts.clone().start_upload(request).await?.into_inner())
}

/// As a client that knows nothing but HTTP.
async fn put(begun: &StartUploadResponse, bytes: &[u8]) {
    let mut request = reqwest::Client::new().put(&begun.url).body(bytes.to_vec());
    for header in &begun.headers {
        request = request.header(&header.name, &header.value);
    }
    let status = request.send().await.unwrap().status();
    assert!(status.is_success(), "{status}");
}

async fn finish(server: &Server, upload: &str) -> Result<Artifact, Status> {
    let request = FinishUploadRequest { upload: upload.into() };
    Ok(server.artifacts.clone().finish_upload(request).await?.into_inner())
}

/// Has a file look as if it were written so long ago.
fn age(path: &Path, age: Duration) {
    let file = File::options().write(true).open(path).unwrap();
    file.set_modified(SystemTime::now() - age).unwrap();
}

#[tokio::test]
async fn what_was_sent_to_the_store_becomes_an_artifact_that_never_changes() {
    let endpoint = Endpoint::start().await;
    let server = server(&endpoint, limits()).await;
    let sent = bytes(6 << 20, 1);
    let begun = start(&server, metadata("scène.ply", &sent)).await.unwrap();
    let now = clock::now();
    let end = clock::micros_of(&begun.expire_time.unwrap()).unwrap();
    assert!((now - 1_000_000..=now + clock::micros(LIFETIME)).contains(&end));
    put(&begun, &sent).await;
    let artifact = finish(&server, &begun.upload).await.unwrap();
    assert_eq!(
        (
            artifact.display_name.as_str(),
            artifact.size_bytes,
            artifact.sha256.as_str()
        ),
        ("scène.ply", 6 << 20, sha256(&sent).as_str())
    );
    assert!(download(&server, &artifact.name).await.unwrap() == sent);
    assert_eq!(endpoint.objects().len(), 1, "what was sent is not kept twice");

    // The address is good for a while.
    put(&begun, &bytes(6 << 20, 2)).await;
    assert!(download(&server, &artifact.name).await.unwrap() == sent);
    // The answer was lost.
    assert_eq!(finish(&server, &begun.upload).await.unwrap(), artifact);
    assert!(download(&server, &artifact.name).await.unwrap() == sent);
    assert_eq!(endpoint.objects().len(), 1);

    let name = artifact.name.clone();
    let mut client = server.artifacts.clone();
    client.delete_artifact(DeleteArtifactRequest { name }).await.unwrap();
    assert_eq!(invalid(finish(&server, &begun.upload).await), ["upload"]);
    assert!(endpoint.objects().is_empty());
}

#[tokio::test]
async fn what_was_not_announced_is_not_taken() {
    let endpoint = Endpoint::start().await;
    let server = server(&endpoint, limits()).await;
    // What housekeeping asks at its start is not counted below.
    soon("the first generation", async || {
        endpoint.path("artifacts/generation").exists()
    })
    .await;
    let right = bytes(3000, 1);
    let begun = start(&server, metadata("scene.ply", &right)).await.unwrap();
    let told = async || {
        let status = finish(&server, &begun.upload).await.unwrap_err();
        let text = status.message().to_owned();
        assert_eq!(invalid(Err::<(), _>(status)), ["upload"]);
        assert!(endpoint.objects().is_empty(), "{:?}", endpoint.objects());
        text
    };
    assert_eq!(
        told().await,
        "upload: nothing was sent to its address, and 3000 bytes were announced"
    );
    for length in [2999, 3001, MAX_ARTIFACT_BYTES as usize + 1] {
        put(&begun, &bytes(length, 1)).await;
        let before = endpoint.faults.requests.load(Relaxed);
        assert_eq!(
            told().await,
            format!("upload: 3000 bytes were announced, and {length} are there")
        );
        let asked = endpoint.faults.requests.load(Relaxed) - before;
        assert_eq!(asked, 2, "it is looked at and deleted, not copied, and not read");
    }
    let wrong = bytes(3000, 2);
    put(&begun, &wrong).await;
    let text = told().await;
    assert!(
        text.contains(&sha256(&wrong)) && text.contains(&sha256(&right)),
        "{text}"
    );
    // None of it is in the way of the right ones.
    put(&begun, &right).await;
    let name = finish(&server, &begun.upload).await.unwrap().name;
    assert!(download(&server, &name).await.unwrap() == right);
}

/// The same call from a client that did not wait: one artifact, and nothing beside it.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_upload_that_is_finished_at_once_by_many_is_one_artifact() {
    let endpoint = Endpoint::start().await;
    let server = server(&endpoint, limits()).await;
    let sent = bytes(9000, 1);
    let begun = start(&server, metadata("scene.ply", &sent)).await.unwrap();
    put(&begun, &sent).await;
    endpoint.faults.latency.store(10, Relaxed);
    let answers = futures::future::join_all((0..6).map(|_| finish(&server, &begun.upload))).await;
    let names: Vec<_> = answers.into_iter().map(|answer| answer.unwrap().name).collect();
    assert!(names.iter().all(|name| *name == names[0]), "{names:?}");
    assert!(download(&server, &names[0]).await.unwrap() == sent);
    assert_eq!(endpoint.objects().len(), 1, "{:?}", endpoint.objects());
}

#[tokio::test]
async fn limits_are_those_of_other_uploads() {
    let endpoint = Endpoint::start().await;
    let quota = Limits {
        max_bytes_of_project: Some(10),
        ..limits()
    };
    let server = server(&endpoint, quota).await;
    let wrong = UploadMetadata {
        display_name: "../x".into(),
        size_bytes: MAX_ARTIFACT_BYTES as i64 + 1,
        sha256: "x".into(),
    };
    let fields = invalid(start(&server, wrong.clone()).await);
    assert_eq!(fields, ["metadata.display_name", "metadata.sha256"]);
    let large = UploadMetadata {
        size_bytes: wrong.size_bytes,
        ..metadata("a.ply", b"a")
    };
    assert_eq!(invalid(start(&server, large).await), ["metadata.size_bytes"]);
    let nothing = server
        .artifacts
        .clone()
        .start_upload(StartUploadRequest::default())
        .await;
    assert_eq!(invalid(nothing), ["metadata"]);
    for upload in ["", "uploads", "artifacts/1"] {
        assert_eq!(invalid(finish(&server, upload).await), ["upload"], "{upload}");
    }
    assert_eq!(not_found(finish(&server, "uploads/R1NTTA").await), "uploads/R1NTTA");
    // Both fit, but not together.
    let first = start(&server, metadata("scene.ply", b"scene 1")).await.unwrap();
    put(&first, b"scene 1").await;
    let second = start(&server, metadata("scene.ply", b"scene 2")).await;
    refused(second, Code::ResourceExhausted, "QUOTA_USED_UP");
    finish(&server, &first.upload).await.unwrap();
    assert_eq!(endpoint.objects().len(), 1);
    let third = start(&server, metadata("scene.ply", b"scene 3")).await;
    refused(third, Code::ResourceExhausted, "QUOTA_USED_UP");
}

/// What is begun counts from then on, also for other uploads, and is given back when nothing more can come of it.
#[tokio::test]
async fn what_is_begun_counts_until_nothing_can_come_of_it() {
    let endpoint = Endpoint::start().await;
    let quota = Limits {
        max_bytes_of_project: Some(10),
        signed_url: Some(Duration::from_secs(2)),
        abandoned_after: Duration::from_secs(60),
        ..Limits::default()
    };
    let server = server(&endpoint, quota).await;
    let used = async || server.ledger().usage(DEFAULT_PROJECT).await.unwrap().bytes();
    let begun = start(&server, metadata("scene.ply", b"scene 1")).await.unwrap();
    let beside = upload_messages(metadata("scene.ply", b"scene 2"), b"scene 2");
    let beside = server
        .artifacts
        .clone()
        .upload_artifact(tokio_stream::iter(beside))
        .await;
    refused(beside, Code::ResourceExhausted, "QUOTA_USED_UP");
    // One that is refused may be sent again while its address is good, so its bytes stay reserved for so long.
    put(&begun, b"scene 3").await;
    assert_eq!(invalid(finish(&server, &begun.upload).await), ["upload"]);
    put(&begun, b"scene 3").await;
    server.api.end_reservations().await.unwrap();
    assert_eq!((used().await, endpoint.objects().len()), (7, 1));
    tokio::time::sleep(Duration::from_millis(2100)).await;
    server.api.end_reservations().await.unwrap();
    assert_eq!((used().await, endpoint.objects().len()), (0, 0));
    server.upload("scene.ply", b"scene 2").await;
}

#[tokio::test]
async fn without_an_address_the_server_is_the_way() {
    let endpoint = Endpoint::start().await;
    for without in [server(&endpoint, Limits::default()).await, Server::with(limits()).await] {
        let begun = start(&without, metadata("scene.ply", b"a scene")).await.unwrap();
        assert_eq!(begun, StartUploadResponse::default());
    }
}

/// What nobody finishes goes when it can't be finished any more, and not before.
#[tokio::test]
async fn what_nobody_finishes_is_collected() {
    let endpoint = Endpoint::start().await;
    let longest = Duration::from_secs(60);
    let server = server(
        &endpoint,
        Limits {
            abandoned_after: longest,
            ..limits()
        },
    )
    .await;
    let object = |path: ArtifactPath| endpoint.path(&format!("artifacts/{path}"));
    // Begun when it could just be finished still, and a moment earlier.
    let begun = async |before: Duration| {
        let id = Uuid::now_v7();
        let time = clock::now() - clock::micros(before);
        let name = server
            .api
            .name_of_upload(DEFAULT_PROJECT, id, time, metadata("a.ply", b"left"), false);
        let path = object(ArtifactPath::staged(id));
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, b"left").unwrap();
        age(&path, before);
        (name.unwrap(), path)
    };
    let (late, late_path) = begun(longest).await;
    let (in_time, _) = begun(longest - Duration::from_secs(20)).await;
    // A copy of a call that went away, young and old.
    let copies = [90, 130].map(|seconds| {
        let path = object(ArtifactPath::taken(Uuid::now_v7(), Uuid::now_v7()));
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, b"left").unwrap();
        age(&path, Duration::from_secs(seconds));
        path
    });
    server.api.collect_orphans().await.unwrap();
    assert!(late_path.exists() && copies[0].exists() && !copies[1].exists());
    refused(finish(&server, &late).await, Code::Aborted, "UPLOAD_TOO_SLOW");
    let kept = finish(&server, &in_time).await.unwrap().name;

    for path in endpoint.objects() {
        age(&path, 2 * longest + Duration::from_secs(1));
    }
    server.api.collect_orphans().await.unwrap();
    assert_eq!(endpoint.objects().len(), 1);
    assert_eq!(download(&server, &kept).await.unwrap(), b"left");
    let request = GetArtifactRequest { name: kept };
    server.artifacts.clone().get_artifact(request).await.unwrap();
}
