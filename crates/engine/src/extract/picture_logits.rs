//! One picture read under every hypothesis, and pictures of one suspect taken together.
use guardsplat_codeword::Hypothesis;

use super::blind::{BlindReading, Candidate, chosen};
use super::hypothesis::{part_hypotheses, read_whole, searched_hypotheses, whole_hypotheses};
use super::window::read_windows;
use super::{Engine, PooledLogits, without_borders};
use crate::clip::config::Tones;
use crate::error::Result;
use crate::picture::Picture;

/// What was read of one picture under each hypothesis.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureLogits(Read);

#[derive(Clone, Debug, PartialEq)]
enum Read {
    Searched(Searched),
    Estimated(BlindReading),
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
    /// `others` of the same suspect is tried, too.
    ///
    /// # Errors
    /// A picture without pixels, a failing device, or [`Error::Stopped`](crate::Error::Stopped).
    pub fn read(engine: &Engine, picture: &Picture, others: &[Self]) -> Result<Self> {
        let others: Vec<_> = others.iter().filter_map(Self::estimated).collect();
        Ok(Self(match engine.extractor.tones() {
            Tones::Searched => Read::Searched(Searched::read(engine, picture)?),
            Tones::Estimated => Read::Estimated(BlindReading::read(engine, picture, &others)?),
        }))
    }

    /// Logits of the picture as it was given.
    pub fn as_given(&self) -> &[f32] {
        match &self.0 {
            Read::Searched(read) => read.as_given(),
            Read::Estimated(read) => &read.as_given,
        }
    }
}

impl Searched {
    fn read(engine: &Engine, picture: &Picture) -> Result<Self> {
        let whole = read_whole(engine, picture)?;
        let trimmed = without_borders(picture)
            .map(|trimmed| read_whole(engine, &trimmed))
            .transpose()?;
        let parts = match engine.extractor.reads_exact_colours() {
            true => read_windows(engine, picture)?,
            false => None,
        };
        Ok(Self { whole, trimmed, parts })
    }

    fn as_given(&self) -> &[f32] {
        self.whole.first().map_or(&[], Vec::as_slice)
    }
}

/// Logits of pictures of one suspect, pooled under each hypothesis, nothing done first. Those without borders are there
/// only if some picture has any, and parts if some picture is large enough: others would be the same once more. All of
/// them together are [`searched_hypotheses`](super::searched_hypotheses).
///
/// # Errors
/// No pictures, or logits that are not finite.
pub fn hypotheses(engine: &Engine, pictures: &[PictureLogits]) -> Result<Vec<(Hypothesis, PooledLogits)>> {
    if engine.extractor.tones() == Tones::Estimated {
        return estimated_hypotheses(engine, pictures);
    }
    let extractor = engine.extractor.as_ref();
    let pictures: Vec<&Searched> = pictures.iter().filter_map(PictureLogits::searched).collect();
    let borders = pictures.iter().any(|picture| picture.trimmed.is_some());
    let mut readings = Vec::new();
    for trimmed in [false, true].into_iter().filter(|trimmed| borders || !trimmed) {
        for (place, hypothesis) in whole_hypotheses(extractor, trimmed).into_iter().enumerate() {
            let of_picture = |picture: &&Searched| match (&picture.trimmed, trimmed) {
                (Some(logits), true) => logits[place].clone(),
                _ => picture.whole[place].clone(),
            };
            readings.push((
                hypothesis,
                PooledLogits::new(pictures.iter().map(of_picture).collect())?,
            ));
        }
    }
    if pictures.iter().any(|picture| picture.parts.is_some()) {
        for (place, hypothesis) in part_hypotheses(extractor).enumerate() {
            let of_picture = |picture: &&Searched| match &picture.parts {
                Some(logits) => logits[place].clone(),
                None => picture.as_given().to_vec(),
            };
            readings.push((
                hypothesis,
                PooledLogits::new(pictures.iter().map(of_picture).collect())?,
            ));
        }
    }
    Ok(readings)
}

/// As given, and with each picture's own estimate undone.
fn estimated_hypotheses(engine: &Engine, pictures: &[PictureLogits]) -> Result<Vec<(Hypothesis, PooledLogits)>> {
    let given = pictures.iter().map(|picture| picture.as_given().to_vec());
    let estimated = estimates(pictures)
        .into_iter()
        .zip(pictures)
        .map(|(estimate, picture)| {
            estimate
                .map_or(picture.as_given(), |estimate| estimate.logits())
                .to_vec()
        });
    let readings = [given.collect(), estimated.collect()].map(PooledLogits::new);
    searched_hypotheses(engine.extractor.as_ref())
        .into_iter()
        .zip(readings)
        .map(|(hypothesis, logits)| Ok((hypothesis, logits?)))
        .collect()
}

/// What is estimated to have been done to each of the pictures of one suspect, chosen so that they agree; `None` where
/// nothing could be estimated, or every guess is read.
pub fn estimates(pictures: &[PictureLogits]) -> Vec<Option<&Candidate>> {
    let blind: Option<Vec<&BlindReading>> = pictures.iter().map(PictureLogits::estimated).collect();
    blind.map_or_else(|| vec![None; pictures.len()], |blind| chosen(&blind))
}

impl PictureLogits {
    fn searched(&self) -> Option<&Searched> {
        match &self.0 {
            Read::Searched(read) => Some(read),
            Read::Estimated(_) => None,
        }
    }

    fn estimated(&self) -> Option<&BlindReading> {
        match &self.0 {
            Read::Searched(_) => None,
            Read::Estimated(read) => Some(read),
        }
    }
}
