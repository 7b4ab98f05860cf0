//! A registered picture is read as it differs from the original.
use guardsplat_codeword::RegisteredTones;

use super::drawn::Drawn;
use super::tone::{Tone, quadratic};
use super::{Original, Registration};
use crate::error::Result;
use crate::extract::restore::read_rendered;
use crate::picture::Picture;
use crate::resize::resized;

/// Coverage from which on a pixel is compared, and up to which one shows what is behind the scene. Surfaces are often not
/// quite solid: of the sample of a stage a quarter lies between 0.9 and 0.95.
const COVERED: f32 = 0.85;
const BEHIND: f32 = 0.05;
/// Differences beyond this are no mark: something was drawn over the scene.
const LARGEST: f32 = 0.15;
/// Weight of no filter at all, for each pixel.
const NO_FILTER: f64 = 1e-4;

impl Original<'_> {
    /// Logits of a registered picture, its tones taken so: of the original on white, and what the picture shows otherwise
    /// where the original covers it.
    ///
    /// # Errors
    /// Those of [`Original::register`].
    pub fn read(&self, picture: &Picture, registration: &Registration, tones: RegisteredTones) -> Result<Vec<f32>> {
        let camera = &registration.camera;
        let drawn = Drawn::of(self.engine, &self.geometry, camera, 1.0)?;
        let seen = resized(picture, camera.height as usize, camera.width as usize)?;
        let seen = without_behind(seen.pixels.as_chunks::<3>().0, &drawn.coverage);
        let shown = |i: usize| drawn.coverage[i] >= COVERED;
        let colour = |i: usize| drawn.colours[i].map(|v| v / drawn.coverage[i]);
        let difference = |i: usize| {
            let colour = colour(i);
            std::array::from_fn(|k| f64::from(seen[i][k] - colour[k]))
        };
        let terms = |i: usize| quadratic(colour(i).map(f64::from));
        let filter = (tones == RegisteredTones::Fitted).then(|| {
            let pixels = (0..seen.len()).filter(|i| shown(*i));
            Tone::fitted(pixels.map(|i| (1.0, terms(i), difference(i))), NO_FILTER)
        });
        let pixel = |i: usize| -> [f32; 3] {
            let coverage = drawn.coverage[i];
            let on_white = drawn.colours[i].map(|v| v + 1.0 - coverage);
            if !shown(i) {
                return on_white;
            }
            let mut difference: [f64; 3] = difference(i);
            if let Some(filter) = &filter {
                let change = filter.change(&terms(i));
                let left = std::array::from_fn(|k| difference[k] - change[k]);
                difference = filter.undone(colour(i).map(f64::from), left);
            }
            std::array::from_fn(|k| {
                let difference = (difference[k] as f32).clamp(-LARGEST, LARGEST);
                (on_white[k] + coverage * difference).clamp(0.0, 1.0)
            })
        };
        let compared = Picture {
            width: camera.width,
            height: camera.height,
            pixels: (0..seen.len()).flat_map(pixel).collect(),
        };
        Ok(read_rendered(self.engine, &[compared])?.swap_remove(0))
    }
}

/// Colours of the scene alone, as far as the mean colour of what is seen beside it says what shines through.
pub(super) fn without_behind(seen: &[[f32; 3]], coverage: &[f32]) -> Vec<[f32; 3]> {
    let (mut count, mut sum) = (0.0, [0.0_f64; 3]);
    for (colour, _) in seen.iter().zip(coverage).filter(|(_, coverage)| **coverage <= BEHIND) {
        count += 1.0;
        (0..3).for_each(|k| sum[k] += f64::from(colour[k]));
    }
    if count == 0.0 {
        return seen.to_vec();
    }
    let behind = sum.map(|sum| (sum / count) as f32);
    let alone = |(colour, coverage): (&[f32; 3], &f32)| {
        let coverage = coverage.max(COVERED);
        std::array::from_fn(|k| (colour[k] - (1.0 - coverage) * behind[k]) / coverage)
    };
    seen.iter().zip(coverage).map(alone).collect()
}
