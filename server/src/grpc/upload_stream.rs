//! Bytes that arrive in chunks: for uploads of clients, and for outputs of attempts.
use std::time::Duration;

use guardsplat_proto::v1::{
    OutputMetadata, UploadArtifactRequest, UploadMetadata, UploadOutputRequest, upload_artifact_request,
    upload_output_request,
};
use tonic::{Status, Streaming};

use crate::error::{Error, Result};

/// A message of an upload.
pub trait Part {
    /// What comes first.
    type Metadata;

    /// The first message's metadata, or the bytes of a later one; `None` when it is neither.
    fn split(self) -> Option<Payload<Self::Metadata>>;
}

/// What a message of an upload holds.
pub enum Payload<M> {
    /// What is coming.
    Metadata(M),
    /// The next bytes.
    Chunk(Vec<u8>),
}

impl Part for UploadArtifactRequest {
    type Metadata = UploadMetadata;

    fn split(self) -> Option<Payload<UploadMetadata>> {
        Some(match self.payload? {
            upload_artifact_request::Payload::Metadata(metadata) => Payload::Metadata(metadata),
            upload_artifact_request::Payload::Chunk(chunk) => Payload::Chunk(chunk),
        })
    }
}

impl Part for UploadOutputRequest {
    type Metadata = OutputMetadata;

    fn split(self) -> Option<Payload<OutputMetadata>> {
        Some(match self.payload? {
            upload_output_request::Payload::Metadata(metadata) => Payload::Metadata(metadata),
            upload_output_request::Payload::Chunk(chunk) => Payload::Chunk(chunk),
        })
    }
}

/// The stream of an upload, read with patience that ends.
pub struct Incoming<P> {
    stream: Streaming<P>,
    idle: Duration,
}

impl<P: Part> Incoming<P> {
    /// Reads `stream`, and gives up when nothing arrives for as long as `idle`.
    pub fn new(stream: Streaming<P>, idle: Duration) -> Self {
        Self { stream, idle }
    }

    /// The first message, which must be the metadata.
    pub async fn metadata(&mut self) -> Result<P::Metadata, Status> {
        match self.message().await?.map(Part::split) {
            Some(Some(Payload::Metadata(metadata))) => Ok(metadata),
            Some(_) => Err(Error::invalid("metadata", "must come first, before any chunk").into()),
            None => Err(Error::invalid("metadata", "is missing, the stream was empty").into()),
        }
    }

    /// The next bytes; `None` at the end.
    pub async fn chunk(&mut self) -> Result<Option<Vec<u8>>, Status> {
        match self.message().await?.map(Part::split) {
            Some(Some(Payload::Chunk(chunk))) => Ok(Some(chunk)),
            Some(Some(Payload::Metadata(_))) => Err(Error::invalid("metadata", "was sent twice").into()),
            Some(None) => Err(Error::invalid("chunk", "is missing").into()),
            None => Ok(None),
        }
    }

    async fn message(&mut self) -> Result<Option<P>, Status> {
        let message = tokio::time::timeout(self.idle, self.stream.message()).await;
        message.map_err(|_| Error::UploadStalled(self.idle))?
    }
}
