//! Sends files, to the store where the server says how, else to the server in chunks.
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use guardsplat_proto::v1::artifact_service_client::ArtifactServiceClient;
use guardsplat_proto::v1::upload_artifact_request::Payload;
use guardsplat_proto::v1::{Artifact, DeleteArtifactRequest, UploadArtifactRequest};
use tokio::fs::File;
use tokio::io::AsyncReadExt;
use tokio::sync::mpsc;
use tokio::time::Instant;
use tokio_stream::wrappers::ReceiverStream;
use tonic::Status;

use super::signed_upload;
use super::source::{AHEAD, CHUNK, LOOK, Source};
use crate::console::Unit;
use crate::context::{Context, refused, silent};
use crate::error::{Error, Result};
use crate::server::is_lost;

const DOING: &str = "sending the file";

/// Sends a file; `before` of `total` bytes went with other files.
pub async fn upload(context: &Context, source: &Source, before: u64, total: u64) -> Result<Artifact> {
    match signed_upload::upload(context, source, before, total).await? {
        Some(artifact) => Ok(artifact),
        None => streamed(context, source, before, total).await,
    }
}

/// From the beginning again if the connection is lost.
async fn streamed(context: &Context, source: &Source, before: u64, total: u64) -> Result<Artifact> {
    let mut backoff = context.backoff();
    loop {
        match attempt(context, source, before, total).await? {
            Ok(artifact) => return Ok(artifact),
            Err(status) if is_lost(&status) => context.pause(&mut backoff, DOING, &status, "").await?,
            Err(status) => return Err(refused(DOING, status)),
        }
    }
}

/// Deletes what was sent for nothing, as far as that works.
pub async fn discard(context: &Context, names: impl IntoIterator<Item = &String>) {
    for name in names {
        let request = DeleteArtifactRequest { name: name.clone() };
        // The error that led here is what the user has to hear of.
        let _ = context
            .once("deleting the upload", request, async |channel, request| {
                ArtifactServiceClient::new(channel).delete_artifact(request).await
            })
            .await;
    }
}

async fn attempt(context: &Context, source: &Source, before: u64, total: u64) -> Result<Result<Artifact, Status>> {
    let mut client = ArtifactServiceClient::new(context.server.channel().await?);
    let file = File::open(&source.path).await.map_err(Error::io(&source.path))?;
    let sent = Arc::new(AtomicU64::new(0));
    let (sender, receiver) = mpsc::channel(AHEAD);
    let first = UploadArtifactRequest {
        payload: Some(Payload::Metadata(source.metadata())),
    };
    let reading = tokio::spawn(read(file, first, sender, Arc::clone(&sent)));
    let answer = client.upload_artifact(context.request(ReceiverStream::new(receiver)));
    tokio::pin!(answer);
    let mut look = tokio::time::interval(LOOK);
    let (mut last, mut moved) = (0, Instant::now());
    let answer = loop {
        tokio::select! {
            answer = &mut answer => break answer,
            _ = look.tick() => {
                let now = sent.load(Ordering::Relaxed);
                context.console.show("upload", Unit::Bytes, before + now, total, "");
                if now != last {
                    (last, moved) = (now, Instant::now());
                } else if moved.elapsed() > context.server.timeout {
                    break Err(silent(context.server.timeout));
                }
            }
        }
    };
    match answer {
        Ok(artifact) => {
            context
                .console
                .show("upload", Unit::Bytes, before + source.size, total, "");
            Ok(Ok(artifact.into_inner()))
        }
        Err(status) => {
            reading.abort();
            match reading.await {
                // The file, not the server, is why it was cut short.
                Ok(Err(error)) => Err(Error::io(&source.path)(error)),
                _ => Ok(Err(status)),
            }
        }
    }
}

async fn read(
    mut file: File,
    first: UploadArtifactRequest,
    sender: mpsc::Sender<UploadArtifactRequest>,
    sent: Arc<AtomicU64>,
) -> std::io::Result<()> {
    // Nobody receives any more when the server has answered, which then says why.
    if sender.send(first).await.is_err() {
        return Ok(());
    }
    loop {
        let mut chunk = Vec::with_capacity(CHUNK);
        (&mut file).take(CHUNK as u64).read_to_end(&mut chunk).await?;
        let length = chunk.len() as u64;
        let payload = Some(Payload::Chunk(chunk));
        if length == 0 || sender.send(UploadArtifactRequest { payload }).await.is_err() {
            return Ok(());
        }
        sent.fetch_add(length, Ordering::Relaxed);
    }
}
