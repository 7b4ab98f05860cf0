//! One test per claim: are the words that were read one of these targets, at this false-positive rate?
//!
//! Pictures are read under each [`Hypothesis`](crate::Hypothesis) about what was done to them (nothing, cropped, turned,
//! mirrored …), and each gives one word, decided once from logits that were summed over views before. The best pair of a
//! reading and a target is judged by the [`AcceptanceRule`], which counts all hypotheses: readings, targets, and whatever else the caller tried. Error correction reads the payload of
//! a match afterwards, and never decides.
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

/// The pair with the most matches, the first of equal ones.
struct Winner<'a> {
    read: &'a HypothesisReading,
    reading: Reading,
    target: &'a Target,
    matched: u32,
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
        let hypotheses = self.hypotheses()?;
        let readings = self.decided()?;
        self.check_targets()?;
        let bits = self.scheme.length().bits();
        let rule = AcceptanceRule {
            false_positive_rate: self.rate,
            hypotheses,
        };
        let needed = rule.least_matches(bits)?;
        let mut answer = Answer {
            verdict: Verdict::Inconclusive,
            rate: self.rate,
            bits,
            needed_bits: needed,
            hypotheses,
            best: None,
            payload: None,
            reason: None,
        };
        if self.targets.is_empty() {
            answer.verdict = Verdict::UnknownKey;
            answer.reason = Some("no word is registered for the key that was named".into());
            return Ok(Tested {
                answer,
                confidences: None,
            });
        }
        let Some(winner) = self.winner(&readings)? else {
            answer.reason = Some("no picture was read".into());
            return Ok(Tested {
                answer,
                confidences: None,
            });
        };
        answer.best = Some(Comparison {
            hypothesis: winner.read.name.clone(),
            views: winner.read.views,
            target: winner.target.id.clone(),
            matched_bits: winner.matched,
            undecided_bits: winner.reading.undecided_bits(),
            p_alone: chance::tail(bits, winner.matched)?,
            p_value: rule.p_value(bits, winner.matched)?,
        });
        let decided = readings.iter().map(Reading::decided_bits).max().unwrap_or(0);
        match needed {
            None => answer.reason = Some(too_short(bits, hypotheses, self.rate)?),
            Some(needed) if decided < needed => {
                answer.reason = Some(too_few_decided(decided, bits, needed));
            }
            Some(needed) if winner.matched >= needed => {
                answer.verdict = Verdict::Match;
                answer.payload = read::payload(self.scheme, winner.target, &winner.read.logits)?;
            }
            Some(_) => answer.verdict = Verdict::NoMatch,
        }
        let confidences = Some(Confidences::of(&winner.reading, &winner.read.logits));
        Ok(Tested { answer, confidences })
    }

    /// Readings times targets times other tries. None of a kind counts as one, so that limits are told for nothing too.
    fn hypotheses(&self) -> Result<u64> {
        let bad = |field, reason: String| Error::Hypotheses { field, reason };
        let given = self.targets.len() as u64;
        let targets = self.targets_tried.unwrap_or(given);
        if targets < given {
            let reason = format!("{targets} are fewer than the {given} targets given");
            return Err(bad("targets tried", reason));
        }
        if self.other_tries == 0 {
            return Err(bad("other tries", "0 is below 1: this claim counts".into()));
        }
        let readings = self.readings.len().max(1) as u64;
        let product = readings
            .checked_mul(targets.max(1))
            .and_then(|n| n.checked_mul(self.other_tries));
        product.ok_or_else(|| bad("hypotheses", "more than 2^64 - 1 were tried".into()))
    }

    fn decided(&self) -> Result<Vec<Reading>> {
        let read = |read: &HypothesisReading| {
            let reading = Reading::from_logits(&read.logits)?;
            reading.require(&format!("reading {:?}", read.name), self.scheme.length())?;
            Ok(reading)
        };
        self.readings.iter().map(read).collect()
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

    fn winner(&self, readings: &[Reading]) -> Result<Option<Winner<'_>>> {
        let mut best: Option<Winner<'_>> = None;
        for (read, reading) in self.readings.iter().zip(readings) {
            for target in self.targets {
                let matched = reading.matches(&target.word)?;
                if best.as_ref().is_none_or(|best| matched > best.matched) {
                    let reading = *reading;
                    best = Some(Winner {
                        read,
                        reading,
                        target,
                        matched,
                    });
                }
            }
        }
        Ok(best)
    }
}

fn too_short(bits: u32, hypotheses: u64, rate: f64) -> Result<String> {
    let reachable = chance::reachable_rate(bits, hypotheses)?;
    Ok(format!(
        "{bits} bits with {hypotheses} hypotheses can never reach a rate of {rate:e}: all of them match by chance at a rate \
         of up to {reachable:.1e}"
    ))
}
