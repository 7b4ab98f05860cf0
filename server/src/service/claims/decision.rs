//! Decides a claim on what was read: the words of all assets that it could be about against all readings, with every pair
//! counted as a hypothesis.
use std::collections::HashSet;

use futures::TryStreamExt;
use guardsplat_codeword::{
    Answer, HypothesisReading, Index, MessageLength, Reading, Scheme, Target, Tested, Verdict, chance,
};
use guardsplat_commitment::Signed;

use super::Claim;
use crate::error::{Error, Result};
use crate::ledger::{AssetId, AssetRow, Candidate, KeyRow, OwnerRow, ReadBefore, candidates};
use crate::marks::{self, CODE};
use crate::service::names::ResourceKind;
use crate::service::{Service, clock};

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
    /// Whether the claim named that asset, whose owner may see its word even where it does not match.
    pub named: bool,
    /// What there was before, of a suspect that was read.
    pub before: Option<ReadBefore>,
    /// Assets of the owner of the best one, under the key.
    pub assets_of_owner: u64,
}

/// How much was compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tried {
    /// Owners of these assets.
    pub owners: u64,
    /// Assets, each with a word of its own.
    pub assets: u64,
    /// Assets that are paid for: all of the key, since whoever claims may have chosen among them.
    pub assets_paid: u64,
    /// Readings of the suspect that are paid for, this one included.
    pub readings: u64,
}

/// The asset that agreed best.
pub struct Best {
    /// The asset.
    pub asset: AssetRow,
    /// Whose it is.
    pub owner: OwnerRow,
    /// Its word.
    pub target: Target,
    /// What was signed when it was registered.
    pub commitment: Signed,
}

/// All words that a claim could be about.
struct Words {
    index: Index,
    /// The assets, by rows of the index.
    assets: Vec<AssetId>,
    tried: Tried,
}

impl Service {
    /// Decides a claim on `read`, whose logits are of the key's length. Of a suspect it is said what there was `before`; a
    /// scene that was just marked has nothing.
    pub(crate) async fn decide(
        &self,
        claim: &Claim,
        key: &KeyRow,
        read: &[HypothesisReading],
        before: Option<ReadBefore>,
    ) -> Result<Decided> {
        let readings_paid = before.map_or(1, |before| before.readings.max(1));
        let mut words = match key.bits == marks::bits() {
            true => self.words(claim, key).await?,
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
        // Whatever else agrees as well would be judged alike.
        let nearest = words.index.nearest(&readings, 1).map_err(failed)?;
        let found = nearest.first().and_then(|hit| words.assets.get(hit.row as usize));
        let best = match found {
            Some(&id) => Some(self.best(key, id).await?),
            None => None,
        };
        let targets: Vec<_> = best.iter().map(|best| best.target.clone()).collect();
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
            let reason = "no asset is registered that the claim could be about, for this key".to_owned();
            tested.answer.reason = Some(reason);
        }
        let name = tested.answer.best.as_ref().map(|best| best.hypothesis.as_str());
        let read = read.iter().find(|read| Some(read.name.as_str()) == name);
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

/// What is answered for a key whose assets can't be marked.
fn unmarkable(key: &KeyRow, rate: f64, before: Option<ReadBefore>, readings: u64) -> Decided {
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
        tried: Tried {
            readings,
            ..Tried::default()
        },
        logits: Vec::new(),
        best: None,
        named: false,
        before,
        assets_of_owner: 0,
    }
}

impl Decided {
    /// Takes a match back whose asset is younger than its suspect: the word was drawn when the asset was registered, so no
    /// file from before can carry it. Then the asset was chosen to fit, or chance did it.
    fn refuse_later_assets(&mut self) {
        let Some((best, before)) = self.best.as_ref().zip(self.before) else {
            return;
        };
        if self.tested.answer.verdict != Verdict::Match || !self.is_later(best) {
            return;
        }
        let [registered, seen] = [best.commitment.commitment.time, before.first_seen].map(clock::text);
        let reason = format!(
            "{} was registered at {registered}, and a file of this suspect was here at {seen} already: it can't carry that \
             asset's mark",
            best.target.id
        );
        let answer = &mut self.tested.answer;
        answer.verdict = Verdict::Inconclusive;
        answer.payload = None;
        answer.reason = Some(reason);
    }

    /// Whether an asset was registered after a file of the suspect had been seen.
    pub fn is_later(&self, asset: &Best) -> bool {
        self.before
            .is_some_and(|before| asset.commitment.commitment.time > before.first_seen)
    }

    /// Whether so many bits agree that it would be a match, were the asset not younger than its suspect.
    pub fn is_refused(&self) -> bool {
        let answer = &self.tested.answer;
        let enough = answer.best.as_ref().zip(answer.needed_bits);
        answer.verdict == Verdict::Inconclusive && enough.is_some_and(|(best, needed)| best.matched_bits >= needed)
    }

    /// The asset, where it may be told of: one that was named or found. What came nearest in a search that found nothing is
    /// nobody's business.
    pub fn shown(&self) -> Option<&Best> {
        let found = self.tested.answer.verdict == Verdict::Match || self.is_refused();
        self.best.as_ref().filter(|_| self.named || found)
    }

    /// Whether more bits, or fewer hypotheses, would have been needed to decide anything.
    pub fn too_few_bits(&self) -> bool {
        let answer = &self.tested.answer;
        chance::reachable_rate(answer.bits, 1).is_ok_and(|reachable| reachable > answer.rate) || answer.best.is_none()
    }
}
