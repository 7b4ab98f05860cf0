//! One test per claim: are the words that were read one of these targets, at this false-positive rate?
//!
//! Pictures are read under each [`Hypothesis`](crate::Hypothesis) about what was done to them (nothing, cropped, turned,
//! mirrored …), and each gives one word, decided once from logits that were summed over views before. The best pair of a
//! reading and a target is judged by the [`AcceptanceRule`], which weighs bits by how clearly they were read
//! ([`signed_rank`]) and counts all hypotheses: targets, whatever else the caller tried, and readings, each by its share of
//! the rate ([`shares`](crate::shares)). Error correction reads the payload of a match afterwards, and never decides.
mod answer;
mod read;
#[cfg(test)]
mod tests;

use crate::acceptance::{AcceptanceRule, Verdict};
use crate::chance;
use crate::code::Scheme;
use crate::decision::too_few_decided;
use crate::error::{Error, Result};
use crate::message::Message;
use crate::reading::Reading;
use crate::signed_rank;
pub use answer::{Answer, Comparison, Confidences, ReadPayload, Tested};

/// Pictures of the suspect, read under one hypothesis.
#[derive(Clone, Debug, PartialEq)]
pub struct HypothesisReading {
    /// What was undone, for the report: "as given", "mirrored", ….
    pub name: String,
    /// Views that were summed.
    pub views: u32,
    /// Logits, one a bit, summed over the views. 0 and NaN leave a bit undecided: see [`Reading`].
    pub logits: Vec<f32>,
    /// Of how many equal parts of the rate this reading has one, at least 1: all readings of a claim together have no more
    /// than the rate ([`shares`](crate::shares)).
    pub tries: u64,
}

/// A registered word that the suspect may carry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    /// What the registry calls it.
    pub id: String,
    /// The word that was embedded: under its pad, where the scheme is coded.
    pub word: Message,
    /// The pad, to read the payload of a match with; not needed for the verdict.
    pub pad: Option<Message>,
}

/// A question to the statistics.
#[derive(Clone, Copy, Debug)]
pub struct Claim<'a> {
    /// What kind of words these are.
    pub scheme: Scheme,
    /// All readings that were made, also those that look bad.
    pub readings: &'a [HypothesisReading],
    /// What they are compared with. None means that the claim's key or owner is unknown.
    pub targets: &'a [Target],
    /// Targets that were searched, where `targets` are only the nearest of them; `None` when `targets` are all.
    pub targets_tried: Option<u64>,
    /// How often this was done besides: keys or decoders tried, earlier claims about the same suspect. At least 1.
    pub other_tries: u64,
    /// A match is claimed wrongly at most so often, between 0 and 1.
    pub rate: f64,
}

/// What a reading pays, and needs.
struct Terms {
    reading: Reading,
    rule: AcceptanceRule,
    needed: Option<u32>,
}

impl Terms {
    /// Whether it could be a match, whatever the targets are.
    fn can_match(&self) -> bool {
        self.needed
            .is_some_and(|needed| self.reading.largest_rank_sum() >= needed)
    }
}

/// The pair with the least p-value, the first of equal ones.
struct Winner<'a> {
    read: &'a HypothesisReading,
    terms: &'a Terms,
    target: &'a Target,
    rank_sum: u32,
}

impl Claim<'_> {
    /// Decides.
    ///
    /// - No targets: [`Verdict::UnknownKey`], and nothing is compared.
    /// - No readings, too few bits for the rate and the hypotheses, or too few bits decided: [`Verdict::Inconclusive`],
    ///   with a reason.
    /// - Else [`Verdict::Match`] if the corrected p-value is at or below the rate, and [`Verdict::NoMatch`] if not.
    ///
    /// # Errors
    /// [`Error::OtherLength`] for logits, words or pads of another length than the scheme's, [`Error::Rate`], and
    /// [`Error::Hypotheses`] for counts that contradict the lists or whose product is above 2^64 - 1.
    pub fn test(&self) -> Result<Tested> {
        chance::check_rate(self.rate)?;
        let others = self.other_hypotheses()?;
        let terms = self.terms(others)?;
        self.check_targets()?;
        let bits = self.scheme.length().bits();
        // Of nothing that was read, what one reading would need is told.
        let alone = AcceptanceRule {
            false_positive_rate: self.rate,
            hypotheses: others,
        };
        let mut answer = Answer {
            verdict: Verdict::Inconclusive,
            rate: self.rate,
            bits,
            needed_rank_sum: alone.least_rank_sum(bits)?,
            hypotheses: others,
            best: None,
            payload: None,
            reason: None,
        };
        let undecided = |answer| {
            Ok(Tested {
                answer,
                confidences: None,
            })
        };
        if self.targets.is_empty() {
            answer.verdict = Verdict::UnknownKey;
            answer.reason = Some("no word is registered for the key that was named".into());
            return undecided(answer);
        }
        let Some(winner) = self.winner(&terms)? else {
            answer.reason = Some("no picture was read".into());
            return undecided(answer);
        };
        let Terms { reading, rule, needed } = winner.terms;
        (answer.needed_rank_sum, answer.hypotheses) = (*needed, rule.hypotheses);
        answer.best = Some(Comparison {
            hypothesis: winner.read.name.clone(),
            views: winner.read.views,
            target: winner.target.id.clone(),
            matched_bits: reading.matches(&winner.target.word)?,
            undecided_bits: reading.undecided_bits(),
            rank_sum: winner.rank_sum,
            p_alone: signed_rank::tail(bits, winner.rank_sum)?,
            p_value: rule.p_value(bits, winner.rank_sum)?,
        });
        match *needed {
            None => answer.reason = Some(too_short(bits, rule.hypotheses, self.rate)?),
            Some(_) if !terms.iter().any(Terms::can_match) => {
                let decided = terms.iter().map(|terms| terms.reading.decided_bits()).max();
                answer.reason = Some(too_few_decided(decided.unwrap_or(0), bits));
            }
            Some(needed) if winner.rank_sum >= needed => {
                answer.verdict = Verdict::Match;
                answer.payload = read::payload(self.scheme, winner.target, &winner.read.logits)?;
            }
            Some(_) => answer.verdict = Verdict::NoMatch,
        }
        let confidences = Some(Confidences::of(reading, &winner.read.logits));
        Ok(Tested { answer, confidences })
    }

    /// Targets times other tries. No targets count as one, so that limits are told for nothing too.
    fn other_hypotheses(&self) -> Result<u64> {
        let given = self.targets.len() as u64;
        let targets = self.targets_tried.unwrap_or(given);
        if targets < given {
            let reason = format!("{targets} are fewer than the {given} targets given");
            return Err(bad("targets tried", reason));
        }
        if self.other_tries == 0 {
            return Err(bad("other tries", "0 is below 1: this claim counts".into()));
        }
        let product = targets.max(1).checked_mul(self.other_tries);
        product.ok_or_else(too_many)
    }

    /// What each reading pays.
    fn terms(&self, others: u64) -> Result<Vec<Terms>> {
        if let Some(read) = self.readings.iter().find(|read| read.tries == 0) {
            return Err(bad("tries", format!("0 is below 1: reading {:?} counts", read.name)));
        }
        let parts: f64 = self.readings.iter().map(|read| 1.0 / read.tries as f64).sum();
        if parts > 1.0 + 1e-9 {
            return Err(bad(
                "tries",
                format!("the readings have {parts} times the rate together"),
            ));
        }
        let bits = self.scheme.length().bits();
        let terms = |read: &HypothesisReading| {
            let reading = Reading::from_logits(&read.logits)?;
            reading.require(&format!("reading {:?}", read.name), self.scheme.length())?;
            let rule = AcceptanceRule {
                false_positive_rate: self.rate,
                hypotheses: read.tries.checked_mul(others).ok_or_else(too_many)?,
            };
            let needed = rule.least_rank_sum(bits)?;
            Ok(Terms { reading, rule, needed })
        };
        self.readings.iter().map(terms).collect()
    }

    fn check_targets(&self) -> Result<()> {
        let expected = Message::zeros(self.scheme.length());
        for target in self.targets {
            expected.require(&format!("target {:?}", target.id), &target.word)?;
            if let Some(pad) = &target.pad {
                expected.require(&format!("the pad of target {:?}", target.id), pad)?;
            }
        }
        Ok(())
    }

    fn winner<'a>(&'a self, terms: &'a [Terms]) -> Result<Option<Winner<'a>>> {
        let bits = self.scheme.length().bits();
        let mut best: Option<(Winner<'a>, (bool, f64))> = None;
        for (read, terms) in self.readings.iter().zip(terms) {
            for target in self.targets {
                let rank_sum = terms.reading.rank_sum(&target.word)?;
                // What can't match whatever it reads comes last. Not cut at 1, so that of bad ones the better is told.
                let p_value = signed_rank::tail(bits, rank_sum)? * terms.rule.hypotheses as f64;
                let rank = (terms.needed.is_none(), p_value);
                if best.as_ref().is_none_or(|(_, least)| rank < *least) {
                    let winner = Winner {
                        read,
                        terms,
                        target,
                        rank_sum,
                    };
                    best = Some((winner, rank));
                }
            }
        }
        Ok(best.map(|(winner, _)| winner))
    }
}

fn bad(field: &'static str, reason: String) -> Error {
    Error::Hypotheses { field, reason }
}

fn too_many() -> Error {
    bad("hypotheses", "more than 2^64 - 1 were tried".into())
}

fn too_short(bits: u32, hypotheses: u64, rate: f64) -> Result<String> {
    let reachable = chance::reachable_rate(bits, hypotheses)?;
    Ok(format!(
        "{bits} bits with {hypotheses} hypotheses can never reach a rate of {rate:e}: all of them match by chance at a rate \
         of up to {reachable:.1e}"
    ))
}
