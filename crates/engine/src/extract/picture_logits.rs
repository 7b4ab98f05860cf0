//! One picture read under every hypothesis, and pictures of one suspect taken together.
use guardsplat_codeword::{Hypothesis, NEXT_ESTIMATES};

use super::blind::{BlindReading, Candidate, chosen};
use super::hypothesis::{part_hypotheses, read_whole, whole_hypotheses};
use super::led::{self, Ways};
use super::restore::{Restored, read_restored};
use super::window::read_windows;
use super::{Engine, Extractor, PooledLogits, without_borders};
use crate::clip::config::Tones;
use crate::error::Result;
use crate::picture::Picture;

/// What was read of one picture under each hypothesis.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureLogits {
    as_given: Vec<f32>,
    /// With what was done undone as it is estimated, where it is.
    blind: Option<BlindReading>,
    /// Under every guess, unless the estimate is clear.
    searched: Option<Searched>,
}

/// Under every guess.
#[derive(Clone, Debug, PartialEq)]
struct Searched {
    whole: Vec<Vec<f32>>,
    /// Without its borders, if it has any.
    trimmed: Option<Vec<Vec<f32>>>,
    /// Its parts, if it is large enough and the engine reads parts.
    parts: Option<Vec<Vec<f32>>>,
}

impl PictureLogits {
    /// Reads a picture under every hypothesis that the engine searches. Where what was done is estimated, what was done to
    /// `others` of the same suspect is tried, too, and guesses are read only if the estimate is not clear. `moving` is the
    /// picture without what [other pictures show, too](super::StaticBackground): as it was given it is read with that, else
    /// without.
    ///
    /// # Errors
    /// A picture without pixels, a failing device, or [`Error::Stopped`](crate::Error::Stopped).
    pub fn read(engine: &Engine, picture: &Picture, moving: Option<&Picture>, others: &[Self]) -> Result<Self> {
        let given = Restored::of(engine, picture);
        let as_given = read_restored(engine, &given.picture)?;
        let restored = moving.map_or(given, |moving| Restored::of(engine, moving));
        let picture = restored.picture.as_ref();
        let blind = match engine.extractor.tones() {
            Tones::Searched => None,
            Tones::Estimated => {
                let others: Vec<_> = others.iter().filter_map(|other| other.blind.as_ref()).collect();
                Some(BlindReading::read(engine, &restored, &others)?)
            }
        };
        let searched = match &blind {
            Some(blind) if blind.is_clear() => None,
            _ => Some(Searched::read(engine, picture, blind.as_ref())?),
        };
        Ok(Self {
            as_given,
            blind,
            searched,
        })
    }

    /// Logits of the picture as it was given.
    pub fn as_given(&self) -> &[f32] {
        &self.as_given
    }

    /// What was estimated to have been done to it.
    #[cfg(test)]
    pub(super) fn blind(&self) -> &BlindReading {
        self.blind.as_ref().unwrap()
    }
}

impl Searched {
    /// Windows are those of the `blind` reading, where there is one.
    fn read(engine: &Engine, picture: &Picture, blind: Option<&BlindReading>) -> Result<Self> {
        let whole = read_whole(engine, picture)?;
        let trimmed = without_borders(picture)
            .map(|trimmed| read_whole(engine, &trimmed))
            .transpose()?;
        let parts = match blind {
            Some(blind) => Some(blind.windows().to_vec()).filter(|windows| !windows.is_empty()),
            None if engine.extractor.reads_exact_colours() => read_windows(engine, picture)?,
            None => None,
        };
        Ok(Self { whole, trimmed, parts })
    }
}

/// Logits of pictures of one suspect, pooled under each hypothesis, nothing done first. Those without borders are there
/// only if some picture has any, and parts if some picture is large enough: others would be the same once more. All of
/// them together are [`searched_hypotheses`](super::searched_hypotheses).
///
/// Of several pictures each in turn leads, too: what was done to it is guessed, and the others follow ([`led`]).
///
/// Where what was done is estimated that is the second hypothesis, and the only other one if all estimates are clear. The
/// message has no part in that, so that only what is here has to be paid for. A picture whose estimate is clear is read so
/// under all guesses. The next best estimates follow for a picture that is alone: of several, what agrees is right.
///
/// # Errors
/// No pictures, or logits that are not finite.
pub fn hypotheses(engine: &Engine, pictures: &[PictureLogits]) -> Result<Vec<(Hypothesis, PooledLogits)>> {
    let pooled = |hypothesis, logits: Vec<&[f32]>| -> Result<_> {
        let logits = logits.into_iter().map(<[f32]>::to_vec).collect();
        Ok((hypothesis, PooledLogits::new(logits)?))
    };
    let given = pictures.iter().map(PictureLogits::as_given).collect();
    let mut readings = vec![pooled(Hypothesis::default(), given)?];
    let estimated: Vec<&[f32]> = estimates(pictures)
        .into_iter()
        .zip(pictures)
        .map(|(estimate, picture)| estimate.map_or(picture.as_given(), |estimate| estimate.logits()))
        .collect();
    if engine.extractor.tones() == Tones::Estimated {
        readings.push(pooled(Hypothesis::estimated(), estimated.clone())?);
        if let [picture] = pictures {
            for (hypothesis, logits) in picture.next_estimates() {
                readings.push(pooled(hypothesis, vec![logits])?);
            }
        }
    }
    let extractor = engine.extractor.as_ref();
    let under = |read: fn(&Searched, usize) -> &[f32], place: usize| {
        let pictures = pictures.iter().zip(&estimated);
        pictures
            .map(|(picture, estimated)| {
                picture
                    .searched
                    .as_ref()
                    .map_or(*estimated, |searched| read(searched, place))
            })
            .collect()
    };
    let searched = || pictures.iter().filter_map(|picture| picture.searched.as_ref());
    if searched().next().is_some() {
        let ways: Vec<Ways<'_>> = pictures
            .iter()
            .zip(&estimated)
            .map(|(picture, estimated)| picture.ways(extractor, estimated))
            .collect();
        for led in led::readings(&ways) {
            readings.push(pooled(led.hypothesis, led.logits)?);
        }
        let whole = whole_hypotheses(extractor, false).into_iter().enumerate().skip(1);
        for (place, hypothesis) in whole {
            readings.push(pooled(hypothesis, under(Searched::whole, place))?);
        }
    }
    if searched().any(|picture| picture.trimmed.is_some()) {
        for (place, hypothesis) in whole_hypotheses(extractor, true).into_iter().enumerate() {
            readings.push(pooled(hypothesis, under(Searched::trimmed, place))?);
        }
    }
    if searched().any(|picture| picture.parts.is_some()) {
        for (place, hypothesis) in part_hypotheses(extractor).enumerate() {
            readings.push(pooled(hypothesis, under(Searched::part, place))?);
        }
    }
    Ok(readings)
}

/// Hypotheses with what was read under each.
fn read_under(hypotheses: Vec<Hypothesis>, logits: &[Vec<f32>]) -> impl Iterator<Item = (Hypothesis, &[f32])> {
    hypotheses.into_iter().zip(logits.iter().map(Vec::as_slice))
}

impl PictureLogits {
    /// What is read of it by the next best estimates, unless the best is clear.
    fn next_estimates(&self) -> impl Iterator<Item = (Hypothesis, &[f32])> {
        let unclear = self.blind.iter().filter(|_| self.searched.is_some());
        let next = unclear.flat_map(|blind| blind.candidates().map(Candidate::logits).skip(1));
        NEXT_ESTIMATES.map(Hypothesis::estimated_next).zip(next)
    }

    /// All ways in which it was read: as it is `estimated` only, where that is clear.
    fn ways<'a>(&'a self, extractor: &dyn Extractor, estimated: &'a [f32]) -> Ways<'a> {
        let estimate = (Hypothesis::estimated(), estimated);
        let Some(searched) = &self.searched else {
            return Ways {
                leading: vec![estimate],
                following: Vec::new(),
            };
        };
        let mut leading: Vec<_> = read_under(whole_hypotheses(extractor, false), &searched.whole).collect();
        leading.extend(self.blind.as_ref().map(|_| estimate));
        let trimmed = searched.trimmed.iter();
        leading.extend(trimmed.flat_map(|trimmed| read_under(whole_hypotheses(extractor, true), trimmed)));
        let candidates = self.blind.iter().flat_map(BlindReading::candidates);
        let parts = searched.parts.iter().flatten().map(Vec::as_slice);
        Ways {
            leading,
            following: candidates.map(Candidate::logits).chain(parts).collect(),
        }
    }
}

impl Searched {
    fn whole(&self, place: usize) -> &[f32] {
        &self.whole[place]
    }

    fn trimmed(&self, place: usize) -> &[f32] {
        self.trimmed
            .as_ref()
            .map_or(&self.whole[place], |logits| &logits[place])
    }

    fn part(&self, place: usize) -> &[f32] {
        self.parts.as_ref().map_or(&self.whole[0], |logits| &logits[place])
    }
}

/// What is estimated to have been done to each of the pictures of one suspect, chosen so that they agree; `None` where
/// nothing could be estimated, or nothing is.
pub fn estimates(pictures: &[PictureLogits]) -> Vec<Option<&Candidate>> {
    let blind: Option<Vec<&BlindReading>> = pictures.iter().map(|picture| picture.blind.as_ref()).collect();
    blind.map_or_else(|| vec![None; pictures.len()], |blind| chosen(&blind))
}
