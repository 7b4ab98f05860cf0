//! Pictures of a suspect compared with the unmarked original.
use std::path::Path;

use guardsplat_codeword::{Hypothesis, RegisteredTones};
use guardsplat_engine::Result;
use guardsplat_engine::extract::{Engine, MATCHED_FILTER_BYTES, Original, PooledLogits, RegisteredPicture};
use guardsplat_engine::memory::picture_bytes;

use crate::suspect::Suspect;
use crate::thumbnails::Thumbnails;
use crate::verification::{HypothesisReadings, Views, loaded, read_hypotheses};

/// Longer side of the largest view that is drawn of an original, pixels.
const LARGEST: u32 = 800;

/// Most pictures that are compared with an original, spread evenly over all: each takes many seconds, and so many say enough.
const MOST: usize = 16;

/// What was read of pictures that show the original's scene.
pub struct RegisteredReadings {
    /// A reading for each way to take tones, and one of the pictures alone by the matched filter; none if no picture shows the
    /// scene.
    pub readings: Vec<(Hypothesis, PooledLogits)>,
    /// Of each picture how much of it the original explains; `None` where it explains nothing, or was not compared.
    pub explained: Vec<Option<f64>>,
}

/// Registers pictures of `suspect` with the original, and reads those that show it together with what was read
/// `of_scenes`. `progress` hears how many pictures are done, and of how many.
///
/// # Errors
/// Those of reading a scene and pictures, and of [`Original::register`].
pub(crate) fn read_registered(
    engine: &Engine,
    suspect: &Suspect,
    views: &Views,
    original: &Path,
    of_scenes: &[Vec<f32>],
    mut progress: impl FnMut(usize, usize),
) -> Result<RegisteredReadings> {
    let gaussians = loaded(
        engine,
        original,
        views,
        picture_bytes(LARGEST, LARGEST) + MATCHED_FILTER_BYTES,
    )?
    .into_gaussians();
    let original = Original::new(engine, &gaussians, views.sampler(&gaussians)?);
    let mut logits = RegisteredTones::ALL.map(|_| of_scenes.to_vec());
    let mut explained = vec![None; suspect.pictures.len()];
    let compared = spread(suspect.pictures.len());
    let count = compared.len();
    let mut kept = Vec::new();
    for (done, index) in compared.into_iter().enumerate() {
        let picture = suspect.pictures[index].pixels(views.background)?;
        if let Some(registration) = original.register(&picture)? {
            for (logits, tones) in logits.iter_mut().zip(RegisteredTones::ALL) {
                logits.push(original.read(&picture, &registration, tones)?);
            }
            kept.push(RegisteredPicture::of(&picture, &registration)?);
            explained[index] = Some(registration.explained);
        }
        progress(done + 1, count);
    }
    let shown = explained.iter().any(Option::is_some);
    let readings = RegisteredTones::ALL.into_iter().zip(logits).filter(|_| shown);
    let readings = readings.map(|(tones, logits)| (Hypothesis::registered(tones), logits));
    let matched = original
        .read_matched(&kept)?
        .map(|logits| (Hypothesis::matched_filter(), logits));
    let readings = readings.chain(matched);
    let readings = readings.map(|(way, logits)| Ok((way, PooledLogits::new(logits)?)));
    Ok(RegisteredReadings {
        readings: readings.collect::<Result<_>>()?,
        explained,
    })
}

/// Which of so many pictures are compared.
fn spread(count: usize) -> Vec<usize> {
    let compared = count.min(MOST);
    (0..compared).map(|i| i * count / compared).collect()
}

/// What was read in every way that there is.
pub struct AllReadings {
    /// Under every hypothesis.
    pub of_hypotheses: HypothesisReadings,
    /// Of each picture how much of it the original explains, as in [`RegisteredReadings`]; empty without an original.
    pub explained: Vec<Option<f64>>,
}

/// As [`read_hypotheses`], and where the unmarked `original` is at hand as the pictures differ from it, too.
///
/// # Errors
/// Those of reading scenes and pictures.
pub fn read_all(
    engine: &Engine,
    suspect: &Suspect,
    views: &Views,
    original: Option<&Path>,
    shown: &mut Thumbnails,
    mut progress: impl FnMut(usize, usize),
) -> Result<AllReadings> {
    let mut of_hypotheses = read_hypotheses(engine, suspect, views, shown, &mut progress)?;
    let mut explained = Vec::new();
    let given = of_hypotheses.readings.first().map(|(_, reading)| &reading.views);
    if let (Some(original), Some(given), false) = (original, given, suspect.pictures.is_empty()) {
        let of_scenes = given[..given.len() - suspect.pictures.len()].to_vec();
        let registered = read_registered(engine, suspect, views, original, &of_scenes, progress)?;
        of_hypotheses.readings.splice(1..1, registered.readings);
        explained = registered.explained;
    }
    Ok(AllReadings {
        of_hypotheses,
        explained,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_pictures_are_all_compared_and_many_evenly() {
        assert_eq!((spread(0), spread(3)), (vec![], vec![0, 1, 2]));
        let of_many = spread(1000);
        assert_eq!((of_many.len(), of_many[0], of_many[1], of_many[15]), (16, 0, 62, 937));
    }
}
