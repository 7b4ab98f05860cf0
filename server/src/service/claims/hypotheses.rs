//! What workers read under each hypothesis: checked, and named for people.
use std::collections::HashSet;

use guardsplat_codeword::{
    Hypothesis, HypothesisReading, PhotometricCorrection, RegisteredTones, Tone, WINDOW_STEPS as TWELFTHS, Window,
};
use guardsplat_evidence as evidence;
use guardsplat_proto::v1::undone::Kind;
use guardsplat_proto::v1::{FramedReading, Undone};

use crate::error::Result;
use crate::service::violations::Violations;

/// Most readings. Workers try some hundred and thirty tones, with borders and without, some thirty parts, and up to 512
/// in which one picture leads.
const MOST: usize = 1024;

/// What was read under each hypothesis, checked against the bits of the key.
pub fn checked(readings: &[FramedReading], bits: u32) -> Result<Vec<HypothesisReading>> {
    let mut problems = Violations::default();
    if readings.len() > MOST {
        let reason = format!("has {} entries, at most {MOST} are taken", readings.len());
        problems.add("readings", reason);
    }
    let mut seen = HashSet::new();
    for (i, reading) in readings.iter().take(MOST).enumerate() {
        let field = |name: &str| format!("readings[{i}].{name}");
        let turns = reading.quarter_turns;
        problems.check(turns < 4, &field("quarter_turns"), "must be 0 to 3");
        problems.check(reading.views > 0, &field("views"), "must be at least 1");
        if reading.logits.len() != bits as usize {
            let reason = format!("has {} values, the key has {bits} bits", reading.logits.len());
            problems.add(field("logits"), reason);
        }
        if let Some(undone) = &reading.undone {
            let known = undone.kind() != Kind::Unspecified;
            problems.check(known, &field("undone.kind"), "must be given");
            let positive = undone.factor.is_finite() && undone.factor > 0.0;
            problems.check(positive, &field("undone.factor"), "must be above 0");
            for (name, factor) in ["red", "green", "blue"].into_iter().zip(channels(undone)) {
                let fits = match undone.kind() {
                    Kind::WhiteBalance => factor.is_finite() && factor > 0.0,
                    _ => factor == 0.0,
                };
                let reason = "must be above 0 of a white balance, and 0 of all others";
                problems.check(fits, &field(&format!("undone.{name}")), reason);
            }
        }
        if let Some(part) = &reading.part {
            let inside = |from: u32| from <= TWELFTHS && part.side_twelfths <= TWELFTHS - from;
            let inside = part.side_twelfths > 0 && inside(part.left_twelfths) && inside(part.top_twelfths);
            problems.check(inside, &field("part"), "must lie within the picture's twelve twelfths");
        }
        let part = reading
            .part
            .map(|part| (part.left_twelfths, part.top_twelfths, part.side_twelfths));
        let undone = reading.undone.map(|undone| {
            (
                undone.kind,
                undone.factor.to_bits(),
                channels(&undone).map(f32::to_bits),
            )
        });
        let leader = reading.leading_picture;
        let is_read = leader <= reading.views;
        problems.check(
            is_read,
            &field("leading_picture"),
            "must be one of the pictures that were read",
        );
        if !seen.insert((turns, reading.mirrored, reading.trimmed, undone, part, leader)) {
            problems.add(format!("readings[{i}]"), "is in the same framing as another one");
        }
    }
    problems.finish()?;
    let read: Vec<Hypothesis> = readings.iter().map(hypothesis).collect();
    let shares = guardsplat_codeword::shares(&read);
    let pairs = readings.iter().zip(&read).zip(shares);
    let read = pairs.map(|((reading, hypothesis), tries)| HypothesisReading {
        name: hypothesis.to_string(),
        views: reading.views,
        logits: reading.logits.clone(),
        tries,
    });
    Ok(read.collect())
}

/// What is undone, as a worker tells it.
fn hypothesis(reading: &FramedReading) -> Hypothesis {
    let correction = reading.undone.map(|undone| (undone.kind(), undone.factor));
    let channels = reading.undone.as_ref().map_or([1.0; 3], channels);
    Hypothesis {
        quarter_turns: reading.quarter_turns as u8, // below 4, or refused
        mirrored: reading.mirrored,
        trimmed: reading.trimmed,
        correction: match correction {
            None | Some((Kind::Unspecified, _)) => PhotometricCorrection::None, // refused
            Some((Kind::Ground, _)) => PhotometricCorrection::WhiteBackground,
            Some((Kind::WhiteBalance, _)) => PhotometricCorrection::WhiteBalance(channels),
            Some((Kind::Estimated, place)) => match place as u32 {
                ..=1 => PhotometricCorrection::Estimated,
                place => PhotometricCorrection::NextEstimate(place),
            },
            Some((Kind::Original, _)) => PhotometricCorrection::Registered(RegisteredTones::AsGiven),
            Some((Kind::OriginalFitted, _)) => PhotometricCorrection::Registered(RegisteredTones::Fitted),
            Some((Kind::OriginalMatched, _)) => PhotometricCorrection::MatchedFilter,
            Some((Kind::Brightness, factor)) => PhotometricCorrection::Tone(Tone::Brightness(factor)),
            Some((Kind::Gamma, exponent)) => PhotometricCorrection::Tone(Tone::Gamma(exponent)),
            Some((Kind::Contrast, factor)) => PhotometricCorrection::Tone(Tone::Contrast(factor)),
            Some((Kind::Saturation, factor)) => PhotometricCorrection::Tone(Tone::Saturation(factor)),
        },
        window: reading.part.map(|part| Window {
            left: part.left_twelfths,
            top: part.top_twelfths,
            side: part.side_twelfths,
        }),
        leader: (reading.leading_picture > 0).then_some(reading.leading_picture),
    }
}

/// What red, green and blue were multiplied by, of a white balance.
fn channels(undone: &Undone) -> [f32; 3] {
    [undone.red, undone.green, undone.blue]
}

/// Hypotheses by kinds, for the report, with what each pays: as much as was done counts under what changes most.
pub fn kinds(told: &[FramedReading], readings: &[HypothesisReading]) -> Vec<evidence::HypothesisGroup> {
    use evidence::HypothesisKind::{AsGiven, Crop, Estimated, Led, Mirrored, QuarterTurn, Registered, Tone};
    let kind = |reading: &FramedReading| match (reading.trimmed, reading.mirrored, reading.quarter_turns) {
        _ if reading.leading_picture > 0 => Led,
        _ if let Some(undone) = &reading.undone => match undone.kind() {
            Kind::Estimated => Estimated,
            Kind::Original | Kind::OriginalFitted | Kind::OriginalMatched => Registered,
            _ => Tone,
        },
        _ if reading.part.is_some() => Crop,
        (true, ..) => Crop,
        (_, true, _) => Mirrored,
        (_, _, 0) => AsGiven,
        _ => QuarterTurn,
    };
    let mut groups: Vec<evidence::HypothesisGroup> = Vec::new();
    for wanted in [AsGiven, Registered, Estimated, Led, Tone, QuarterTurn, Mirrored, Crop] {
        for (_, read) in told.iter().zip(readings).filter(|(told, _)| kind(told) == wanted) {
            let tries = Some(read.tries);
            match groups
                .iter_mut()
                .find(|group| group.kind == wanted && group.tries == tries)
            {
                Some(group) => group.variants += 1,
                None => groups.push(evidence::HypothesisGroup {
                    kind: wanted,
                    variants: 1,
                    pooled: false,
                    tries,
                }),
            }
        }
    }
    groups
}

#[cfg(test)]
mod tests;
