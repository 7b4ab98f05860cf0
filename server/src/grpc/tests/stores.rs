//! Artifacts in S3: jobs through a bucket, two servers that share one, a bucket that fails.
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use futures::StreamExt;
use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::job::{Spec, State};
use guardsplat_proto::v1::{
    Artifact, DeleteArtifactRequest, DownloadArtifactRequest, DownloadKeyRequest, EmbedResult, EmbedSpec,
    GetArtifactRequest, GetDownloadUrlRequest, download_artifact_response::Payload,
};
use tempfile::TempDir;
use tonic::{Code, Status};
use uuid::Uuid;

use super::harness::{MAX_ARTIFACT_BYTES, Server, metadata, not_found, sha256, soon, upload_messages};
use crate::artifacts::tests::endpoint::{BUCKET, Endpoint};
use crate::artifacts::{Announced, ArtifactPath, ArtifactStore, Place};
use crate::ledger::{SqliteLedger, postgres};
use crate::service::{Limits, clock};

/// How many jobs the test of faults has, where this is set.
const JOBS_VARIABLE: &str = "GUARDSPLAT_STORE_JOBS";
/// Jobs that are under way at the same time.
const AT_ONCE: usize = 8;

pub fn bucket(endpoint: &Endpoint) -> ArtifactStore {
    let place = Place::parse(&format!("s3://{BUCKET}/artifacts")).unwrap();
    let abandoned = Duration::from_secs(60);
    ArtifactStore::open_at(&place, endpoint.environment(), abandoned, MAX_ARTIFACT_BYTES).unwrap()
}

pub async fn server(endpoint: &Endpoint, limits: Limits) -> Server {
    let folder = TempDir::new().unwrap();
    let ledger = SqliteLedger::open(&folder.path().join("ledger.sqlite")).await.unwrap();
    Server::with_store(Arc::new(ledger), bucket(endpoint), folder, limits, false).await
}

pub fn bytes(count: usize, seed: usize) -> Vec<u8> {
    let mixed = |i: usize| (i + seed).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 56;
    (0..count).map(|i| mixed(i) as u8).collect()
}

pub async fn download(server: &Server, name: &str) -> Result<Vec<u8>, Status> {
    let request = DownloadArtifactRequest {
        name: name.into(),
        offset: 0,
    };
    let mut stream = server.artifacts.clone().download_artifact(request).await?.into_inner();
    let mut bytes = Vec::new();
    while let Some(message) = stream.message().await? {
        if let Some(Payload::Chunk(chunk)) = message.payload {
            bytes.extend(chunk);
        }
    }
    Ok(bytes)
}

fn embed(scene: &str, key: &str) -> Spec {
    Spec::Embed(EmbedSpec {
        scene: scene.into(),
        key: key.into(),
        message: "beef".into(),
        ..EmbedSpec::default()
    })
}

fn made(scene: &str, comparison: &str) -> Output {
    Output::EmbedResult(EmbedResult {
        scene: scene.into(),
        comparison: comparison.into(),
        bit_accuracy: 1.0,
        bit_accuracy_worst_view: 1.0,
        message: "beef".into(),
        message_recovered: true,
        ssim: 0.9,
        ..EmbedResult::default()
    })
}

#[tokio::test]
async fn a_job_goes_through_a_bucket() {
    let endpoint = Endpoint::start().await;
    let server = server(&endpoint, Limits::default()).await;
    let key = server.key(16, b"the secret of the key").await;
    let sent = bytes(7 << 20, 1);
    let scene = server.upload("scene.ply", &sent).await.name;
    let job = server.create(embed(&scene, &key)).await;
    let (leased, token) = server.take().await;
    assert_eq!(leased.name, job.name);
    assert!(download(&server, &scene).await.unwrap() == sent);
    let request = DownloadKeyRequest {
        job: job.name.clone(),
        lease_token: token.clone(),
    };
    let mut key_file = Vec::new();
    let mut stream = server.worker.clone().download_key(request).await.unwrap().into_inner();
    while let Some(message) = stream.message().await.unwrap() {
        key_file.extend(message.chunk);
    }
    assert_eq!(key_file, b"the secret of the key");
    let marked = bytes(6 << 20, 2);
    let output = server.stored(&job.name, &token, &marked, false).await;
    let picture = server.stored(&job.name, &token, b"a picture", false).await;
    let done = server.complete(&job.name, &token, made(&output, &picture)).await;
    done.unwrap();
    assert!(download(&server, &output).await.unwrap() == marked);
    assert!(server.files().is_empty(), "nothing is on this machine's disk");
    let objects = endpoint.objects();
    assert_eq!((objects.len(), endpoint.parts().len()), (4, 0));
    for object in objects {
        let stored = std::fs::read(object).unwrap();
        assert!(!stored.windows(10).any(|part| part == b"the secret"));
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_one_server_takes_another_gives_out() {
    let Some(place) = postgres::tests::Place::fresh().await else {
        return;
    };
    let endpoint = Endpoint::start().await;
    let folder = TempDir::new().unwrap();
    let limits = Limits::default();
    let one = Server::with_store(place.ledger().await, bucket(&endpoint), folder, limits.clone(), false).await;
    let folder = one.folder_of_a_twin();
    let two = Server::with_store(place.ledger().await, bucket(&endpoint), folder, limits, false).await;
    let sent = bytes(6 << 20, 3);
    let scene = one.upload("scene.ply", &sent).await.name;
    assert!(download(&two, &scene).await.unwrap() == sent);
    // Submitted at one, carried out at the other.
    let key = two.key(16, b"key").await;
    let job = one.create(embed(&scene, &key)).await.name;
    let (_, token) = two.take().await;
    let output = two.stored(&job, &token, b"marked", false).await;
    let picture = two.stored(&job, &token, b"a picture", false).await;
    two.complete(&job, &token, made(&output, &picture)).await.unwrap();
    assert_eq!(one.job(&job).await.state(), State::Succeeded);
    assert_eq!(download(&one, &output).await.unwrap(), b"marked");
    let before = endpoint.objects().len();
    let request = DeleteArtifactRequest { name: scene.clone() };
    two.artifacts.clone().delete_artifact(request).await.unwrap();
    not_found(download(&one, &scene).await);
    assert_eq!(endpoint.objects().len(), before - 1);
}

#[tokio::test]
async fn an_address_is_given_where_the_operator_says_so() {
    let endpoint = Endpoint::start().await;
    let lifetime = Duration::from_secs(60);
    let limits = Limits {
        signed_url: Some(lifetime),
        ..Limits::default()
    };
    let address = async |server: &Server, artifact: &Artifact| {
        let name = artifact.name.clone();
        let answer = server
            .artifacts
            .clone()
            .get_download_url(GetDownloadUrlRequest { name })
            .await;
        let answer = answer.unwrap().into_inner();
        assert_eq!(answer.artifact.as_ref(), Some(artifact));
        answer
    };
    let with = server(&endpoint, limits.clone()).await;
    let scene = with.upload("scene.ply", b"a scene").await;
    let answer = address(&with, &scene).await;
    let now = clock::now();
    let end = clock::micros_of(&answer.expire_time.unwrap()).unwrap();
    assert!((now..=now + clock::micros(lifetime)).contains(&end));
    let fetched = reqwest::get(&answer.url).await.unwrap().bytes().await.unwrap();
    assert_eq!(fetched[..], b"a scene"[..]);
    for without in [server(&endpoint, Limits::default()).await, Server::with(limits).await] {
        let scene = without.upload("scene.ply", b"a scene").await;
        let answer = address(&without, &scene).await;
        assert_eq!((answer.url.as_str(), answer.expire_time), ("", None));
    }
}

/// Calls until the store is there for it.
async fn persist<T>(mut call: impl AsyncFnMut() -> Result<T, Status>) -> T {
    for _ in 0..50 {
        match call().await {
            Ok(answer) => return answer,
            Err(status) => assert_eq!(status.code(), Code::Unavailable, "{status:?}"),
        }
    }
    panic!("never there")
}

/// A scene sent, a job made of it, what it makes fetched; the names of all that is there then, with the bytes.
async fn one_job(server: &Server, key: &str, i: usize) -> Vec<(String, Vec<u8>)> {
    let size = match i % 25 {
        0 => 6 << 20, // in parts
        _ => 1000 + i * 97 % 200_000,
    };
    let (sent, marked, picture) = (bytes(size, i), bytes(size / 2 + 1, i + 1), bytes(700 + i, i));
    let upload = async || {
        let messages = tokio_stream::iter(upload_messages(metadata("scene.ply", &sent), &sent));
        server.artifacts.clone().upload_artifact(messages).await
    };
    let scene = persist(upload).await.into_inner().name;
    server.create(embed(&scene, key)).await;
    // Any job: the one of another may have come first.
    let (job, token) = server.take().await;
    let Some(Spec::Embed(spec)) = &job.spec else {
        panic!("{job:?}")
    };
    persist(async || download(server, &spec.scene).await).await;
    let mut outputs = Vec::new();
    for made in [&marked, &picture] {
        let output = persist(async || server.output(&job.name, &token, made, false).await).await;
        outputs.push(output.into_inner().name);
    }
    let result = made(&outputs[0], &outputs[1]);
    server.complete(&job.name, &token, result).await.unwrap();
    let names = [scene].into_iter().chain(outputs);
    names.zip([sent, marked, picture]).collect()
}

/// Every twentieth request fails, in one of three ways, and all of them are slow: jobs are done nevertheless, each
/// artifact that is seen is whole, and no other is seen.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn jobs_get_through_a_bucket_that_fails() {
    let jobs: Option<usize> = std::env::var(JOBS_VARIABLE).ok().map(|jobs| jobs.parse().unwrap());
    let endpoint = Endpoint::start().await;
    let limits = Limits {
        // Nobody reports here.
        lease: Duration::from_secs(600),
        ..Limits::default()
    };
    let server = server(&endpoint, limits).await;
    let key = server.key(16, b"key").await;
    let faults = &endpoint.faults;
    for (kind, share) in [(&faults.refused, 20), (&faults.unanswered, 15), (&faults.cut, 15)] {
        kind.store(share, Relaxed);
    }
    faults.latency.store(if jobs.is_some() { 500 } else { 20 }, Relaxed);
    let jobs = jobs.unwrap_or(30);
    let began = std::time::Instant::now();
    let each = futures::stream::iter(0..jobs).map(|i| one_job(&server, &key, i));
    let all: Vec<_> = each.buffer_unordered(AT_ONCE).concat().await;
    let took = began.elapsed();
    let (requests, failed) = (faults.requests.load(Relaxed), faults.faults.load(Relaxed));
    for share in [&faults.refused, &faults.unanswered, &faults.cut, &faults.latency] {
        share.store(0, Relaxed);
    }
    assert_eq!(all.len(), 3 * jobs);
    for (name, expected) in &all {
        let request = GetArtifactRequest { name: name.clone() };
        let artifact = server
            .artifacts
            .clone()
            .get_artifact(request)
            .await
            .unwrap()
            .into_inner();
        let found = download(&server, name).await.unwrap();
        assert_eq!((sha256(&found), found.len()), (artifact.sha256, expected.len()));
        assert!(found == *expected, "{name} has other bytes");
    }
    // Whatever lies there is whole, also where the server was told that it could not be written.
    let objects = endpoint.objects();
    for object in &objects {
        let found = std::fs::read(object).unwrap();
        let sealed = found.len() < 200;
        assert!(
            sealed || all.iter().any(|(_, bytes)| *bytes == found),
            "{}",
            object.display()
        );
    }
    assert!(failed > 0, "nothing failed");
    println!(
        "{jobs} jobs in {took:.1?}: {requests} requests, {failed} failed; {} objects, {} of them left for housekeeping, \
         {} parts",
        objects.len(),
        objects.len() - 3 * jobs - 1,
        endpoint.parts().len()
    );
}

#[tokio::test]
async fn a_bucket_that_is_away_is_told_as_not_available() {
    let endpoint = Endpoint::start().await;
    let server = server(&endpoint, Limits::default()).await;
    let scene = server.upload("scene.ply", b"a scene").await.name;
    endpoint.end();
    let (read, sent) = tokio::join!(download(&server, &scene), async {
        let messages = upload_messages(metadata("a.ply", b"another"), b"another");
        server
            .artifacts
            .clone()
            .upload_artifact(tokio_stream::iter(messages))
            .await
    });
    for status in [read.unwrap_err(), sent.unwrap_err()] {
        assert_eq!(
            (status.code(), status.message()),
            (Code::Unavailable, "the artifact store is not available")
        );
    }
}

/// Bytes without a row go when they are old; what has a row, is young, or is none of ours stays.
#[tokio::test]
async fn bytes_that_nothing_points_at_are_collected() {
    let endpoint = Endpoint::start().await;
    let limits = Limits {
        abandoned_after: Duration::from_secs(2),
        ..Limits::default()
    };
    let server = server(&endpoint, limits).await;
    let kept = server.upload("kept.ply", b"kept").await.name;
    let left = async || {
        let path = ArtifactPath::upload(Uuid::now_v7());
        let mut writer = server.api.store().write(&path, Announced::of(b"left")).await.unwrap();
        writer.chunk(b"left".to_vec()).await.unwrap();
        writer.finish().await.unwrap();
    };
    left().await;
    std::fs::write(endpoint.path("artifacts/uploads/holiday.jpg"), "a beach").unwrap();
    server.api.collect_orphans().await.unwrap();
    assert_eq!(endpoint.objects().len(), 3, "all are young");
    tokio::time::sleep(Duration::from_millis(3100)).await;
    left().await;
    soon("the end of what is old", async || {
        server.api.collect_orphans().await.unwrap();
        endpoint.objects().len() == 3
    })
    .await;
    assert_eq!(download(&server, &kept).await.unwrap(), b"kept");
    assert!(endpoint.path("artifacts/uploads/holiday.jpg").exists());
}
