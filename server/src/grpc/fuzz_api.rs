//! What strangers send, as functions of bytes: for the fuzz targets in `tests/fuzz`, which see nothing else of the API.
use guardsplat_proto::v1::{CreateJobRequest, UploadMetadata};
use prost::Message as _;

use crate::error::{Error, Result};
use crate::service::names::ResourceKind;
use crate::service::{message, page, submission, text, upload};

/// Decodes a `CreateJobRequest` and checks it as the service does.
pub fn create_job(bytes: &[u8]) -> Result<()> {
    let request = CreateJobRequest::decode(bytes).map_err(|e| Error::invalid("request", e.to_string()))?;
    submission::check(request).map(|_| ())
}

/// Decodes what an upload announces and checks it.
pub fn announce(bytes: &[u8]) -> Result<()> {
    let metadata = UploadMetadata::decode(bytes).map_err(|e| Error::invalid("metadata", e.to_string()))?;
    upload::announced("metadata", &metadata).map(|_| ())
}

/// Opens a page token, and makes it again from what it says.
pub fn page_token(text: &str) -> Result<Option<String>> {
    let query: &[&[u8]] = &[b"jobs"];
    Ok(page::position(query, text)?.map(|position| page::token(query, position)))
}

/// Reads a name of whatever has one, and makes it again.
pub fn name(text: &str) -> Result<String> {
    let parsed = |kind: ResourceKind| kind.parse("name", text).map(|id| kind.name(id));
    let found = ResourceKind::ALL.into_iter().find_map(|kind| parsed(kind).ok());
    found.map_or_else(|| parsed(ResourceKind::Job), Ok)
}

/// Checks a name for people.
pub fn display_name(text: &str) -> Result<()> {
    text::display_name("display_name", text)
}

/// Checks the name of a file.
pub fn file_name(text: &str) -> Result<()> {
    text::file_name("file_name", text)
}

/// Checks a message against the bits of its key, 1 to [`MAX_BITS`](guardsplat_codeword::MAX_BITS).
pub fn message(text: &str, bits: u32) -> Result<()> {
    message::check("message", text, bits)
}
