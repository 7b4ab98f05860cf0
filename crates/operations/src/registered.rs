//! Pictures of a suspect compared with the unmarked original.
use std::path::Path;

use guardsplat_engine::Result;
use guardsplat_engine::extract::{Engine, Original, PooledLogits, RegisteredTones};

use crate::suspect::Suspect;
use crate::verification::{Views, loaded};

/// Longer side of the largest view that is drawn of an original, pixels.
const LARGEST: u32 = 800;

/// What was read of pictures that show the original's scene.
pub struct RegisteredReadings {
    /// A reading for each way to take tones; none if no picture shows the scene.
    pub readings: Vec<(RegisteredTones, PooledLogits)>,
    /// Of each picture how much of it the original explains; `None` where it explains nothing.
    pub explained: Vec<Option<f64>>,
}

/// Registers each picture of `suspect` with the original, and reads those that show it together with what was read
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
    let gaussians = loaded(engine, original, views, LARGEST)?.into_gaussians();
    let original = Original::new(engine, &gaussians, views.sampler(&gaussians)?);
    let mut logits = RegisteredTones::ALL.map(|_| of_scenes.to_vec());
    let mut explained = Vec::with_capacity(suspect.pictures.len());
    for (index, picture) in suspect.pictures.iter().enumerate() {
        let picture = picture.pixels(views.background)?;
        let registration = original.register(&picture)?;
        if let Some(registration) = &registration {
            for (logits, tones) in logits.iter_mut().zip(RegisteredTones::ALL) {
                logits.push(original.read(&picture, registration, tones)?);
            }
        }
        explained.push(registration.map(|found| found.explained));
        progress(index + 1, suspect.pictures.len());
    }
    let shown = explained.iter().any(Option::is_some);
    let readings = RegisteredTones::ALL.into_iter().zip(logits).filter(|_| shown);
    let readings = readings.map(|(tones, logits)| Ok((tones, PooledLogits::new(logits)?)));
    Ok(RegisteredReadings {
        readings: readings.collect::<Result<_>>()?,
        explained,
    })
}
