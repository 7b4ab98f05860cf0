//! Decides a claim on what was read: the words of all assets that it could be about against all readings, with every pair
//! counted as a hypothesis.
use std::collections::HashSet;

use futures::TryStreamExt;
use guardsplat_codeword::{
    Answer, HypothesisReading, Index, MessageLength, Reading, Scheme, Target, Tested, Verdict, chance,
};

use super::Claim;
use crate::error::{Error, Result};
use crate::ledger::{AssetId, AssetRow, Candidate, KeyRow, OwnerRow, candidates};
use crate::marks::{self, CODE};
use crate::service::Service;
use crate::service::names::ResourceKind;

/// A claim that was decided.
pub struct Decided {
    /// The answer, and what only the owner is given.
    pub tested: Tested,
    /// What was compared.
    pub tried: Tried,
    /// The logits of the best reading; empty where nothing was compared.
    pub logits: Vec<f32>,
    /// The asset that agreed best, with its owner.
    pub best: Option<Best>,
}

/// How much was compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tried {
    /// Owners of these assets.
    pub owners: u64,
    /// Assets, each with a word of its own.
    pub assets: u64,
}

/// The asset that agreed best.
pub struct Best {
    /// The asset.
    pub asset: AssetRow,
    /// Whose it is.
    pub owner: OwnerRow,
    /// Its word.
    pub target: Target,
}

/// All words that a claim could be about.
struct Words {
    index: Index,
    /// The assets, by rows of the index.
    assets: Vec<AssetId>,
    tried: Tried,
}

impl Service {
    /// Decides a claim on `read`, whose logits are of the key's length.
    pub(crate) async fn decide(&self, claim: &Claim, key: &KeyRow, read: &[HypothesisReading]) -> Result<Decided> {
        let words = match key.bits == marks::bits() {
            true => self.words(claim, key).await?,
            false => return Ok(unmarkable(key, self.limits().false_positive_rate)),
        };
        let failed = |error| Error::internal("deciding a claim", error);
        let readings = read.iter().map(|read| Reading::from_logits(&read.logits));
        let readings = readings.collect::<Result<Vec<_>, _>>().map_err(failed)?;
        // Whatever else agrees as well would be judged alike.
        let nearest = words.index.nearest(&readings, 1).map_err(failed)?;
        let found = nearest.first().and_then(|hit| words.assets.get(hit.row as usize));
        let best = match found {
            Some(&id) => Some(self.best(key, id).await?),
            None => None,
        };
        let targets: Vec<_> = best.iter().map(|best| best.target.clone()).collect();
        let claim = guardsplat_codeword::Claim {
            scheme: Scheme::Coded { code: CODE },
            readings: read,
            targets: &targets,
            targets_tried: Some(words.tried.assets),
            other_tries: 1,
            rate: self.limits().false_positive_rate,
        };
        let mut tested = claim.test().map_err(failed)?;
        if tested.answer.verdict == Verdict::UnknownKey {
            let reason = "no asset is registered that the claim could be about, for this key".to_owned();
            tested.answer.reason = Some(reason);
        }
        let name = tested.answer.best.as_ref().map(|best| best.hypothesis.as_str());
        let read = read.iter().find(|read| Some(read.name.as_str()) == name);
        Ok(Decided {
            logits: read.map(|read| read.logits.clone()).unwrap_or_default(),
            tested,
            tried: words.tried,
            best,
        })
    }

    async fn words(&self, claim: &Claim, key: &KeyRow) -> Result<Words> {
        let mut words = Words {
            index: Index::new(MessageLength::CODED),
            assets: Vec::new(),
            tried: Tried::default(),
        };
        let mut owners = HashSet::new();
        let mut add = |asset: &Candidate| -> Result<()> {
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
        };
        Ok(words)
    }

    async fn best(&self, key: &KeyRow, id: AssetId) -> Result<Best> {
        let candidate = self.ledger().candidate(id).await?;
        let asset = self.ledger().get_asset(id).await?;
        let (candidate, asset) = candidate.zip(asset).ok_or_else(|| ResourceKind::Asset.not_found(id))?;
        let owner = self.ledger().get_owner(asset.owner).await?;
        let owner = owner.ok_or_else(|| ResourceKind::Owner.not_found(asset.owner))?;
        let mark = marks::mark(self.master(), key.id, &candidate)?;
        let target = Target {
            id: ResourceKind::Asset.name(id),
            word: mark.word,
            pad: Some(mark.pad),
        };
        Ok(Best { asset, owner, target })
    }
}

/// What is answered for a key whose assets can't be marked.
fn unmarkable(key: &KeyRow, rate: f64) -> Decided {
    let reason = format!(
        "{} has {} bits, and assets are marked with {}: no asset of it can have been marked",
        ResourceKind::Key.name(key.id),
        key.bits,
        marks::bits()
    );
    let answer = Answer {
        verdict: Verdict::Inconclusive,
        rate,
        bits: key.bits,
        needed_bits: None,
        hypotheses: 1,
        best: None,
        payload: None,
        reason: Some(reason),
    };
    Decided {
        tested: Tested {
            answer,
            confidences: None,
        },
        tried: Tried::default(),
        logits: Vec::new(),
        best: None,
    }
}

impl Decided {
    /// Whether more bits, or fewer hypotheses, would have been needed to decide anything.
    pub fn too_few_bits(&self) -> bool {
        let answer = &self.tested.answer;
        chance::reachable_rate(answer.bits, 1).is_ok_and(|reachable| reachable > answer.rate) || answer.best.is_none()
    }
}
