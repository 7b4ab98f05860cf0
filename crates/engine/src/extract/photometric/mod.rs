//! Photometric corrections: what may have been done to the tones of a picture, each undone and read.
//!
//! A tower of sines reads exact colours: a picture that was brightened by a twentieth reads as another one. What was done
//! is not known. Either much is tried ([`corrections`]), and the message that is claimed tells what is right: **every
//! correction is another chance to match it, which a claim must count**. Or it is estimated without that message, from the
//! picture and the key (`super::blind`), as a [`ToneChange`]: then one reading is counted.
mod change;
mod contrast;
mod curve;
pub(super) mod ground;
mod tone;
mod undo;
pub(super) mod white_balance;

use guardsplat_codeword::{PhotometricCorrection, Tone};

pub(super) use change::{COORDINATES, ToneChange};

use super::{Engine, Extractor};
use crate::error::Result;
use crate::picture::Picture;

/// Corrected pictures that are read together.
const BATCH: usize = 8;

/// All corrections that this extractor needs, none first: what [`read_corrections`] reads.
pub fn corrections(extractor: &dyn Extractor) -> Vec<PhotometricCorrection> {
    let mut all = vec![PhotometricCorrection::None];
    if extractor.reads_exact_colours() {
        all.push(PhotometricCorrection::WhiteBackground);
        all.extend(white_balance::all().map(PhotometricCorrection::WhiteBalance));
        all.extend(tone::all().into_iter().map(PhotometricCorrection::Tone));
    }
    all
}

/// Logits of a picture after each correction, in the order of [`corrections`].
///
/// # Errors
/// A picture without pixels, a failing device, or [`Error::Stopped`](crate::Error::Stopped).
pub fn read_corrections(engine: &Engine, picture: &Picture) -> Result<Vec<Vec<f32>>> {
    let as_given = engine.read_logits(std::slice::from_ref(picture))?.swap_remove(0);
    let small = engine.resized(picture)?;
    let corrections = corrections(engine.extractor.as_ref());
    let undone: Vec<Undo> = corrections
        .iter()
        .map(|correction| Undo::of(*correction, &small))
        .collect();
    // Many a correction does the same to this picture as another one.
    let mut different: Vec<Undo> = Vec::new();
    for undo in &undone {
        if *undo != Undo::Nothing && !different.contains(undo) {
            different.push(*undo);
        }
    }
    let mut read = Vec::with_capacity(different.len());
    for chunk in different.chunks(BATCH) {
        let pictures: Vec<Picture> = chunk.iter().map(|undo| undo.applied(&small)).collect();
        read.extend(engine.read_logits(&pictures)?);
    }
    let logits = |undo: &Undo| match different.iter().position(|other| other == undo) {
        Some(place) => read[place].clone(),
        None => as_given.clone(),
    };
    Ok(undone.iter().map(logits).collect())
}

/// What a correction does to one picture.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Undo {
    Nothing,
    Ground,
    Gains([f32; 3]),
    Tone(Tone),
}

impl Undo {
    fn of(correction: PhotometricCorrection, picture: &Picture) -> Self {
        match correction {
            // What was estimated is undone where it was found.
            PhotometricCorrection::None | PhotometricCorrection::Estimated => Self::Nothing,
            PhotometricCorrection::WhiteBackground => Self::Ground,
            PhotometricCorrection::WhiteBalance(beyond) => {
                white_balance::gains(picture, beyond).map_or(Self::Nothing, Self::Gains)
            }
            PhotometricCorrection::Tone(tone) => Self::Tone(tone),
        }
    }

    /// The picture before that was done to it, over white where its ground is seen.
    fn applied(&self, picture: &Picture) -> Picture {
        let toned = match self {
            Self::Nothing => return picture.clone(),
            Self::Ground => None,
            Self::Gains(gains) => Some(white_balance::undone(*gains, picture)),
            Self::Tone(tone) => Some(tone::undone(*tone, picture)),
        };
        let toned = toned.as_ref().unwrap_or(picture);
        ground::whitened(toned).unwrap_or_else(|| toned.clone())
    }
}
