//! A decided claim as the report tells it.
use guardsplat_codeword::{Answer, ReadPayload, Verdict};
use guardsplat_evidence as evidence;
use guardsplat_evidence::{
    Bit, Found, History, HypothesisGroup, Multiplicity, Reason, Registration, Sha256, Tried, Verification,
};

use super::{Decided, payload, timestamp};
use crate::error::Result;
use crate::ledger::KeyRow;
use crate::service::claims::Best;
use crate::service::names::ResourceKind;

/// A claim that was decided, with how it was read.
pub struct Read<'a> {
    /// The outcome.
    pub decided: &'a Decided,
    /// The hypotheses that were tried, by kinds.
    pub framings: Vec<HypothesisGroup>,
}

impl Read<'_> {
    /// What the report says of it.
    pub fn verification(&self, key: &KeyRow) -> Result<Verification> {
        let answer = &self.decided.tested.answer;
        Ok(Verification {
            verdict: answer.verdict,
            reason: self.reason(),
            note: self.note(),
            tried: Tried {
                framings: self.framings.clone(),
                owners: self.decided.tried.owners,
                assets: self.decided.tried.assets,
                paid: Some(Multiplicity {
                    assets: self.decided.tried.assets_paid,
                    readings: self.decided.tried.readings,
                }),
            },
            views: answer.best.as_ref().map_or(0, |best| best.views),
            decision: answer.best.as_ref().map(|best| {
                let matched = (best.matched_bits, best.rank_sum);
                evidence::Decision {
                    corrected: corrected(answer),
                    ..evidence::Decision::new(answer.bits, matched, answer.hypotheses, answer.rate)
                }
            }),
            history: self.history()?,
            found: self.found(key)?,
            strip: self.strip(),
        })
    }

    fn reason(&self) -> Option<Reason> {
        let answer = &self.decided.tested.answer;
        let inconclusive = answer.verdict == Verdict::Inconclusive;
        inconclusive.then(|| match answer.needed_rank_sum {
            Some(_) if self.decided.is_refused() => Reason::RegisteredLater,
            Some(_) => Reason::WeakReading,
            None if self.decided.too_few_bits() => Reason::TooFewBits,
            None => Reason::TooManyHypotheses,
        })
    }

    fn note(&self) -> Option<String> {
        let answer = &self.decided.tested.answer;
        let framing = answer.best.as_ref().map(|best| match best.undecided_bits {
            0 => format!("best in this framing: {}", best.hypothesis),
            bits => format!("best in this framing: {}; {bits} bits were undecided", best.hypothesis),
        });
        answer.reason.clone().or(framing)
    }

    /// What there was before, of a suspect.
    fn history(&self) -> Result<Option<History>> {
        let Some(before) = self.decided.before else {
            return Ok(None);
        };
        let shown = self.decided.shown();
        let registration = |best: &Best| -> Result<Registration> {
            let commitment = &best.commitment.commitment;
            Ok(Registration {
                asset: ResourceKind::Asset.name(best.asset.id),
                commitment: ResourceKind::Commitment.name(commitment.id),
                sequence: commitment.sequence,
                hash: Sha256(best.commitment.hash()),
                time: timestamp(commitment.time)?,
                revealed: best.asset.reveal_time.map(timestamp).transpose()?,
            })
        };
        Ok(Some(History {
            first_seen: timestamp(before.first_seen)?,
            readings_of_key: before.readings_of_key,
            assets_of_owner: shown.map(|_| self.decided.assets_of_owner),
            asset: shown.map(registration).transpose()?,
        }))
    }

    fn found(&self, key: &KeyRow) -> Result<Option<Found>> {
        let matches = self.decided.tested.answer.verdict == Verdict::Match;
        let Some(best) = self.decided.best.as_ref().filter(|_| matches) else {
            return Ok(None);
        };
        let named = |display_name: &str, name: String| match display_name {
            "" => name,
            display_name => format!("{display_name} ({name})"),
        };
        Ok(Some(Found {
            owner: named(&best.owner.display_name, ResourceKind::Owner.name(best.owner.id)),
            asset: named(&best.asset.display_name, ResourceKind::Asset.name(best.asset.id)),
            payload: Some(payload(key, best.asset.payload)?),
        }))
    }

    fn strip(&self) -> Vec<Bit> {
        let tested = &self.decided.tested;
        let Some(confidences) = &tested.confidences else {
            return Vec::new();
        };
        // A search that found nothing is nobody's business but the searcher's, who owns none of these assets.
        let mut wanted = self
            .decided
            .shown()
            .into_iter()
            .flat_map(|best| best.target.word.bits());
        let read = confidences.word.bits();
        let each = read.zip(&confidences.bits).zip(&self.decided.logits);
        each.map(|((read, &confidence), &logit)| {
            let wanted = wanted.next();
            Bit {
                // An undecided bit matches nothing.
                wanted: wanted.filter(|_| logit.abs() > 0.0),
                read,
                confidence: Some(f64::from(confidence)).filter(|c| c.is_finite()),
                logit: Some(f64::from(logit)).filter(|logit| logit.is_finite()),
            }
        })
        .collect()
    }
}

fn corrected(answer: &Answer) -> Option<u32> {
    match answer.payload {
        Some(ReadPayload::Read {
            corrected_bits,
            as_registered: true,
            ..
        }) => Some(corrected_bits),
        _ => None,
    }
}
