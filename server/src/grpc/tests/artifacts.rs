//! Artifacts: in, out, deleted, and all the ways in which bytes can be wrong.
use guardsplat_proto::v1::download_artifact_response::Payload;
use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::{
    Artifact, CancelJobRequest, DeleteArtifactRequest, DownloadArtifactRequest, EmbedSpec, GetArtifactRequest, Job,
    UploadArtifactRequest, UploadMetadata,
};
use tonic::{Code, Response, Status};
use uuid::Uuid;

use super::harness::{
    MAX_ARTIFACT_BYTES, Server, chunk, first, invalid, metadata, not_found, refused, soon, upload_messages, verify_spec,
};

/// Some bytes that are nowhere the same.
fn bytes(length: usize) -> Vec<u8> {
    (0..length as u32)
        .flat_map(|i| i.wrapping_mul(2_654_435_761).to_le_bytes())
        .take(length)
        .collect()
}

async fn download(server: &Server, name: &str, offset: i64) -> Result<(Artifact, Vec<u8>), Status> {
    let request = DownloadArtifactRequest {
        name: name.into(),
        offset,
    };
    let mut stream = server.artifacts.clone().download_artifact(request).await?.into_inner();
    let Some(Payload::Artifact(artifact)) = stream.message().await?.unwrap().payload else {
        panic!("no artifact")
    };
    let mut bytes = Vec::new();
    while let Some(message) = stream.message().await? {
        let Some(Payload::Chunk(chunk)) = message.payload else {
            panic!("no chunk")
        };
        assert!(chunk.len() <= 1 << 20);
        bytes.extend(chunk);
    }
    Ok((artifact, bytes))
}

async fn send(server: &Server, messages: Vec<UploadArtifactRequest>) -> Result<Response<Artifact>, Status> {
    server
        .artifacts
        .clone()
        .upload_artifact(tokio_stream::iter(messages))
        .await
}

#[tokio::test]
async fn bytes_come_back_as_they_were() {
    let server = Server::start().await;
    let sent = bytes((5 << 19) + 17);
    let artifact = server.upload("scène 1.ply", &sent).await;
    assert_eq!(artifact.display_name, "scène 1.ply");
    assert_eq!((artifact.size_bytes, artifact.job.as_str()), (sent.len() as i64, ""));
    let request = GetArtifactRequest {
        name: artifact.name.clone(),
    };
    assert_eq!(
        server
            .artifacts
            .clone()
            .get_artifact(request)
            .await
            .unwrap()
            .into_inner(),
        artifact
    );
    assert_eq!(
        download(&server, &artifact.name, 0).await.unwrap(),
        (artifact.clone(), sent.clone())
    );
    let offset = (1 << 20) + 5;
    let rest = download(&server, &artifact.name, offset).await.unwrap().1;
    assert!(rest == sent[offset as usize..]);
    assert!(
        download(&server, &artifact.name, sent.len() as i64)
            .await
            .unwrap()
            .1
            .is_empty()
    );
    for offset in [-1, sent.len() as i64 + 1] {
        assert_eq!(invalid(download(&server, &artifact.name, offset).await), ["offset"]);
    }
}

#[tokio::test]
async fn wrong_uploads_leave_nothing() {
    let server = Server::start().await;
    let sent = bytes(3000);
    let with = |change: fn(&mut UploadMetadata)| {
        let mut metadata = metadata("scene.ply", &sent);
        change(&mut metadata);
        upload_messages(metadata, &sent)
    };
    let cases = [
        (with(|m| m.sha256 = "0".repeat(64)), "metadata.sha256"),
        (with(|m| m.sha256 = m.sha256.to_uppercase()), "metadata.sha256"),
        (with(|m| m.sha256.clear()), "metadata.sha256"),
        (with(|m| m.size_bytes = 0), "metadata.size_bytes"),
        (with(|m| m.size_bytes = -3000), "metadata.size_bytes"),
        (
            with(|m| m.size_bytes = MAX_ARTIFACT_BYTES as i64 + 1),
            "metadata.size_bytes",
        ),
        (with(|m| m.size_bytes = i64::MAX), "metadata.size_bytes"),
        (with(|m| m.size_bytes = 2999), "chunk"),
        (with(|m| m.size_bytes = 3001), "chunk"),
        (
            with(|m| m.display_name = "../../etc/cron.d/x".into()),
            "metadata.display_name",
        ),
        (with(|m| m.display_name = "..".into()), "metadata.display_name"),
        (
            with(|m| m.display_name = "C:\\scene.ply".into()),
            "metadata.display_name",
        ),
        (with(|m| m.display_name = "a\0".into()), "metadata.display_name"),
        (with(|m| m.display_name = "x".repeat(256)), "metadata.display_name"),
        (vec![], "metadata"),
        (vec![UploadArtifactRequest { payload: None }], "metadata"),
        (vec![chunk(&sent)], "metadata"),
        (vec![first(metadata("a", &sent)); 2], "metadata"),
        (
            vec![first(metadata("a", &sent)), UploadArtifactRequest { payload: None }],
            "chunk",
        ),
        (
            vec![first(metadata("a", &bytes(2 << 20))), chunk(&bytes((1 << 20) + 1))],
            "chunk",
        ),
    ];
    for (i, (messages, field)) in cases.into_iter().enumerate() {
        assert_eq!(invalid(send(&server, messages).await), [field], "case {i}");
    }
    // Staged bytes are removed a moment after the answer.
    soon("their removal", async || server.files().is_empty()).await;
}

#[tokio::test]
async fn no_message_is_larger_than_four_mebibytes() {
    let server = Server::start().await;
    let sent = bytes(5 << 20);
    let messages = vec![first(metadata("a", &sent)), chunk(&sent)];
    let status = send(&server, messages).await.unwrap_err();
    assert_eq!(status.code(), Code::OutOfRange, "{status:?}");
    // Staged bytes are removed a moment after the answer.
    soon("their removal", async || server.files().is_empty()).await;
}

#[tokio::test]
async fn names_are_checked_everywhere() {
    let server = Server::start().await;
    let nobody = format!("artifacts/{}", Uuid::now_v7());
    let mut client = server.artifacts.clone();
    for name in [
        "",
        "artifacts/../ledger.sqlite",
        "jobs/0198a6d2-9bb1-7c7e-8d4a-0c3f1f2b7a55",
    ] {
        assert_eq!(invalid(download(&server, name, 0).await), ["name"]);
        assert_eq!(
            invalid(client.get_artifact(GetArtifactRequest { name: name.into() }).await),
            ["name"]
        );
        assert_eq!(
            invalid(
                client
                    .delete_artifact(DeleteArtifactRequest { name: name.into() })
                    .await
            ),
            ["name"]
        );
    }
    assert_eq!(not_found(download(&server, &nobody, 0).await), nobody);
    assert_eq!(
        not_found(client.get_artifact(GetArtifactRequest { name: nobody.clone() }).await),
        nobody
    );
    assert_eq!(
        not_found(
            client
                .delete_artifact(DeleteArtifactRequest { name: nobody.clone() })
                .await
        ),
        nobody
    );
}

#[tokio::test]
async fn deleting_removes_the_bytes() {
    let server = Server::start().await;
    let name = server.upload("scene.ply", b"bytes").await.name;
    assert_eq!(server.files().len(), 1);
    let delete = || DeleteArtifactRequest { name: name.clone() };
    server.artifacts.clone().delete_artifact(delete()).await.unwrap();
    assert!(server.files().is_empty());
    assert_eq!(not_found(download(&server, &name, 0).await), name);
    assert_eq!(
        not_found(server.artifacts.clone().delete_artifact(delete()).await),
        name
    );
}

#[tokio::test]
async fn what_a_job_needs_is_kept() {
    let server = Server::start().await;
    let key = server.key(8, b"key file").await;
    let name = server.upload("scene.ply", b"bytes").await.name;
    let embed = EmbedSpec {
        scene: name.clone(),
        key: key.clone(),
        message: "00".into(),
        ..Default::default()
    };
    let job = server.create(Spec::Embed(embed)).await;
    let delete = async || {
        let request = DeleteArtifactRequest { name: name.clone() };
        server.artifacts.clone().delete_artifact(request).await
    };
    let details = refused(delete().await, Code::FailedPrecondition, "ARTIFACT_IN_USE");
    assert_eq!(details.precondition_failure().unwrap().violations[0].subject, name);
    let cancel = CancelJobRequest { name: job.name };
    server.jobs.clone().cancel_job(cancel).await.unwrap();
    delete().await.unwrap();
    let late = Job {
        spec: Some(verify_spec(&name, &key)),
        ..Default::default()
    };
    assert_eq!(not_found(server.submit(late, "").await), name);
}
