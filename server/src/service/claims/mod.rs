//! Whose mark a job writes or looks for: named in its spec, checked when it is submitted, decided when it was read.
mod conclusion;
mod decided;
mod decision;
mod disclosure;
mod hypotheses;
mod readings;

use futures::TryStreamExt;
use guardsplat_proto::v1::{EmbedSpec, VerifySpec};

use crate::error::{Error, Result};
use crate::ledger::{ArtifactId, AssetId, JobKind, JobRow, JobSpec, KeyRow, OwnerId, candidates};
use crate::marks;
use crate::service::names::ResourceKind;
use crate::service::submission::Submission;
use crate::service::violations::Violations;
use crate::service::{Service, upload};
pub(crate) use conclusion::WorkerReadings;
pub(crate) use decided::{Best, Decided};
pub(crate) use disclosure::Disclosure;

/// The field of a verification that names the original.
const VERIFIED_WITH: &str = "job.verify.original";

/// What a claim is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Claim {
    /// This asset's mark.
    Asset(AssetId),
    /// The mark of any asset of this owner.
    Owner(OwnerId),
    /// That of any asset of the key.
    Search,
}

/// The asset that a scene is to be marked as, if one is named.
pub fn of_embed(spec: &EmbedSpec) -> Result<Option<Claim>> {
    match spec.asset.as_str() {
        "" => Ok(None),
        name => ResourceKind::Asset
            .parse("job.embed.asset", name)
            .map(|id| Some(Claim::Asset(id))),
    }
}

/// The claim on a suspect, if there is one.
pub fn of_verify(spec: &VerifySpec) -> Result<Option<Claim>> {
    let given = [
        ("job.verify.message", !spec.message.is_empty()),
        ("job.verify.asset", !spec.asset.is_empty()),
        ("job.verify.owner", !spec.owner.is_empty()),
        ("job.verify.search", spec.search),
    ];
    let mut problems = Violations::default();
    for (field, _) in given.iter().filter(|(_, given)| *given).skip(1) {
        problems.add(*field, "is one too many: give one of message, asset, owner and search");
    }
    let asset = match spec.asset.as_str() {
        "" => None,
        name => problems.take(ResourceKind::Asset.parse("job.verify.asset", name))?,
    };
    let owner = match spec.owner.as_str() {
        "" => None,
        name => problems.take(ResourceKind::Owner.parse("job.verify.owner", name))?,
    };
    problems.finish()?;
    let search = spec.search.then_some(Claim::Search);
    Ok(asset.map(Claim::Asset).or(owner.map(Claim::Owner)).or(search))
}

/// Whether a verification is no claim, and gives back every bit that was read.
pub(crate) fn is_raw(spec: &VerifySpec) -> bool {
    spec.asset.is_empty() && spec.owner.is_empty() && !spec.search
}

/// The claim of a job that is kept.
pub(crate) fn of_job(job: &JobRow) -> Result<Option<Claim>> {
    match &job.spec {
        JobSpec::Embed(spec) => of_embed(spec),
        JobSpec::Verify(spec) => of_verify(spec),
        JobSpec::CreateKey(_) => Ok(None),
    }
}

impl Service {
    /// Refuses a claim on what is not there, is of another key, or can't be marked as is asked.
    pub(crate) async fn check_claim(
        &self,
        project: &str,
        claim: &Claim,
        key: &KeyRow,
        submission: &Submission,
    ) -> Result<()> {
        let (field, key_field) = match submission.spec.kind() {
            JobKind::Embed => ("job.embed.asset", "job.embed.key"),
            _ => ("job.verify.asset", "job.verify.key"),
        };
        let original = match &submission.spec {
            JobSpec::Verify(spec) => submission.inputs.last().filter(|_| !spec.original.is_empty()),
            _ => None,
        };
        let id = match claim {
            Claim::Search => return self.check_registered(project, key, None, original).await,
            Claim::Owner(id) => {
                self.owned_owner(project, *id).await?;
                return self.check_registered(project, key, Some(*id), original).await;
            }
            Claim::Asset(id) => *id,
        };
        let asset = self.owned_asset(project, id).await?;
        if asset.key != key.id {
            let reason = format!(
                "was registered for {}, not for this key",
                ResourceKind::Key.name(asset.key)
            );
            return Err(Error::invalid(field, reason));
        }
        if let JobSpec::Verify(_) = &submission.spec {
            return self
                .check_original(project, VERIFIED_WITH, original, &asset.sha256)
                .await;
        }
        if key.bits != marks::bits() {
            let reason = format!("has {} bits, assets are marked with {}", key.bits, marks::bits());
            return Err(Error::invalid(key_field, reason));
        }
        self.check_original(project, "job.embed.scene", submission.inputs.first(), &asset.sha256)
            .await
    }

    /// Refuses an original from which no asset of the key, or of this owner of them, was registered: nothing could be
    /// claimed with it.
    async fn check_registered(
        &self,
        project: &str,
        key: &KeyRow,
        owner: Option<OwnerId>,
        original: Option<&ArtifactId>,
    ) -> Result<()> {
        let Some(original) = self.original_hash(project, original).await? else {
            return Ok(());
        };
        let sha256 = upload::digest(&original);
        let mut assets = std::pin::pin!(candidates::of_key(self.ledger(), key.id));
        while let Some(asset) = assets.try_next().await? {
            if Some(asset.sha256) == sha256 && owner.is_none_or(|owner| owner == asset.owner) {
                return Ok(());
            }
        }
        let of = match owner {
            Some(owner) => format!("asset of {} and this key", ResourceKind::Owner.name(owner)),
            None => "asset of this key".to_owned(),
        };
        let reason = format!("has the SHA-256 {original}, from which no {of} was registered");
        Err(Error::invalid(VERIFIED_WITH, reason))
    }

    /// Refuses an original that is not the one that was registered.
    async fn check_original(
        &self,
        project: &str,
        field: &str,
        original: Option<&ArtifactId>,
        registered: &[u8; 32],
    ) -> Result<()> {
        let Some(original) = self.original_hash(project, original).await? else {
            return Ok(());
        };
        if upload::digest(&original).as_ref() != Some(registered) {
            let reason = format!(
                "has the SHA-256 {original}, and the original that was registered has {}",
                hex::encode(registered)
            );
            return Err(Error::invalid(field, reason));
        }
        Ok(())
    }

    /// The SHA-256 of an original, if one is given and there. One that is gone is told of by the ledger, which also knows
    /// whether the same was asked for before.
    async fn original_hash(&self, project: &str, original: Option<&ArtifactId>) -> Result<Option<String>> {
        match original {
            Some(&id) => Ok(self.find_artifact(project, id).await?.map(|row| row.sha256)),
            None => Ok(None),
        }
    }

    /// The word that an asset of a key is marked with, in hexadecimal, for the worker that marks it.
    pub(crate) async fn word_of(&self, spec: &EmbedSpec) -> Result<Option<String>> {
        let Some(Claim::Asset(id)) = of_embed(spec)? else {
            return Ok(None);
        };
        let key = ResourceKind::Key.parse("job.embed.key", &spec.key)?;
        let asset = self.ledger().candidate(id).await?;
        let asset = asset.ok_or_else(|| ResourceKind::Asset.not_found(id))?;
        Ok(Some(marks::mark(self.master(), key, &asset)?.word.to_string()))
    }
}
