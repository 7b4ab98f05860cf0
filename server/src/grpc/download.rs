//! What `DownloadArtifact` tells: an artifact, then its bytes in small messages, for readers that may be slow. One that
//! takes nothing costs little, and is shed after a while.
use futures::stream::BoxStream;
use guardsplat_proto::v1::download_artifact_response::Payload;
use guardsplat_proto::v1::{Artifact, DownloadArtifactResponse};
use tonic::Status;

use crate::artifacts::Reader;
use crate::error::Error;
use crate::grpc::slow_consumer::{Source, patient_source};
use crate::service::Service;

/// An artifact that is sent.
struct Download {
    /// Told first.
    artifact: Option<Artifact>,
    bytes: Reader,
    over: bool,
}

/// Sends an artifact from where the reader of its bytes stands.
pub fn download(
    api: &Service,
    artifact: Artifact,
    bytes: Reader,
) -> BoxStream<'static, Result<DownloadArtifactResponse, Status>> {
    let (metrics, stall) = (api.metrics(), api.limits().download_stall);
    let name = artifact.name.clone();
    let download = Download {
        artifact: Some(artifact),
        bytes,
        over: false,
    };
    patient_source(download, stall, move || {
        metrics.download_shed();
        tracing::info!(artifact = name, "a download is shed: its reader takes nothing");
        Error::DownloadStalled(stall).into()
    })
}

impl Source for Download {
    type Item = Result<DownloadArtifactResponse, Status>;

    async fn next(&mut self) -> Option<Self::Item> {
        let respond = |payload| DownloadArtifactResponse { payload: Some(payload) };
        if let Some(artifact) = self.artifact.take() {
            return Some(Ok(respond(Payload::Artifact(artifact))));
        }
        if self.over {
            return None;
        }
        match self.bytes.piece().await {
            // Copied: a part of a window would keep all of it.
            Ok(Some(piece)) => Some(Ok(respond(Payload::Chunk(piece.to_vec())))),
            Ok(None) => None,
            Err(error) => {
                self.over = true;
                Some(Err(Error::from(error).into()))
            }
        }
    }

    fn rest(&mut self) {
        self.bytes.rest();
    }
}
