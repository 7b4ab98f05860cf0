//! Backup and restore with the program itself: taken while it is written to, and everything found again by its hash.
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use guardsplat_proto::v1::artifact_service_client::ArtifactServiceClient;
use guardsplat_proto::v1::asset::Original;
use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::download_artifact_response::Payload as Part;
use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::registry_service_client::RegistryServiceClient;
use guardsplat_proto::v1::upload_artifact_request::Payload;
use guardsplat_proto::v1::worker_service_client::WorkerServiceClient;
use guardsplat_proto::v1::{
    Artifact, Asset, CompleteJobRequest, CreateAssetRequest, CreateJobRequest, CreateOwnerRequest,
    DeleteArtifactRequest, DownloadArtifactRequest, DownloadKeyRequest, GetAssetRequest, GetHeadRequest, Job, Key,
    KeyOutput, KeyResult, KeySpec, LeaseJobRequest, LeaseJobResponse, OutputMetadata, Owner, UploadArtifactRequest,
    UploadMetadata, UploadOutputRequest, VerifySpec, upload_output_request,
};
use sha2::{Digest, Sha256};
use tonic::transport::Channel;
use tonic::{Code, Status};

use super::support::Bench;

const KEY_FILE: &[u8] = b"the key file, which nobody sees";

fn sha256(bytes: &[u8]) -> String {
    hex::encode(Sha256::digest(bytes))
}

fn metadata(bytes: &[u8]) -> UploadMetadata {
    UploadMetadata {
        display_name: "scene.ply".into(),
        size_bytes: bytes.len() as i64,
        sha256: sha256(bytes),
    }
}

/// Some bytes that are no others'.
fn bytes(n: u32) -> Vec<u8> {
    n.to_le_bytes().repeat(5_000)
}

async fn upload(channel: &Channel, bytes: Vec<u8>) -> Result<Artifact, Status> {
    let parts = [Payload::Metadata(metadata(&bytes)), Payload::Chunk(bytes)];
    let parts = parts.map(|payload| UploadArtifactRequest { payload: Some(payload) });
    let mut artifacts = ArtifactServiceClient::new(channel.clone());
    let sent = artifacts.upload_artifact(tokio_stream::iter(parts)).await;
    sent.map(tonic::Response::into_inner)
}

/// SHA-256 of an artifact's bytes.
async fn downloaded(channel: &Channel, name: &str) -> Result<String, Status> {
    let request = DownloadArtifactRequest {
        name: name.into(),
        offset: 0,
    };
    let mut artifacts = ArtifactServiceClient::new(channel.clone());
    let mut parts = artifacts.download_artifact(request).await?.into_inner();
    let mut hash = Sha256::new();
    while let Some(part) = parts.message().await? {
        if let Some(Part::Chunk(chunk)) = part.payload {
            hash.update(&chunk);
        }
    }
    Ok(hex::encode(hash.finalize()))
}

async fn lease(channel: &Channel) -> LeaseJobResponse {
    let request = LeaseJobRequest {
        worker: "stub".into(),
        ..LeaseJobRequest::default()
    };
    let mut worker = WorkerServiceClient::new(channel.clone());
    worker.lease_job(request).await.unwrap().into_inner()
}

async fn submit(channel: &Channel, spec: Spec) -> Job {
    let request = CreateJobRequest {
        job: Some(Job {
            spec: Some(spec),
            ..Job::default()
        }),
        request_id: String::new(),
    };
    let mut jobs = JobServiceClient::new(channel.clone());
    jobs.create_job(request).await.unwrap().into_inner()
}

/// Has a job make a key, as a worker would.
async fn make_key(channel: &Channel) -> String {
    let made = submit(
        channel,
        Spec::CreateKey(KeySpec {
            bits: 64,
            seed: None,
            ..KeySpec::default()
        }),
    )
    .await;
    let LeaseJobResponse { lease_token, .. } = lease(channel).await;
    let first = OutputMetadata {
        job: made.name.clone(),
        lease_token: lease_token.clone(),
        upload: Some(metadata(KEY_FILE)),
        secret: true,
    };
    let parts = [
        upload_output_request::Payload::Metadata(first),
        upload_output_request::Payload::Chunk(KEY_FILE.to_vec()),
    ];
    let parts = parts.map(|payload| UploadOutputRequest { payload: Some(payload) });
    let mut worker = WorkerServiceClient::new(channel.clone());
    let file = worker.upload_output(tokio_stream::iter(parts)).await.unwrap();
    let output = KeyOutput {
        key_file: file.into_inner().name,
        key: Some(Key {
            bits: 64,
            clip: "a clip".into(),
            clip_sha256: sha256(b"weights"),
            ..Key::default()
        }),
        result: Some(KeyResult::default()),
    };
    let done = CompleteJobRequest {
        name: made.name,
        lease_token,
        result: Some(Output::KeyOutput(output)),
        ..CompleteJobRequest::default()
    };
    worker.complete_job(done).await.unwrap();
    let mut keys = guardsplat_proto::v1::key_service_client::KeyServiceClient::new(channel.clone());
    let listed = keys.list_keys(guardsplat_proto::v1::ListKeysRequest::default()).await;
    listed.unwrap().into_inner().keys[0].name.clone()
}

async fn register(channel: &Channel, key: &str, sha256: &str) -> Asset {
    let mut registry = RegistryServiceClient::new(channel.clone());
    let owner = CreateOwnerRequest {
        owner: Some(Owner {
            display_name: "studio".into(),
            ..Owner::default()
        }),
        request_id: String::new(),
    };
    let owner = registry.create_owner(owner).await.unwrap().into_inner().name;
    let asset = CreateAssetRequest {
        asset: Some(Asset {
            owner,
            key: key.into(),
            original: Some(Original::Sha256(sha256.into())),
            ..Asset::default()
        }),
        request_id: String::new(),
    };
    registry.create_asset(asset).await.unwrap().into_inner()
}

/// Uploads, and deletes every third, until told to end: what was acknowledged, with its hash.
async fn write(channel: Channel, first: u32, end: Arc<AtomicBool>) -> Vec<(String, String)> {
    let mut kept = Vec::new();
    let mut artifacts = ArtifactServiceClient::new(channel.clone());
    for n in first.. {
        if end.load(Ordering::Relaxed) {
            break;
        }
        let artifact = upload(&channel, bytes(n)).await.unwrap();
        if n % 3 == 0 {
            let request = DeleteArtifactRequest { name: artifact.name };
            artifacts.delete_artifact(request).await.unwrap();
        } else {
            kept.push((artifact.name, artifact.sha256));
        }
    }
    kept
}

/// A server on a folder that a backup was restored to has it all.
async fn check(bench: &Bench, before: &[(String, String)], after: &[(String, String)], asset: &Asset) {
    let server = bench.start().await;
    let channel = server.channel().await;
    for (name, sha256) in before {
        assert_eq!(&downloaded(&channel, name).await.unwrap(), sha256, "{name}");
    }
    // What came while the backup was taken is there in whole or not at all.
    for (name, sha256) in after {
        match downloaded(&channel, name).await {
            Ok(found) => assert_eq!(&found, sha256, "{name}"),
            Err(status) => assert_eq!(status.code(), Code::NotFound, "{name}: {status}"),
        }
    }
    let mut registry = RegistryServiceClient::new(channel.clone());
    let request = GetAssetRequest {
        name: asset.name.clone(),
    };
    assert_eq!(&registry.get_asset(request).await.unwrap().into_inner(), asset);
    let head = registry.get_head(GetHeadRequest::default()).await.unwrap().into_inner();
    assert_eq!(head.name, asset.commitment);
    // The key opens, so the master key is the one.
    submit(
        &channel,
        Spec::Verify(VerifySpec {
            suspects: vec![before[0].0.clone()],
            key: asset.key.clone(),
            ..VerifySpec::default()
        }),
    )
    .await;
    let LeaseJobResponse { job, lease_token, .. } = lease(&channel).await;
    let request = DownloadKeyRequest {
        job: job.unwrap().name,
        lease_token,
    };
    let mut worker = WorkerServiceClient::new(channel);
    let mut parts = worker.download_key(request).await.unwrap().into_inner();
    assert_eq!(parts.message().await.unwrap().unwrap().chunk, KEY_FILE);
    assert_eq!(server.stop().await.code(), Some(0));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_backup_of_a_server_at_work_has_everything() {
    let bench = Bench::new();
    let server = bench.start().await;
    let channel = server.channel().await;
    let mut before = Vec::new();
    for n in 0..20 {
        let artifact = upload(&channel, bytes(n)).await.unwrap();
        before.push((artifact.name, artifact.sha256));
    }
    let key = make_key(&channel).await;
    let asset = register(&channel, &key, &before[0].1).await;
    let end = Arc::new(AtomicBool::new(false));
    let writers: Vec<_> = [1_000, 1_000_000]
        .map(|first| tokio::spawn(write(channel.clone(), first, end.clone())))
        .into();

    let outer = tempfile::TempDir::new().unwrap();
    let folder = |name: &str| outer.path().join(name).to_str().unwrap().to_owned();
    let (whole, keyless) = (folder("whole"), folder("keyless"));
    let (status, out, err) = bench.says(&["backup", &whole, "--with-master-key"]).await;
    assert!(
        status.success() && err.contains("the master key is in the backup"),
        "{out}{err}"
    );
    let (status, out, err) = bench.says(&["backup", &keyless]).await;
    assert!(
        status.success() && err.contains("the master key is NOT in the backup"),
        "{out}{err}"
    );
    assert!(!Path::new(&keyless).join("master.key").exists());
    end.store(true, Ordering::Relaxed);
    let mut after = Vec::new();
    for writer in writers {
        after.extend(writer.await.unwrap());
    }
    // Neither over another backup, nor over a folder that is in use.
    let (status, _, err) = bench.says(&["backup", &whole]).await;
    assert!(!status.success() && err.contains("is not empty"), "{err}");
    let (status, _, err) = bench.says(&["restore", &whole]).await;
    assert!(
        !status.success() && err.contains("is in use by another server"),
        "{err}"
    );
    server.stop().await;
    let (status, _, err) = bench.says(&["restore", &whole]).await;
    assert!(!status.success() && err.contains("is not empty"), "{err}");

    let restored = Bench::new();
    let (status, out, err) = restored.says(&["restore", &whole]).await;
    assert!(
        status.success() && err.contains("the master key opens what is in it"),
        "{out}{err}"
    );
    check(&restored, &before, &after, &asset).await;

    let restored = Bench::new();
    let (status, _, err) = restored.says(&["restore", &keyless]).await;
    assert!(status.success() && err.contains("the master key is not there"), "{err}");
    std::fs::copy(bench.data().join("master.key"), restored.data().join("master.key")).unwrap();
    check(&restored, &before, &after, &asset).await;
}

#[tokio::test]
async fn what_is_wrong_with_a_backup_is_told() {
    let bench = Bench::new();
    let (status, _, err) = bench.says(&["backup", "/nowhere/at/all"]).await;
    assert!(!status.success() && err.contains("ledger.sqlite is not there"), "{err}");
    let server = bench.start().await;
    let channel = server.channel().await;
    upload(&channel, bytes(1)).await.unwrap();
    let damaged = upload(&channel, bytes(2)).await.unwrap().name;
    server.stop().await;
    let outer = tempfile::TempDir::new().unwrap();
    let copy = outer.path().join("copy");
    let folder = copy.to_str().unwrap().to_owned();
    assert!(bench.says(&["backup", &folder]).await.0.success());

    // A byte of an artifact: the rest is there, and the damage is told.
    let file = copy.join("artifacts/uploads").join(&damaged["artifacts/".len()..]);
    let mut content = std::fs::read(&file).unwrap();
    content[7] ^= 1;
    std::fs::write(&file, content).unwrap();
    let restored = Bench::new();
    let (status, _, err) = restored.says(&["restore", &folder]).await;
    assert!(
        !status.success() && err.contains(&format!("{damaged} is damaged")),
        "{err}"
    );
    // A byte of the ledger, or no manifest: nothing is restored.
    let ledger = copy.join("ledger.sqlite");
    let mut content = std::fs::read(&ledger).unwrap();
    content[4242] ^= 1;
    std::fs::write(&ledger, content).unwrap();
    let restored = Bench::new();
    let (status, _, err) = restored.says(&["restore", &folder]).await;
    assert!(!status.success() && err.contains("is not as it was"), "{err}");
    std::fs::remove_file(copy.join("backup.json")).unwrap();
    let (status, _, err) = restored.says(&["restore", &folder]).await;
    assert!(
        !status.success() && err.contains("no backup that was finished"),
        "{err}"
    );
    assert!(!restored.data().exists());
    // A ledger in a database is not for this.
    let (status, _, err) = bench
        .says(&["--database", "postgres://db/ledger", "backup", &folder])
        .await;
    assert!(!status.success() && err.contains("pg_dump"), "{err}");
    // Nor are artifacts that are elsewhere.
    let (status, _, err) = bench
        .says(&["--artifacts", "s3://bucket/scenes", "backup", &folder])
        .await;
    assert!(
        !status.success() && err.contains("s3://bucket/scenes, not in the data folder"),
        "{err}"
    );
}
