//! Photometric corrections: what may have been done to the tones of a picture, each undone and read.
//!
//! A tower of sines reads exact colours: a picture that was brightened by a twentieth reads as another one. What was done
//! is not known. Either much is tried ([`corrections`]), and the message that is claimed tells what is right: **every
//! correction is another chance to match it, which a claim must count**. Or it is estimated without that message, from the
//! picture and the key (`super::blind`), as a [`ToneChange`]: then one reading is counted.
mod change;
pub(super) mod ground;
mod tone;

use guardsplat_codeword::PhotometricCorrection;

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
        all.extend(tone::all().into_iter().map(PhotometricCorrection::Tone));
    }
    all
}

/// Logits of a picture after each correction, in the order of [`corrections`].
///
/// # Errors
/// A picture without pixels, a failing device, or [`Error::Stopped`](crate::Error::Stopped).
pub fn read_corrections(engine: &Engine, picture: &Picture) -> Result<Vec<Vec<f32>>> {
    let mut logits = engine.read_logits(std::slice::from_ref(picture))?;
    let small = engine.resized(picture)?;
    for chunk in corrections(engine.extractor.as_ref())[1..].chunks(BATCH) {
        let pictures: Vec<Picture> = chunk.iter().map(|correction| corrected(*correction, &small)).collect();
        logits.extend(engine.read_logits(&pictures)?);
    }
    Ok(logits)
}

/// The picture before that was done to it, over white where its background is seen.
fn corrected(correction: PhotometricCorrection, picture: &Picture) -> Picture {
    let toned = match correction {
        // What was estimated is undone where it was found.
        PhotometricCorrection::None | PhotometricCorrection::Estimated => return picture.clone(),
        PhotometricCorrection::WhiteBackground => None,
        PhotometricCorrection::Tone(tone) => Some(tone::undone(tone, picture)),
    };
    let toned = toned.as_ref().unwrap_or(picture);
    ground::whitened(toned).unwrap_or_else(|| toned.clone())
}
