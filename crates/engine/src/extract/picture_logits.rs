//! One picture read under every hypothesis, and pictures of one suspect taken together.
use guardsplat_codeword::Hypothesis;

use super::hypothesis::{part_hypotheses, read_whole, whole_hypotheses};
use super::window::read_windows;
use super::{Engine, PooledLogits, without_borders};
use crate::error::Result;
use crate::picture::Picture;

/// What was read of one picture under each hypothesis.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureLogits {
    whole: Vec<Vec<f32>>,
    /// Without its borders, if it has any.
    trimmed: Option<Vec<Vec<f32>>>,
    /// Its parts, if it is large enough and the engine reads parts.
    parts: Option<Vec<Vec<f32>>>,
}

impl PictureLogits {
    /// Reads a picture under every hypothesis that the engine searches.
    ///
    /// # Errors
    /// A picture without pixels, a failing device, or [`Error::Stopped`](crate::Error::Stopped).
    pub fn read(engine: &Engine, picture: &Picture) -> Result<Self> {
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

    /// Logits of the picture as it was given.
    pub fn as_given(&self) -> &[f32] {
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
    let extractor = engine.extractor.as_ref();
    let borders = pictures.iter().any(|picture| picture.trimmed.is_some());
    let mut readings = Vec::new();
    for trimmed in [false, true].into_iter().filter(|trimmed| borders || !trimmed) {
        for (place, hypothesis) in whole_hypotheses(extractor, trimmed).into_iter().enumerate() {
            let of_picture = |picture: &PictureLogits| match (&picture.trimmed, trimmed) {
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
            let of_picture = |picture: &PictureLogits| match &picture.parts {
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
