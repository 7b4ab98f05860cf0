//! What a caller may see: what is of their own project. What is another's is not there, in the same words.
use guardsplat_commitment::Signed;
use sha2::{Digest, Sha256};
use uuid::{Builder, Uuid, Version};

use crate::access::{Caller, DEFAULT_PROJECT, Scope};
use crate::error::{Error, Result};
use crate::ledger::{
    ArtifactId, ArtifactRow, AssetId, AssetRow, CommitmentId, JobId, JobKind, JobRow, KeyId, KeyRow, LedgerError,
    OwnerId, OwnerRow,
};
use crate::service::Service;
use crate::service::names::ResourceKind;

impl Service {
    pub(crate) async fn owned_job(&self, project: &str, id: JobId) -> Result<JobRow> {
        let row = self.ledger().get_job(id).await?;
        let own = row.filter(|row| row.project == project);
        own.ok_or_else(|| ResourceKind::Job.not_found(id))
    }

    /// A visible artifact, if there is one that is this project's.
    pub(crate) async fn find_artifact(&self, project: &str, id: ArtifactId) -> Result<Option<ArtifactRow>> {
        let row = self.ledger().get_artifact(id).await?;
        Ok(row.filter(|row| row.project == project))
    }

    pub(crate) async fn owned_artifact(&self, project: &str, id: ArtifactId) -> Result<ArtifactRow> {
        let own = self.find_artifact(project, id).await?;
        own.ok_or_else(|| ResourceKind::Artifact.not_found(id))
    }

    /// An artifact whose bytes the caller may have: one of their own project; for workers what a running job reads.
    pub(crate) async fn readable_artifact(&self, caller: &Caller, id: ArtifactId) -> Result<ArtifactRow> {
        let row = self.ledger().get_artifact(id).await?;
        let row = row.ok_or_else(|| ResourceKind::Artifact.not_found(id))?;
        let works = [Scope::Embed, Scope::Verify].into_iter().any(|s| caller.scopes.has(s));
        let own = works && row.project == caller.project;
        if row.evidence && row.project == caller.project && (works || caller.scopes.has(Scope::Admin)) {
            return self.readable_evidence(caller, row).await;
        }
        if own || caller.scopes.has(Scope::Worker) && self.ledger().is_being_read(id).await? {
            return Ok(row);
        }
        Err(ResourceKind::Artifact.not_found(id))
    }

    /// Refuses whoever may not delete an artifact: signed evidence, and the original of an asset, need an admin; what jobs
    /// made, the right to make it; and what was uploaded, the right to upload.
    pub(crate) async fn may_delete(&self, caller: &Caller, artifact: &ArtifactRow) -> Result<()> {
        if caller.scopes.has(Scope::Admin) {
            return Ok(());
        }
        if artifact.evidence || self.ledger().is_original(artifact.id).await? {
            return caller.must(Scope::Admin);
        }
        match artifact.job {
            Some(job) => match self.ledger().peek_job(job).await? {
                Some(job) => caller.must(scope_of(job.kind())),
                None => Ok(()),
            },
            None => Ok(()),
        }
    }

    /// Evidence of a claim has all that [`Disclosure`](crate::service::claims::Disclosure) keeps from those who are no
    /// admins. That of a marking is also for those who mark.
    async fn readable_evidence(&self, caller: &Caller, row: ArtifactRow) -> Result<ArtifactRow> {
        let job = match row.job {
            Some(job) => self.ledger().peek_job(job).await?,
            None => None,
        };
        let of_marking = job.is_some_and(|job| job.kind() == JobKind::Embed);
        if caller.scopes.has(Scope::Admin) || of_marking && caller.scopes.has(Scope::Embed) {
            return Ok(row);
        }
        Err(Error::ScopeNeeded {
            what: "evidence tells how near a claim was",
            needed: Scope::Admin.word(),
        })
    }

    pub(crate) async fn owned_key(&self, project: &str, id: KeyId) -> Result<KeyRow> {
        let row = self.ledger().get_key(id).await?;
        let own = row.filter(|row| row.project == project);
        own.ok_or_else(|| ResourceKind::Key.not_found(id))
    }

    pub(crate) async fn owned_owner(&self, project: &str, id: OwnerId) -> Result<OwnerRow> {
        let row = self.ledger().get_owner(id).await?;
        let own = row.filter(|row| row.project == project);
        own.ok_or_else(|| ResourceKind::Owner.not_found(id))
    }

    pub(crate) async fn owned_asset(&self, project: &str, id: AssetId) -> Result<AssetRow> {
        let row = self.ledger().get_asset(id).await?;
        let own = row.filter(|row| row.project == project);
        own.ok_or_else(|| ResourceKind::Asset.not_found(id))
    }

    pub(crate) async fn owned_commitment(&self, project: &str, id: CommitmentId) -> Result<Signed> {
        let missing = || ResourceKind::Commitment.not_found(id);
        let signed = self.ledger().get_commitment(id).await?.ok_or_else(missing)?;
        let asset = self.ledger().get_asset(signed.commitment.asset).await?;
        let own = asset.is_some_and(|asset| asset.project == project);
        own.then_some(signed).ok_or_else(missing)
    }
}

/// What one must be allowed to do for a job of this kind.
pub(crate) fn scope_of(kind: JobKind) -> Scope {
    match kind {
        JobKind::Embed | JobKind::CreateKey => Scope::Embed,
        JobKind::Verify => Scope::Verify,
    }
}

/// The name that a request of a project has in the ledger, so that nobody's requests are in the way of anybody else's.
pub(crate) fn request(project: &str, id: Uuid) -> Uuid {
    // As before there were projects, so that requests of then are known. But not an id that looks as if it were made
    // below: whoever guesses those of another project could take them before it does.
    if project == DEFAULT_PROJECT && id.get_version() != Some(Version::Custom) {
        return id;
    }
    let mut hash = Sha256::new_with_prefix(b"guardsplat request id\0");
    hash.update(project.as_bytes());
    hash.update(b"\0");
    hash.update(id.as_bytes());
    let hash = hash.finalize();
    Builder::from_custom_bytes(std::array::from_fn(|i| hash[i])).into_uuid()
}

/// The ledger's error, with the request id as the caller gave it.
pub(crate) fn as_asked(error: LedgerError, asked: Option<Uuid>) -> Error {
    match (error, asked) {
        (LedgerError::RequestIdReused(_), Some(request_id)) => Error::RequestIdReused { request_id },
        (error, _) => error.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_of_projects_are_apart() {
        let id = Uuid::new_v4();
        assert_eq!(request(DEFAULT_PROJECT, id), id);
        let names = [request("a", id), request("b", id), request("a", Uuid::new_v4()), id];
        for (i, name) in names.iter().enumerate() {
            assert!(!names[..i].contains(name));
        }
        assert_eq!(request("a", id), names[0]);
        // What another project's request is known by can't be asked for.
        for taken in &names[..3] {
            assert_ne!(request(DEFAULT_PROJECT, *taken), *taken);
        }
        let told = as_asked(LedgerError::RequestIdReused(names[0]), Some(id)).to_string();
        assert!(told.contains(&id.to_string()), "{told}");
    }
}
