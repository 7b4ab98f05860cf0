//! Where an artifact lies in the store. Paths are made of ids alone, never of names that a caller chose.
use std::fmt;

use object_store::path::Path;
use sha2::{Digest, Sha256};
use uuid::Uuid;

use super::{StoreError, StoreResult};

const STAGED: &str = "staged";
const UPLOADS: &str = "uploads";
const OUTPUTS: &str = "outputs";
/// Hexadecimal digits of a lease's hash in a path: enough to tell the attempts of a job apart.
const LEASE_DIGITS: usize = 16;

/// The path of one artifact.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct ArtifactPath(Path);

impl ArtifactPath {
    /// Where an upload lies.
    pub fn upload(id: Uuid) -> Self {
        Self(Path::from_iter([UPLOADS.to_owned(), id.to_string()]))
    }

    /// Where a client puts an upload that the server has not taken yet. Addresses to write at are of such paths only.
    pub fn staged(id: Uuid) -> Self {
        Self(Path::from_iter([STAGED.to_owned(), id.to_string()]))
    }

    /// Where an upload lies that was taken from there. Whoever takes it does so in a folder of their own, so that it is
    /// not changed any more once it was checked.
    pub fn taken(attempt: Uuid, id: Uuid) -> Self {
        Self(Path::from_iter([
            UPLOADS.to_owned(),
            attempt.to_string(),
            id.to_string(),
        ]))
    }

    /// Where an output of an attempt lies. Attempts have folders of their own, so that one that was given up can't
    /// touch what its successor writes. The folder is named by a hash, because the token itself is a secret.
    pub fn output(job: Uuid, lease_token: &str, id: Uuid) -> Self {
        let mut lease = hex::encode(Sha256::digest(lease_token.as_bytes()));
        lease.truncate(LEASE_DIGITS);
        Self(Path::from_iter([
            OUTPUTS.to_owned(),
            job.to_string(),
            lease,
            id.to_string(),
        ]))
    }

    /// What paths begin with.
    pub(super) fn roots() -> [Path; 3] {
        [STAGED, UPLOADS, OUTPUTS].map(Path::from)
    }

    /// Whether bytes may lie there for a while before a row says so: those that went to the store without the server.
    pub fn is_ahead_of_its_row(&self) -> bool {
        let parts = self.0.parts().count();
        self.0.prefix_matches(&Path::from(STAGED)) || self.0.prefix_matches(&Path::from(UPLOADS)) && parts == 3
    }

    /// The id of the artifact, with which its path ends.
    pub fn id(&self) -> Option<Uuid> {
        self.0.filename().and_then(|id| Uuid::try_parse(id).ok())
    }

    /// Reads a path as the ledger keeps it. Anything that was not made by one of the functions above is refused.
    pub fn parse(text: &str) -> StoreResult<Self> {
        let is_id = |part: &str| Uuid::try_parse(part).is_ok_and(|id| id.to_string() == part);
        let is_lease =
            |part: &str| part.len() == LEASE_DIGITS && part.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'));
        let known = match text.split('/').collect::<Vec<_>>()[..] {
            [STAGED | UPLOADS, id] => is_id(id),
            [UPLOADS, attempt, id] => is_id(attempt) && is_id(id),
            [OUTPUTS, job, lease, id] => is_id(job) && is_lease(lease) && is_id(id),
            _ => false,
        };
        if !known {
            return Err(StoreError::BadPath(text.to_owned()));
        }
        Ok(Self(Path::from(text)))
    }

    pub(super) fn as_object_path(&self) -> &Path {
        &self.0
    }
}

impl fmt::Display for ArtifactPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}
