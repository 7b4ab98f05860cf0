//! What people do to pictures of a scene, as the head is to stand it: at the size that pictures have, not the tower's.
//!
//! Strong changes of tones are not among them: whoever reads a picture estimates and undoes these
//! ([`crate::extract`]), and leaves an error of about a hundredth.
use burn::tensor::{Tensor, TensorData};
use guardsplat_distortion::{Crop, Draw, Jpeg, Layer, Noise, Rectangle};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::error::{Error, Result};
use crate::ground::with_ground;

/// Side of the pictures, pixels.
pub(super) const SIDE: u32 = 640;

/// What rotated pictures show in their corners.
const CORNERS: [f32; 3] = [1.0; 3];
/// Largest error of an estimated brightness, and of the tint of a channel.
const TONE: f32 = 0.012;
const TINT: f32 = 0.006;

/// One thing that is done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Everyday {
    /// Nothing.
    Clean,
    /// JPEG of these qualities.
    Jpeg([u8; 2]),
    /// Normal noise of this deviation.
    Noise(f32),
    /// Tones that were estimated and undone, nearly.
    Tone,
    /// Parts of these sides, enlarged.
    Crop([f32; 2]),
    /// A part as [`Everyday::Tone`] leaves it, compressed.
    Screenshot,
    /// Turned by up to so many degrees.
    Rotation(f32),
    /// A rectangle of this share is covered.
    Cover(f32),
}

/// All of it, with its weights; `compression` is that of JPEG 10. Clean pictures come first.
pub(super) fn all(compression: f64) -> [(Everyday, f64); 10] {
    [
        (Everyday::Clean, 3.0),
        (Everyday::Jpeg([10, 10]), compression),
        (Everyday::Jpeg([20, 60]), 1.0),
        (Everyday::Noise(0.1), 0.7),
        (Everyday::Noise(0.05), 0.7),
        (Everyday::Tone, 0.5),
        (Everyday::Crop([0.6, 0.95]), 1.0),
        (Everyday::Screenshot, 1.0),
        (Everyday::Rotation(30.0), 1.0),
        (Everyday::Cover(0.1), 0.5),
    ]
}

impl Everyday {
    /// Does it to pictures `[b, 3, h, w]`, each in its own way.
    ///
    /// # Errors
    /// Pictures without pixels.
    pub fn apply(self, pictures: &Tensor<4>, rng: &mut ChaCha8Rng) -> Result<Tensor<4>> {
        let count = pictures.dims()[0];
        let crop = |rng: &mut ChaCha8Rng, [low, high]: [f32; 2]| {
            Draw::Crop(Crop {
                keep: low + (high - low) * rng.random::<f32>(),
                at: rng.random(),
            })
        };
        let mut draw = || match self {
            Self::Clean | Self::Tone => Draw::Clean,
            Self::Jpeg([low, high]) => jpeg(rng.random_range(low..=high)),
            Self::Noise(sigma) => Draw::Noise(Noise {
                sigma,
                seed: rng.random(),
            }),
            Self::Crop(sides) => crop(rng, sides),
            Self::Screenshot => crop(rng, [0.8, 0.8]),
            Self::Rotation(most) => Draw::Rotation(most * (2.0 * rng.random::<f32>() - 1.0)),
            Self::Cover(share) => Draw::Mask(vec![Rectangle {
                at: rng.random(),
                height: share.sqrt(),
                width: share.sqrt(),
            }]),
        };
        let draws: Vec<Draw> = (0..count).map(|_| draw()).collect();
        let start = match self {
            Self::Tone | Self::Screenshot => toned(pictures, rng),
            _ => pictures.clone(),
        };
        let done = distort(&draws, start)?;
        Ok(match self {
            Self::Jpeg(_) | Self::Noise(_) => with_ground(pictures, done, &vec![true; count]),
            Self::Screenshot => {
                let compressed = distort(&vec![jpeg(80); count], done.clone())?;
                with_ground(&done, compressed, &vec![true; count])
            }
            _ => done,
        })
    }
}

fn jpeg(quality: u8) -> Draw {
    Draw::Jpeg(Jpeg {
        quality,
        chroma: guardsplat_distortion::Chroma::Half,
        noise: None,
    })
}

fn distort(draws: &[Draw], pictures: Tensor<4>) -> Result<Tensor<4>> {
    let done = Layer::default().apply_with(draws, pictures, CORNERS);
    done.map_err(|e| Error::BadOption {
        field: "distortions",
        reason: e.to_string(),
    })
}

/// Brightness and tint off by a little, over the ground that was there.
fn toned(pictures: &Tensor<4>, rng: &mut ChaCha8Rng) -> Tensor<4> {
    let count = pictures.dims()[0];
    let mut off = |most: f32| most * (2.0 * rng.random::<f32>() - 1.0);
    let factors: Vec<f32> = (0..count)
        .flat_map(|_| {
            let all = 1.0 + off(TONE);
            [off(TINT), off(TINT), off(TINT)].map(|tint| all + tint)
        })
        .collect();
    let factors = Tensor::<4>::from_data(TensorData::new(factors, [count, 3, 1, 1]), &pictures.device());
    let done = (pictures.clone() * factors).clamp(0.0, 1.0);
    with_ground(pictures, done, &vec![true; count])
}

#[cfg(test)]
mod tests {
    use burn::tensor::Device;
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn everything_is_done_to_some_picture_and_grounds_stay_white() {
        let device = Device::flex();
        let side = 64;
        // A ramp of colours with a white half.
        let value = |i: usize| {
            if i % side < side / 2 {
                1.0
            } else {
                (i % 89) as f32 / 100.0
            }
        };
        let values: Vec<f32> = (0..2 * 3 * side * side).map(value).collect();
        let pictures = Tensor::<4>::from_data(TensorData::new(values, [2, 3, side, side]), &device);
        let read = |t: &Tensor<4>| t.clone().try_into_vec_as::<f32>().unwrap();
        for (what, weight) in all(1.0) {
            let done = what.apply(&pictures, &mut ChaCha8Rng::seed_from_u64(3)).unwrap();
            let again = what.apply(&pictures, &mut ChaCha8Rng::seed_from_u64(3)).unwrap();
            let (before, after) = (read(&pictures), read(&done));
            assert_eq!(after, read(&again), "{what:?}");
            assert!(
                weight > 0.0 && after.iter().all(|v| (0.0..=1.0 + 1e-6).contains(v)),
                "{what:?}"
            );
            assert_eq!(before == after, what == Everyday::Clean, "{what:?}");
            if matches!(what, Everyday::Jpeg(_) | Everyday::Noise(_) | Everyday::Tone) {
                assert!(
                    before
                        .iter()
                        .zip(&after)
                        .all(|(b, a)| *b != 1.0 || (a - 1.0).abs() < 1e-6),
                    "{what:?}"
                );
            }
        }
    }
}
