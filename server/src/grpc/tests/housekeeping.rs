//! What is left behind is collected, and nothing else.
use std::time::Duration;

use guardsplat_proto::v1::{GetArtifactRequest, UploadArtifactRequest};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::Code;

use super::harness::{Server, chunk, first, key_spec, metadata, refused, soon};
use crate::ledger::{NewArtifact, Origin};
use crate::service::{Limits, clock};

/// An upload that was begun, and what continues it.
async fn begin(
    server: &Server,
    bytes: &[u8],
) -> (mpsc::Sender<UploadArtifactRequest>, tokio::task::JoinHandle<Answer>) {
    let (send, receive) = mpsc::channel(4);
    send.send(first(metadata("scene.ply", bytes))).await.unwrap();
    send.send(chunk(&bytes[..bytes.len() / 2])).await.unwrap();
    let mut client = server.artifacts.clone();
    let answer = tokio::spawn(async move { client.upload_artifact(ReceiverStream::new(receive)).await });
    (send, answer)
}

type Answer = Result<tonic::Response<guardsplat_proto::v1::Artifact>, tonic::Status>;

#[tokio::test]
async fn an_upload_that_breaks_off_leaves_nothing() {
    let server = Server::start().await;
    let bytes = vec![5; 3 << 20];
    let (send, answer) = begin(&server, &bytes[..1 << 20]).await;
    soon("a staged file", async || !server.files().is_empty()).await;
    answer.abort();
    drop(send);
    soon("its removal", async || server.files().is_empty()).await;
}

#[tokio::test]
async fn an_upload_that_falls_silent_is_ended() {
    let limits = Limits {
        upload_idle: Duration::from_millis(200),
        ..Limits::default()
    };
    let server = Server::with(limits).await;
    let (send, answer) = begin(&server, &[5; 1000]).await;
    refused(answer.await.unwrap(), Code::Aborted, "UPLOAD_STALLED");
    drop(send);
    soon("its removal", async || server.files().is_empty()).await;
}

#[tokio::test]
async fn an_upload_that_never_ends_is_ended() {
    let limits = Limits {
        abandoned_after: Duration::from_millis(600),
        ..Limits::default()
    };
    let server = Server::with(limits).await;
    let (send, answer) = begin(&server, &[5; 1000]).await;
    refused(answer.await.unwrap(), Code::Aborted, "UPLOAD_TOO_SLOW");
    drop(send);
    soon("its removal", async || server.files().is_empty()).await;
}

#[tokio::test]
async fn what_a_killed_server_left_is_collected_by_the_next() {
    let server = Server::start().await;
    let kept = server.upload("kept.ply", b"kept").await.name;
    let ledger = server.ledger();
    // As if the server had been killed between the last byte and the answer.
    let id = uuid::Uuid::now_v7();
    let path = crate::artifacts::ArtifactPath::upload(id);
    let new = NewArtifact {
        id,
        display_name: "lost.ply".into(),
        size: 4,
        sha256: super::harness::sha256(b"lost"),
        origin: Origin::Upload {
            project: "default".into(),
        },
        secret: false,
        evidence: false,
        path: path.to_string(),
    };
    ledger.create_artifact(new, clock::now()).await.unwrap();
    let announced = crate::artifacts::Announced::of(b"lost");
    let mut writer = server.api.store().write(&path, announced).await.unwrap();
    writer.chunk(b"lost".to_vec()).await.unwrap();
    writer.finish().await.unwrap();
    assert_eq!(server.files().len(), 2);
    // Nobody collects it while it might still be arriving.
    server.api.collect(0).await.unwrap();
    assert_eq!(server.files().len(), 2);
    drop(ledger);

    let server = server.restart(Limits::default()).await;
    soon("its removal", async || server.files().len() == 1).await;
    soon("the end of its row", async || {
        server.ledger().get_any_artifact(id).await.unwrap().is_none()
    })
    .await;
    server
        .artifacts
        .clone()
        .get_artifact(GetArtifactRequest { name: kept })
        .await
        .unwrap();
}

#[tokio::test]
async fn outputs_of_attempts_that_are_over_are_collected() {
    let limits = Limits {
        abandoned_after: Duration::from_millis(300),
        ..Limits::default()
    };
    let server = Server::with(limits).await;
    let name = server.create(key_spec(8)).await.name;
    let (_, token) = server.take().await;
    server.output(&name, &token, b"an output", true).await.unwrap();
    tokio::time::sleep(Duration::from_millis(700)).await;
    server.api.collect(0).await.unwrap();
    // The attempt goes on.
    assert_eq!(server.files().len(), 1);
    let request = guardsplat_proto::v1::ReleaseJobRequest {
        name,
        lease_token: token,
    };
    server.worker.clone().release_job(request).await.unwrap();
    soon("its removal", async || server.files().is_empty()).await;
}

/// Bytes that can't be deleted are tried again, and keep nothing else from being deleted.
#[tokio::test]
async fn what_cannot_be_deleted_does_not_block_the_rest() {
    let server = Server::start().await;
    let (ledger, folder) = (server.ledger(), server.folder().join("artifacts"));
    let abandoned = async |created: i64| {
        let id = uuid::Uuid::now_v7();
        let path = crate::artifacts::ArtifactPath::upload(id);
        let new = NewArtifact {
            id,
            display_name: "left.ply".into(),
            size: 4,
            sha256: super::harness::sha256(b"left"),
            origin: Origin::Upload {
                project: "default".into(),
            },
            secret: false,
            evidence: false,
            path: path.to_string(),
        };
        ledger.create_artifact(new, created).await.unwrap();
        (id, folder.join(path.to_string()))
    };
    // As many as are tried at one go, and older than the one that can go.
    for created in 0..100 {
        let (_, path) = abandoned(created).await;
        std::fs::create_dir_all(path.join("in the way")).unwrap();
    }
    let (id, path) = abandoned(1000).await;
    std::fs::write(path, b"left").unwrap();
    for _ in 0..2 {
        server.api.collect(clock::now()).await.unwrap();
    }
    assert_eq!(ledger.get_any_artifact(id).await.unwrap(), None);
    // The others are still to go.
    let left = ledger.abandoned_artifacts(0, 200).await.unwrap();
    assert_eq!(left.len(), 100);
}
