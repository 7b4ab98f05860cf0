//! Downloads that nobody reads, and how many transfers a caller may have.
use std::time::Duration;

use guardsplat_proto::v1::artifact_service_client::ArtifactServiceClient;
use guardsplat_proto::v1::download_artifact_response::Payload;
use guardsplat_proto::v1::{DownloadArtifactRequest, DownloadArtifactResponse};
use tokio::sync::mpsc;
use tokio::time::sleep;
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::Channel;
use tonic::{Code, Status, Streaming};

use super::harness::{Server, chunk, first, metadata, refused, soon};
use crate::service::Limits;

type Download = Streaming<DownloadArtifactResponse>;

async fn download(server: &Server, name: &str, offset: usize) -> Result<Download, Status> {
    // Little is on the way to a reader.
    let channel = Channel::from_shared(server.url.clone()).unwrap();
    let channel = channel.initial_stream_window_size(64 << 10).connect_lazy();
    let request = DownloadArtifactRequest {
        name: name.into(),
        offset: offset as i64,
    };
    let stream = ArtifactServiceClient::new(channel).download_artifact(request).await?;
    Ok(stream.into_inner())
}

/// Reads on to the end, or the error.
async fn read(stream: &mut Download, bytes: &mut Vec<u8>) -> Result<(), Status> {
    while let Some(message) = stream.message().await? {
        if let Some(Payload::Chunk(chunk)) = message.payload {
            assert!(chunk.len() <= 64 << 10, "{}", chunk.len());
            bytes.extend(chunk);
        }
    }
    Ok(())
}

fn bytes() -> Vec<u8> {
    (0..1_500_000_u32)
        .flat_map(|i| i.wrapping_mul(2_654_435_761).to_le_bytes())
        .collect()
}

#[tokio::test]
async fn a_download_that_nobody_reads_holds_nothing_is_shed_and_resumes() {
    let server = Server::with(Limits {
        download_stall: Duration::from_secs(3),
        ..Limits::default()
    })
    .await;
    let sent = bytes();
    let name = server.upload("scene.ply", &sent).await.name;
    let memory = server.api.store().memory().clone();
    let all = memory.free();
    let mut stream = download(&server, &name, 0).await.unwrap();
    soon("a window", async || memory.free() < all).await;
    soon("rest", async || memory.free() == all).await;
    // One who comes back in time finds everything.
    let mut had = Vec::new();
    read(&mut stream, &mut had).await.unwrap();
    assert!(had == sent);

    let mut stream = download(&server, &name, 0).await.unwrap();
    sleep(Duration::from_secs(5)).await;
    had.clear();
    let shed = read(&mut stream, &mut had).await;
    let details = refused(shed, Code::Unavailable, "DOWNLOAD_STALLED");
    assert!(details.retry_info().is_some());
    assert!(!had.is_empty() && had.len() < sent.len());
    let at = had.len();
    read(&mut download(&server, &name, at).await.unwrap(), &mut had)
        .await
        .unwrap();
    assert!(had == sent);
    let text = server.api.metrics().text().unwrap();
    assert!(text.contains("guardsplat_downloads_shed_total 1"), "{text}");
}

#[tokio::test]
async fn a_caller_has_so_many_transfers_at_once() {
    let server = Server::with(Limits {
        max_transfers: 2,
        ..Limits::default()
    })
    .await;
    let sent = bytes();
    let name = server.upload("scene.ply", &sent).await.name;
    let first_one = download(&server, &name, 0).await.unwrap();
    // An upload counts as one, from its beginning.
    let (say, said) = mpsc::channel(4);
    say.send(first(metadata("x.ply", b"bytes"))).await.unwrap();
    let mut client = server.artifacts.clone();
    let upload = tokio::spawn(async move { client.upload_artifact(ReceiverStream::new(said)).await });
    soon("a refusal", async || download(&server, &name, 0).await.is_err()).await;
    let details = refused(
        download(&server, &name, 0).await,
        Code::ResourceExhausted,
        "TOO_MANY_TRANSFERS",
    );
    assert_eq!(details.error_info().unwrap().metadata["limit"], "2");
    drop(first_one);
    soon("a place", async || download(&server, &name, 0).await.is_ok()).await;
    say.send(chunk(b"bytes")).await.unwrap();
    drop(say);
    upload.await.unwrap().unwrap();
}
