//! What CLIP sees of a training view: brighter or darker, zoomed and shifted, where that is asked for.
//!
//! Nothing unless it is. The shipped CLIP reads exact tones, and whoever reads a picture guesses them
//! ([`crate::extract::corrections`]); half a percent of brightness alone, which moves the ground too, costs a scene of few
//! colours four points of accuracy (docs/evaluation.md).
//! Only the message term sees augmented pictures; reconstruction compares the views themselves.
use burn::tensor::{Tensor, TensorData};
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

use super::settings::within;
use crate::error::Result;

/// Ranges from which each view draws.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Augmentation {
    /// Brightness factors are within 1 +- this.
    pub brightness: f32,
    /// Zoom factors are within 1 +- this.
    pub scale: f32,
    /// The centre moves by up to this share of a side, either way.
    pub shift: f32,
}

impl Augmentation {
    pub(super) fn check(&self) -> Result<()> {
        within("augmentation.brightness", f64::from(self.brightness), 0.0, 0.9)?;
        within("augmentation.scale", f64::from(self.scale), 0.0, 0.9)?;
        within("augmentation.shift", f64::from(self.shift), 0.0, 0.5)
    }

    /// Augments pictures `[b, 3, h, w]` in [0, 1], each by its own draws; differentiable.
    pub fn apply(&self, pictures: Tensor<4>, rng: &mut impl Rng) -> Tensor<4> {
        let [b, c, h, w] = pictures.dims();
        let device = pictures.device();
        // Every view takes four draws whatever the ranges, so that changing one does not change the others.
        let draws: Vec<[f32; 4]> = (0..b)
            .map(|_| std::array::from_fn(|_| 2.0 * rng.random::<f32>() - 1.0))
            .collect();
        let mut x = pictures;
        if self.scale > 0.0 || self.shift > 0.0 {
            let matrices = |side: usize, axis: usize| {
                let values = draws
                    .iter()
                    .flat_map(|d| resample(side, 1.0 + self.scale * d[1], self.shift * d[2 + axis]));
                let values: Vec<f32> = values.collect();
                Tensor::<3>::from_data(TensorData::new(values, [b, side, side]), &device)
            };
            // Along x for all rows of a picture at once, then the same along y on the transposed picture.
            x = x.reshape([b, c * h, w]).matmul(matrices(w, 0)).reshape([b, c, h, w]);
            let turned = x.swap_dims(2, 3).reshape([b, c * w, h]);
            x = turned.matmul(matrices(h, 1)).reshape([b, c, w, h]).swap_dims(2, 3);
        }
        if self.brightness > 0.0 {
            let factors: Vec<f32> = draws.iter().map(|d| 1.0 + self.brightness * d[0]).collect();
            let factors = Tensor::<4>::from_data(TensorData::new(factors, [b, 1, 1, 1]), &device);
            x = (x * factors).clamp(0.0, 1.0);
        }
        x
    }
}

/// `[from][to]`: linear interpolation of a line of `side` pixels, zoomed by `zoom` about its centre and moved by
/// `shift` sides; beyond the ends the last pixel goes on.
fn resample(side: usize, zoom: f32, shift: f32) -> Vec<f32> {
    let mut matrix = vec![0.0; side * side];
    let n = side as f32;
    for to in 0..side {
        let at = ((to as f32 + 0.5) / n - 0.5) / zoom + 0.5 + shift;
        let at = (at * n - 0.5).clamp(0.0, n - 1.0);
        let low = at.floor() as usize;
        let part = at - low as f32;
        matrix[low * side + to] += 1.0 - part;
        matrix[(low + 1).min(side - 1) * side + to] += part;
    }
    matrix
}

#[cfg(test)]
mod tests {
    use burn::tensor::Device;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn ramp(b: usize, h: usize, w: usize) -> Tensor<4> {
        let values: Vec<f32> = (0..b * 3 * h * w).map(|i| (i % w) as f32 / w as f32).collect();
        Tensor::from_data(TensorData::new(values, [b, 3, h, w]), &Device::flex())
    }

    fn host(x: Tensor<4>) -> Vec<f32> {
        x.try_into_vec_as::<f32>().unwrap()
    }

    #[test]
    fn lines_are_interpolated() {
        let line = |zoom, shift| {
            let matrix = resample(4, zoom, shift);
            (0..4)
                .map(|to| (0..4).map(|from| from as f32 * matrix[from * 4 + to]).sum())
                .collect::<Vec<f32>>()
        };
        assert_eq!(line(1.0, 0.0), [0.0, 1.0, 2.0, 3.0]);
        assert_eq!(line(1.0, 0.25), [1.0, 2.0, 3.0, 3.0]);
        assert_eq!(line(2.0, 0.0), [0.75, 1.25, 1.75, 2.25]);
        assert_eq!(line(0.5, 0.0), [0.0, 0.5, 2.5, 3.0]);
    }

    #[test]
    fn nothing_asked_for_changes_nothing_and_draws_are_seeded() {
        let x = ramp(2, 6, 8);
        let none = Augmentation::default();
        let run = |a: &Augmentation, seed| host(a.apply(x.clone(), &mut ChaCha8Rng::seed_from_u64(seed)));
        assert_eq!(run(&none, 1), host(x.clone()));
        let some = Augmentation {
            brightness: 0.1,
            ..none
        };
        assert_eq!(run(&some, 1), run(&some, 1));
        assert_ne!(run(&some, 1), run(&some, 2));
        // Two views of a batch differ, and shifting x moves the ramp while every row stays like the next.
        let out = run(&Augmentation { shift: 0.3, ..none }, 1);
        assert_ne!(out[..144], out[144..]);
        assert!((out[8 + 3] - out[3]).abs() < 1e-6);
        let bright = run(
            &Augmentation {
                brightness: 0.9,
                ..none
            },
            1,
        );
        let ratio = bright[1] / host(x.clone())[1];
        assert!((bright[2] / host(x.clone())[2] - ratio).abs() < 1e-5 && (ratio - 1.0).abs() > 0.01);
    }
}
