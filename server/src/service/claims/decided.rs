//! A claim that was decided: what was compared and paid for, and what of it may be told.
use guardsplat_codeword::{Answer, Target, Tested, Verdict, chance};
use guardsplat_commitment::Signed;

use crate::ledger::{AssetRow, KeyRow, OwnerRow, ReadBefore};
use crate::marks;
use crate::service::clock;
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

/// What is answered for a key whose assets can't be marked.
pub(super) fn unmarkable(key: &KeyRow, rate: f64, before: Option<ReadBefore>, readings: u64) -> Decided {
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
        needed_rank_sum: None,
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
    pub(super) fn refuse_later_assets(&mut self) {
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
        let enough = answer.best.as_ref().zip(answer.needed_rank_sum);
        answer.verdict == Verdict::Inconclusive && enough.is_some_and(|(best, needed)| best.rank_sum >= needed)
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
