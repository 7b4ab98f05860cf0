//! Bytes that arrive in chunks: for uploads of clients, and for outputs of attempts.
use std::time::Duration;

use guardsplat_proto::v1::{
    OutputMetadata, UploadArtifactRequest, UploadMetadata, UploadOutputRequest, upload_artifact_request,
    upload_output_request,
};
use tonic::{Status, Streaming};

use super::problems::Problems;
use super::text;
use crate::artifacts::Announced;
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

/// Checks what an upload announces; `field` is where that stands in the request.
pub fn announced(field: &str, metadata: &UploadMetadata) -> Result<Announced> {
    let mut problems = Problems::default();
    problems.take(text::file_name(
        &format!("{field}.display_name"),
        &metadata.display_name,
    ))?;
    let size = u64::try_from(metadata.size_bytes).ok().filter(|&size| size > 0);
    problems.check(
        size.is_some(),
        &format!("{field}.size_bytes"),
        "must be the length in bytes, at least 1",
    );
    let sha256 = digest(&metadata.sha256);
    problems.check(
        sha256.is_some(),
        &format!("{field}.sha256"),
        "must be 64 hexadecimal digits in lower case",
    );
    problems.finish()?;
    // Both were found to be there.
    Ok(Announced {
        size: size.unwrap_or_default(),
        sha256: sha256.unwrap_or_default(),
    })
}

/// A SHA-256 in lower-case hexadecimal.
pub fn digest(text: &str) -> Option<[u8; 32]> {
    let mut bytes = [0; 32];
    let valid = text.len() == 64 && !text.bytes().any(|b| b.is_ascii_uppercase());
    (valid && hex::decode_to_slice(text, &mut bytes).is_ok()).then_some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_wrong_is_told_at_once() {
        let metadata = UploadMetadata {
            display_name: "../x".into(),
            size_bytes: -1,
            sha256: "F".repeat(64),
        };
        let Err(Error::Invalid(violations)) = announced("metadata", &metadata) else {
            panic!("was taken")
        };
        let fields: Vec<_> = violations.iter().map(|v| v.field.as_str()).collect();
        assert_eq!(
            fields,
            ["metadata.display_name", "metadata.size_bytes", "metadata.sha256"]
        );
    }

    #[test]
    fn digests_have_one_spelling() {
        assert_eq!(digest(&"0f".repeat(32)), Some([15; 32]));
        for bad in [
            "",
            &"0F".repeat(32),
            &"0f".repeat(33),
            &"0g".repeat(32),
            &"é".repeat(32),
        ] {
            assert_eq!(digest(bad), None, "{bad}");
        }
    }
}
