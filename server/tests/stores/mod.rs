//! The server as a process over a bucket: who may use it stays between the two.
use guardsplat_proto::v1::artifact_service_client::ArtifactServiceClient;
use guardsplat_proto::v1::upload_artifact_request::Payload;
use guardsplat_proto::v1::{UploadArtifactRequest, UploadMetadata};
use sha2::{Digest, Sha256};

use super::support::s3::{BUCKET, Endpoint};
use super::support::{Bench, until};

const SCENE: &[u8] = b"a scene";

/// A server's environment that leads to the bucket.
fn bench(endpoint: &Endpoint) -> Bench {
    let mut bench = Bench::new();
    for (name, value) in endpoint.environment() {
        bench.variable(&name, &value);
    }
    bench.variable("GUARDSPLAT_ARTIFACTS", &format!("s3://{BUCKET}/artifacts"));
    bench
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn artifacts_go_to_a_bucket_that_only_the_server_gets_into() {
    let endpoint = Endpoint::start().await;
    let bench = bench(&endpoint);
    let server = bench
        .start_with_worker("env >> $LOG; echo over >> $LOG; exec sleep 60")
        .await;
    let upload = |payload| UploadArtifactRequest { payload: Some(payload) };
    let metadata = UploadMetadata {
        display_name: "scene.ply".into(),
        size_bytes: SCENE.len() as i64,
        sha256: hex::encode(Sha256::digest(SCENE)),
    };
    let parts = [
        upload(Payload::Metadata(metadata)),
        upload(Payload::Chunk(SCENE.to_vec())),
    ];
    let mut client = ArtifactServiceClient::new(server.channel().await);
    let artifact = client
        .upload_artifact(tokio_stream::iter(parts))
        .await
        .unwrap()
        .into_inner();
    let id = artifact.name.strip_prefix("artifacts/").unwrap();
    let stored = endpoint.path(&format!("artifacts/uploads/{id}"));
    assert_eq!(std::fs::read(stored).unwrap(), SCENE);
    assert!(
        !bench.kept().iter().any(|file| file.ends_with(id)),
        "not on this machine"
    );

    let environment = until(|| bench.log(), |log| log.ends_with("over\n")).await;
    assert!(
        environment.contains("LOG=") && !environment.contains("AWS_"),
        "{environment}"
    );
    server.stop().await;
    let log = bench.server_log();
    assert!(log.contains("s3://guardsplat/artifacts"), "{log}");
    for secret in ["5ec2e7", "tester"] {
        assert!(!log.contains(secret), "{log}");
    }

    // It is taken: another ledger would delete what is there as nobody's.
    let other = self::bench(&endpoint);
    let (status, text) = other.fails(&[]).await;
    assert_eq!(status.code(), Some(1));
    assert!(
        text.starts_with("error: artifacts: those in s3://guardsplat/artifacts are another ledger's"),
        "{text}"
    );
    bench.start().await.stop().await;
}
