//! Which reading of a suspect a job makes, and what there was before it: whoever has one suspect read again and again, with
//! other views, cameras, originals or keys, pays for each.
use guardsplat_evidence::Role;
use sha2::{Digest, Sha256};

use crate::error::{Error, Result};
use crate::ledger::{ArtifactRow, JobRow, JobSpec, KeyRow, NewReading, ReadBefore};
use crate::service::names::ResourceKind;
use crate::service::{Service, clock, other_files, upload};

/// Views that a scene is read from where nothing is said.
const VIEWS: u32 = 20;

impl Service {
    /// Notes the reading that a verification made, and says what there was before.
    pub(super) async fn read_before(&self, job: &JobRow, key: &KeyRow) -> Result<ReadBefore> {
        let failed = |reason| Error::internal("noting a reading", reason);
        let JobSpec::Verify(spec) = &job.spec else {
            return Err(failed("the job is no verification"));
        };
        let mut files = Vec::with_capacity(spec.suspects.len());
        for name in &spec.suspects {
            let row = self.file("job.verify.suspects", name).await?;
            files.push((row.sha256, row.create_time));
        }
        files.sort();
        let mut hash = Sha256::new_with_prefix(b"guardsplat reading\0");
        hash.update((job.project.len() as u64).to_be_bytes());
        hash.update(job.project.as_bytes());
        hash.update(key.id.as_bytes());
        let views = if spec.views == 0 { VIEWS } else { spec.views };
        hash.update(views.to_be_bytes());
        hash.update(spec.size.to_be_bytes());
        hash.update(spec.seed.to_be_bytes());
        hash.update([spec.ignore_bad_rows.into()]);
        // Each has 64 digits, so no two lists give the same bytes.
        files.iter().for_each(|(sha256, _)| hash.update(sha256.as_bytes()));
        // Left out where there is none, so that readings from before these were there stay the same.
        for other in other_files::of_verify(spec) {
            let file = self.file(other.field, other.name).await?;
            hash.update(match other.role {
                Role::Cameras => &b"cameras\0"[..],
                _ => b"original\0",
            });
            hash.update(file.sha256.as_bytes());
        }
        if spec.scene_kind != 0 {
            hash.update(b"kind\0");
            hash.update(spec.scene_kind.to_be_bytes());
        }
        let id = hash.finalize().into();
        let new = NewReading {
            id,
            project: job.project.clone(),
            key: key.id,
            files,
        };
        self.ledger().note_reading(new, clock::now()).await?;
        let before = self.ledger().before(id).await?;
        before.ok_or_else(|| failed("the ledger has none of its files"))
    }

    /// SHA-256 of the original that a verification compares pictures with.
    pub(super) async fn original_of(&self, job: &JobRow) -> Result<Option<[u8; 32]>> {
        let name = match &job.spec {
            JobSpec::Verify(spec) if !spec.original.is_empty() => &spec.original,
            _ => return Ok(None),
        };
        let sha256 = self.file("job.verify.original", name).await?.sha256;
        let digest = upload::digest(&sha256);
        let digest = digest.ok_or_else(|| Error::internal("finding an original", "it has no SHA-256"))?;
        Ok(Some(digest))
    }

    async fn file(&self, field: &str, name: &str) -> Result<ArtifactRow> {
        let id = ResourceKind::Artifact.parse(field, name)?;
        let row = self.ledger().get_any_artifact(id).await?;
        row.ok_or_else(|| ResourceKind::Artifact.not_found(id))
    }
}
