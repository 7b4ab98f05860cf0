//! Decides a claim on what was read: the words of all assets that it could be about against all readings, with every pair
//! counted as a hypothesis.
use std::collections::HashSet;

use futures::TryStreamExt;
use guardsplat_codeword::{HypothesisReading, Index, MessageLength, Reading, Scheme, Target, Verdict};

use super::Claim;
use super::decided::{Best, Decided, Tried, unmarkable};
use crate::error::{Error, Result};
use crate::ledger::{AssetId, Candidate, KeyRow, ReadBefore, candidates};
use crate::marks::{self, CODE};
use crate::service::Service;
use crate::service::names::ResourceKind;

/// All words that a claim could be about.
struct Words {
    index: Index,
    /// The assets, by rows of the index.
    assets: Vec<AssetId>,
    tried: Tried,
}

/// Readings with one share of the rate each, for among them the largest rank sum is the least p-value.
fn of_equal_shares(read: &[HypothesisReading], readings: &[Reading]) -> Vec<Vec<Reading>> {
    let mut groups: Vec<(u64, Vec<Reading>)> = Vec::new();
    for (read, reading) in read.iter().zip(readings) {
        match groups.iter_mut().find(|(tries, _)| *tries == read.tries) {
            Some((_, group)) => group.push(*reading),
            None => groups.push((read.tries, vec![*reading])),
        }
    }
    groups.into_iter().map(|(_, group)| group).collect()
}

impl Service {
    /// Decides a claim on `read`, whose logits are of the key's length. Of a suspect it is said what there was `before`; a
    /// scene that was just marked has nothing.
    ///
    /// Where pictures were compared with an `original`, of this SHA-256, only assets that were registered from it can be
    /// claimed: it was fixed before their words were drawn. Any other file could have the word in it.
    pub(crate) async fn decide(
        &self,
        claim: &Claim,
        key: &KeyRow,
        read: &[HypothesisReading],
        before: Option<ReadBefore>,
        original: Option<[u8; 32]>,
    ) -> Result<Decided> {
        let readings_paid = before.map_or(1, |before| before.readings.max(1));
        let mut words = match key.bits == marks::bits() {
            true => self.words(claim, key, original).await?,
            false => {
                return Ok(unmarkable(
                    key,
                    self.limits().false_positive_rate,
                    before,
                    readings_paid,
                ));
            }
        };
        // Counted behind the comparison, so that none was compared that is not paid for. Whoever claims may have
        // registered all of them, under as many owners as they like, and name the one that fits: so all are paid for,
        // whichever is named.
        let all = self.ledger().count_assets(key.id, None).await?;
        words.tried.assets_paid = all.max(words.tried.assets);
        words.tried.readings = readings_paid;
        let failed = |error| Error::internal("deciding a claim", error);
        let readings = read.iter().map(|read| Reading::from_logits(&read.logits));
        let readings = readings.collect::<Result<Vec<_>, _>>().map_err(failed)?;
        let mut nearest = Vec::new();
        for alike in of_equal_shares(read, &readings) {
            // Whatever else agrees as well would be judged alike.
            let found = words.index.nearest(&alike, 1).map_err(failed)?;
            let found = found.first().and_then(|hit| words.assets.get(hit.row as usize));
            if let Some(&id) = found.filter(|id| !nearest.iter().any(|best: &Best| best.asset.id == **id)) {
                nearest.push(self.best(key, id).await?);
            }
        }
        let targets: Vec<_> = nearest.iter().map(|best| best.target.clone()).collect();
        let named = matches!(claim, Claim::Asset(_));
        let claim = guardsplat_codeword::Claim {
            scheme: Scheme::Coded { code: CODE },
            readings: read,
            targets: &targets,
            targets_tried: Some(words.tried.assets_paid),
            other_tries: words.tried.readings,
            rate: self.limits().false_positive_rate,
        };
        let mut tested = claim.test().map_err(failed)?;
        if tested.answer.verdict == Verdict::UnknownKey {
            let of_original = original.map_or("", |_| " and from this original");
            tested.answer.reason = Some(format!(
                "no asset is registered that the claim could be about, for this key{of_original}"
            ));
        }
        let found = tested.answer.best.as_ref();
        let read = found.and_then(|found| read.iter().find(|read| read.name == found.hypothesis));
        let best = found.and_then(|found| nearest.into_iter().find(|best| best.target.id == found.target));
        let assets_of_owner = match &best {
            Some(best) => self.ledger().count_assets(key.id, Some(best.owner.id)).await?,
            None => 0,
        };
        let mut decided = Decided {
            logits: read.map(|read| read.logits.clone()).unwrap_or_default(),
            tested,
            tried: words.tried,
            best,
            named,
            before,
            assets_of_owner,
        };
        decided.refuse_later_assets();
        Ok(decided)
    }

    async fn words(&self, claim: &Claim, key: &KeyRow, original: Option<[u8; 32]>) -> Result<Words> {
        let mut words = Words {
            index: Index::new(MessageLength::CODED),
            assets: Vec::new(),
            tried: Tried::default(),
        };
        let mut owners = HashSet::new();
        let mut add = |asset: &Candidate| -> Result<()> {
            if original.is_some_and(|original| original != asset.sha256) {
                return Ok(());
            }
            let mark = marks::mark(self.master(), key.id, asset)?;
            let failed = |error| Error::internal("searching marks", error);
            words.index.push(&mark.word).map_err(failed)?;
            words.assets.push(asset.asset);
            owners.insert(asset.owner);
            Ok(())
        };
        if let Claim::Asset(id) = claim {
            let asset = self.ledger().candidate(*id).await?;
            add(&asset.ok_or_else(|| ResourceKind::Asset.not_found(*id))?)?;
        } else {
            let mut all = std::pin::pin!(candidates::of_key(self.ledger(), key.id));
            while let Some(asset) = all.try_next().await? {
                match claim {
                    Claim::Owner(owner) if asset.owner != *owner => {}
                    _ => add(&asset)?,
                }
            }
        }
        words.tried = Tried {
            owners: owners.len() as u64,
            assets: words.assets.len() as u64,
            ..Tried::default()
        };
        Ok(words)
    }

    async fn best(&self, key: &KeyRow, id: AssetId) -> Result<Best> {
        let candidate = self.ledger().candidate(id).await?;
        let asset = self.ledger().get_asset(id).await?;
        let (candidate, asset) = candidate.zip(asset).ok_or_else(|| ResourceKind::Asset.not_found(id))?;
        let owner = self.ledger().get_owner(asset.owner).await?;
        let owner = owner.ok_or_else(|| ResourceKind::Owner.not_found(asset.owner))?;
        let commitment = self.ledger().get_commitment(asset.commitment).await?;
        let commitment = commitment.ok_or_else(|| ResourceKind::Commitment.not_found(asset.commitment))?;
        let mark = marks::mark(self.master(), key.id, &candidate)?;
        let target = Target {
            id: ResourceKind::Asset.name(id),
            word: mark.word,
            pad: Some(mark.pad),
        };
        Ok(Best {
            asset,
            owner,
            target,
            commitment,
        })
    }
}
