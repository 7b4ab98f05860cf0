//! The JSON of a report, written in one way only and read within limits.
use crate::error::{Error, Result};
use crate::evidence::{Evidence, FIRST_VERSION, SCHEMA, VERSION};
use crate::limits::JSON_BYTES;
use crate::signature::Signature;
use serde::{Deserialize, Serialize};

/// A report with its signature, as it is kept in a file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SignedFile {
    pub evidence: Evidence,
    pub signature: Signature,
}

/// What is looked at first, whatever else the document has.
#[derive(Deserialize)]
struct Head {
    schema: Option<String>,
    version: Option<u64>,
    evidence: Option<Inner>,
}

#[derive(Deserialize)]
struct Inner {
    schema: Option<String>,
    version: Option<u64>,
}

/// What a document turned out to be.
pub(crate) enum Document {
    Bare(Evidence),
    Signed(SignedFile),
}

impl Evidence {
    /// The canonical JSON: fields in their order, no spaces, numbers in the shortest form that reads back to the same
    /// bits. Pictures are in it by their hashes.
    ///
    /// # Errors
    /// [`Error::BadField`] for values that a report can't have, [`Error::TooLarge`].
    pub fn to_json(&self) -> Result<String> {
        self.validate()?;
        canonical(self)
    }

    /// Reads a report, signed or not; whether a signature is right is told by [`crate::check`]. At most 4 MiB are read.
    ///
    /// # Errors
    /// [`Error::TooLarge`], [`Error::NotAReport`], [`Error::UnknownVersion`], [`Error::Malformed`],
    /// [`Error::BadField`].
    pub fn from_json(json: &[u8]) -> Result<Self> {
        match read(json)? {
            Document::Bare(evidence) => Ok(evidence),
            Document::Signed(file) => Ok(file.evidence),
        }
    }
}

/// Fields in their order, no spaces, and no larger than what is read.
pub(crate) fn canonical(what: &impl Serialize) -> Result<String> {
    // Nothing in a report has keys that are no strings, or numbers that are not finite once it was validated.
    let json = serde_json::to_string(what).map_err(|e| Error::Malformed(e.to_string()))?;
    limit(json.len())?;
    Ok(json)
}

/// Reads a document of either form.
pub(crate) fn read(json: &[u8]) -> Result<Document> {
    limit(json.len())?;
    let head: Head = serde_json::from_slice(json).map_err(|e| Error::NotAReport(e.to_string()))?;
    let (schema, version, signed) = match head.evidence {
        Some(inner) => (inner.schema, inner.version, true),
        None => (head.schema, head.version, false),
    };
    if schema.as_deref() != Some(SCHEMA) {
        return Err(Error::NotAReport(format!("its schema is not {SCHEMA}")));
    }
    match version {
        Some(found) if (u64::from(FIRST_VERSION)..=u64::from(VERSION)).contains(&found) => {}
        Some(found) => return Err(Error::UnknownVersion { found, known: VERSION }),
        None => return Err(Error::NotAReport("it has no version".into())),
    }
    let document = match signed {
        true => serde_json::from_slice(json).map(Document::Signed),
        false => serde_json::from_slice(json).map(Document::Bare),
    }
    .map_err(|e| Error::Malformed(e.to_string()))?;
    match &document {
        Document::Bare(evidence) => evidence.validate()?,
        Document::Signed(file) => file.evidence.validate()?,
    }
    Ok(document)
}

fn limit(bytes: usize) -> Result<()> {
    if bytes <= JSON_BYTES {
        return Ok(());
    }
    Err(Error::TooLarge {
        what: "the JSON of a report".into(),
        bytes: bytes as u64,
        limit: JSON_BYTES as u64,
    })
}
