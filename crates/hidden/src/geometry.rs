//! How views of a scene differ: pictures turned, zoomed and moved at random.
use burn::tensor::{Device, Int, Tensor, TensorData};
use rand::Rng;

use crate::error::{Result, within};
use crate::parameter::uniform;

/// How far pictures are changed at most; each gets its own change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    /// Degrees of rotation to either side, 0 to 180.
    pub degrees: f32,
    /// Largest zoom, at least 1 and at most 4; zooms are uniform in their logarithm from its inverse up to it.
    pub zoom: f32,
    /// Largest move along each axis, as a part of the side, 0 to 0.5.
    pub shift: f32,
}

impl Geometry {
    /// No change.
    pub const NONE: Self = Self {
        degrees: 0.0,
        zoom: 1.0,
        shift: 0.0,
    };

    /// Fails with [`crate::Error::OutOfRange`] unless all is within the limits above.
    pub(crate) fn check(&self) -> Result<()> {
        within("rotation", self.degrees.into(), 0.0, 180.0)?;
        within("zoom", self.zoom.into(), 1.0, 4.0)?;
        within("shift", self.shift.into(), 0.0, 0.5)
    }

    /// The same changes, `part` (0 to 1) as far.
    pub(crate) fn scaled(&self, part: f32) -> Self {
        Self {
            degrees: self.degrees * part,
            zoom: self.zoom.powf(part),
            shift: self.shift * part,
        }
    }

    /// Changes pictures `[b, 3, h, w]`, with bilinear weights; differentiable in them. Outside, the nearest pixel
    /// repeats.
    pub(crate) fn apply(&self, pictures: Tensor<4>, rng: &mut impl Rng) -> Tensor<4> {
        if *self == Self::NONE {
            return pictures;
        }
        let [b, c, h, w] = pictures.dims();
        let mut taps = Taps::with_capacity(b * h * w);
        for _ in 0..b {
            taps.add(&Map::random(self, h, w, rng), h, w);
        }
        let device = pictures.device().without_autodiff();
        let flat = pictures.reshape([b, c, h * w]);
        let parts = taps.on(&device, [b, 1, h * w]);
        let parts = parts.map(|(at, weight)| flat.clone().gather(2, at.repeat_dim(1, c)) * weight);
        let [first, second, third, fourth] = parts;
        (first + second + third + fourth).reshape([b, c, h, w])
    }
}

impl Default for Geometry {
    /// What the views of a walk around a scene show: 15 degrees, 0.8 to 1.25 times the size, a twelfth of the side.
    fn default() -> Self {
        Self {
            degrees: 15.0,
            zoom: 1.25,
            shift: 1.0 / 12.0,
        }
    }
}

/// Where the pixels of one picture come from.
struct Map {
    cos: f32,
    sin: f32,
    down: f32,
    right: f32,
}

impl Map {
    fn random(range: &Geometry, h: usize, w: usize, rng: &mut impl Rng) -> Self {
        let mut symmetric = |bound: f32| uniform(rng, -bound, bound);
        let angle = symmetric(range.degrees).to_radians();
        let inverse = symmetric(range.zoom.ln()).exp();
        Self {
            cos: angle.cos() * inverse,
            sin: angle.sin() * inverse,
            down: symmetric(range.shift) * h as f32,
            right: symmetric(range.shift) * w as f32,
        }
    }
}

/// The four old pixels that each new one is made of: positions, and their weights.
struct Taps {
    at: [Vec<i32>; 4],
    weights: [Vec<f32>; 4],
}

impl Taps {
    fn with_capacity(count: usize) -> Self {
        Self {
            at: std::array::from_fn(|_| Vec::with_capacity(count)),
            weights: std::array::from_fn(|_| Vec::with_capacity(count)),
        }
    }

    fn add(&mut self, map: &Map, h: usize, w: usize) {
        let (middle_y, middle_x) = ((h as f32 - 1.0) / 2.0, (w as f32 - 1.0) / 2.0);
        for i in 0..h {
            for j in 0..w {
                let (y, x) = (i as f32 - middle_y, j as f32 - middle_x);
                let from_y = map.sin * x + map.cos * y + middle_y + map.down;
                let from_x = map.cos * x - map.sin * y + middle_x + map.right;
                let (top, bottom, part_y) = neighbours(from_y, h);
                let (left, right, part_x) = neighbours(from_x, w);
                let four = [
                    (top, left, (1.0 - part_y) * (1.0 - part_x)),
                    (top, right, (1.0 - part_y) * part_x),
                    (bottom, left, part_y * (1.0 - part_x)),
                    (bottom, right, part_y * part_x),
                ];
                for (k, (y, x, weight)) in four.into_iter().enumerate() {
                    self.at[k].push((y * w + x) as i32);
                    self.weights[k].push(weight);
                }
            }
        }
    }

    fn on(self, device: &Device, shape: [usize; 3]) -> [(Tensor<3, Int>, Tensor<3>); 4] {
        let mut pairs = self.at.into_iter().zip(self.weights);
        std::array::from_fn(|_| {
            let (at, weights) = pairs.next().unwrap_or_default();
            (
                Tensor::from_data(TensorData::new(at, shape), device),
                Tensor::from_data(TensorData::new(weights, shape), device),
            )
        })
    }
}

/// The two pixels on either side of a position along an axis, and how far it is from the first to the second.
fn neighbours(from: f32, side: usize) -> (usize, usize, f32) {
    let last = side.saturating_sub(1);
    let from = from.clamp(0.0, last as f32);
    let low = from.floor();
    ((low as usize).min(last), (low as usize + 1).min(last), from - low)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::host;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn ramp() -> Tensor<4> {
        let values = (0..3 * 64).map(|i| (i % 8) as f32 / 10.0).collect();
        Tensor::from_data(TensorData::new::<f32, _>(values, [1, 3, 8, 8]), &Device::flex())
    }

    #[test]
    fn no_change_is_exact_and_a_shift_moves() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let values = host(ramp()).unwrap();
        assert_eq!(host(Geometry::NONE.apply(ramp(), &mut rng)).unwrap(), values);
        let shift = Geometry {
            shift: 0.25,
            ..Geometry::NONE
        };
        let moved = host(shift.apply(ramp(), &mut rng)).unwrap();
        // The middle of a ramp rises or falls by the same everywhere.
        let by = moved[8 * 4 + 4] - values[8 * 4 + 4];
        assert!(by.abs() > 1e-3 && by.abs() <= 0.2 + 1e-6, "{by}");
        assert!((moved[8 * 2 + 3] - values[8 * 2 + 3] - by).abs() < 1e-5);
    }

    #[test]
    fn neighbours_stay_inside() {
        assert_eq!(neighbours(-3.0, 5), (0, 1, 0.0));
        assert_eq!(neighbours(1.25, 5), (1, 2, 0.25));
        assert_eq!(neighbours(9.0, 5), (4, 4, 0.0));
    }

    #[test]
    fn ranges_are_checked() {
        Geometry::default().check().unwrap();
        let tiny = Geometry {
            zoom: 0.5,
            ..Geometry::NONE
        };
        assert!(tiny.check().unwrap_err().to_string().starts_with("zoom is 0.5"));
    }
}
