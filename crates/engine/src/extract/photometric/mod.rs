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
mod histogram;
mod tone;
mod undo;
pub(super) mod white_balance;

use guardsplat_codeword::PhotometricCorrection;

pub(super) use change::{COORDINATES, ToneChange};
pub(super) use histogram::{ColourHistogram, Fineness};

use super::{Engine, Extractor};
use crate::error::Result;
use crate::picture::Picture;

/// Corrected pictures that are in memory together.
const BATCH: usize = 64;

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
    let changes: Vec<Option<ToneChange>> = corrections
        .iter()
        .map(|correction| change(*correction, &small))
        .collect();
    // Many a correction does the same to this picture as another one.
    let mut different: Vec<ToneChange> = Vec::new();
    for change in changes.iter().flatten() {
        if !different.contains(change) {
            different.push(*change);
        }
    }
    let sides = engine.extractor.colour_scales();
    let histogram = (!sides.is_empty()).then(|| ColourHistogram::of(&small, sides, Fineness::FINE));
    let mut read = Vec::with_capacity(different.len());
    for chunk in different.chunks(BATCH) {
        read.extend(match &histogram {
            Some(histogram) => {
                engine.read_colours(&engine.each(chunk, |change| Ok(histogram.undone_at_any_rate(change, &small)))?)?
            }
            None => engine
                .read_logits(&engine.each(chunk, |change| Ok(ground::on_white(change.undone_at_any_rate(&small))))?)?,
        });
    }
    let logits = |change: &Option<ToneChange>| {
        let place = different.iter().position(|other| Some(*other) == *change);
        place.map_or_else(|| as_given.clone(), |place| read[place].clone())
    };
    Ok(changes.iter().map(logits).collect())
}

/// What a correction takes to have been done to a picture, whose ground is made white besides where it is seen; `None`
/// where it does nothing at all.
fn change(correction: PhotometricCorrection, picture: &Picture) -> Option<ToneChange> {
    match correction {
        // What was estimated is undone where it was found, and what is compared with an original is read elsewhere.
        PhotometricCorrection::None
        | PhotometricCorrection::Estimated
        | PhotometricCorrection::NextEstimate(_)
        | PhotometricCorrection::Registered(_)
        | PhotometricCorrection::MatchedFilter => None,
        PhotometricCorrection::WhiteBackground => Some(ToneChange::default()),
        PhotometricCorrection::WhiteBalance(beyond) => {
            white_balance::gains(picture, beyond).map(|gains| ToneChange::of_gains(gains.map(f32::ln)))
        }
        PhotometricCorrection::Tone(tone) => Some(ToneChange::of_tone(tone)),
    }
}
