//! Fetches artifacts into files, and goes on where a broken-off download ended.
use std::path::Path;

use guardsplat_proto::v1::artifact_service_client::ArtifactServiceClient;
use guardsplat_proto::v1::download_artifact_response::Payload;
use guardsplat_proto::v1::{Artifact, DownloadArtifactRequest};
use tonic::{Code, Status};

use super::destination::{Destination, size};
use super::signed_download;
use crate::console::Unit;
use crate::context::{Context, refused};
use crate::error::{Error, Result};
use crate::server::is_lost;

const DOING: &str = "fetching the artifact";

/// Fetches the artifact called `name` into the file `path`: from the store where the server says how, else from the server.
pub async fn download(context: &Context, name: &str, path: &Path) -> Result<Artifact> {
    match signed_download::download(context, name, path).await? {
        Some(artifact) => Ok(artifact),
        None => streamed(context, name, path).await,
    }
}

async fn streamed(context: &Context, name: &str, path: &Path) -> Result<Artifact> {
    let mut file = Destination::new(path)?;
    let mut known: Option<Artifact> = None;
    let mut backoff = context.backoff();
    loop {
        let before = file.written();
        match attempt(context, name, &mut file, &mut known).await? {
            Ok(artifact) => {
                file.finish(size(&artifact), &artifact.sha256)?;
                return Ok(artifact);
            }
            Err(status) => {
                let moved = file.written() > before;
                if moved {
                    backoff.heard();
                }
                // A server that falls silent in the midst of a file is as good as lost.
                let fell_silent = moved && status.code() == Code::DeadlineExceeded;
                if !fell_silent && !is_lost(&status) {
                    return Err(refused(DOING, status));
                }
                context.pause(&mut backoff, DOING, &status, "").await?;
            }
        }
    }
}

/// One stream, from where the file ends; the artifact when all of it arrived.
async fn attempt(
    context: &Context,
    name: &str,
    file: &mut Destination,
    known: &mut Option<Artifact>,
) -> Result<Result<Artifact, Status>> {
    let mut client = ArtifactServiceClient::new(context.server.channel().await?);
    let request = DownloadArtifactRequest {
        name: name.to_owned(),
        // No file is longer than this.
        offset: i64::try_from(file.written()).unwrap_or(i64::MAX),
    };
    let mut stream = match context
        .in_time(client.download_artifact(context.request(request)))
        .await
    {
        Ok(response) => response.into_inner(),
        Err(status) => return Ok(Err(status)),
    };
    let mut announced: Option<Artifact> = None;
    loop {
        let payload = match context.in_time(stream.message()).await {
            Ok(Some(message)) => message.payload,
            Ok(None) => break,
            Err(status) => return Ok(Err(status)),
        };
        match (payload, &announced) {
            (Some(Payload::Artifact(artifact)), None) => {
                if known.as_ref().is_some_and(|k| k.sha256 != artifact.sha256) {
                    return Err(file.damaged("the artifact is another one after the connection was lost"));
                }
                *known = Some(artifact.clone());
                announced = Some(artifact);
            }
            (Some(Payload::Chunk(chunk)), Some(artifact)) => {
                file.write(&chunk)?;
                if file.written() > size(artifact) {
                    return Err(file.damaged(format!("more than {} bytes arrived", size(artifact))));
                }
                context
                    .console
                    .show("download", Unit::Bytes, file.written(), size(artifact), "");
            }
            _ => {
                return Err(Error::Answer {
                    reason: "a download is an artifact and then its bytes".into(),
                });
            }
        }
    }
    match announced {
        Some(artifact) if file.written() == size(&artifact) => Ok(Ok(artifact)),
        _ => Ok(Err(Status::unavailable("the server ended the stream before the file"))),
    }
}
