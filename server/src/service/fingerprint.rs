//! By what a request is known when it is sent again: all that was asked for, with the content of artifacts in place of
//! their names.
use guardsplat_proto::v1::Job;
use guardsplat_proto::v1::job::Spec;
use prost::Message as _;
use sha2::{Digest, Sha256};

use crate::ledger::{ArtifactId, ArtifactRow};

/// SHA-256 of what is asked for, without the names of artifacts: a client that sends a file again gets another name for
/// the same bytes. Encoded the same way every time: fields in order, without unknown ones.
pub fn asked(job: &Job) -> [u8; 32] {
    let mut job = job.clone();
    let others = match &mut job.spec {
        Some(Spec::Embed(spec)) => {
            spec.scene.clear();
            vec![&mut spec.cameras]
        }
        Some(Spec::Verify(spec)) => {
            spec.suspects.clear();
            vec![&mut spec.cameras, &mut spec.original]
        }
        Some(Spec::CreateKey(_)) | None => Vec::new(),
    };
    // What the last of its artifacts are, which are no suspects.
    for name in others.into_iter().filter(|name| !name.is_empty()) {
        *name = "given".into();
    }
    Sha256::digest(job.encode_to_vec()).into()
}

/// SHA-256 of a request: what was asked for, and what is in the artifacts (SHA-256 and length), in their order. One
/// that is not there any more stands for itself.
pub fn whole(asked: &[u8; 32], inputs: &[(ArtifactId, Option<ArtifactRow>)]) -> [u8; 32] {
    let mut hash = Sha256::new();
    hash.update(asked);
    for (id, row) in inputs {
        match row {
            Some(row) => {
                hash.update([1]);
                hash.update(row.sha256.as_bytes());
                hash.update(row.size.to_be_bytes());
            }
            None => {
                hash.update([0]);
                hash.update(id.as_bytes());
            }
        }
    }
    hash.finalize().into()
}
