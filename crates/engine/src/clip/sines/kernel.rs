//! The arithmetic of mean sines: blocks of pixels in vector registers, waves one after the other.
//!
//! Angles are in turns, so that the whole turns are what rounding takes away, and a cosine is the sine a quarter turn on.
//! For a pixel and a wave the mean takes 13 instructions (3 of the angle, 3 of the reduction, 1 square, 5 of the
//! polynomial, 1 to multiply and add up), and the gradient 16.
use crate::simd::{Vectorised, multiply_add};

/// Pixels that are computed together: two AVX-512 registers a colour, so that one's instructions fill the other's waits.
pub(super) const LANES: usize = 32;

/// Coefficients of r, r^3, r^5... of sin 2 pi r: the minimax polynomial over [-1/2, 1/2], within 9.6e-8, in f32 within 8e-7.
pub(super) const SINE: [f32; 6] = [6.283_182_6, -41.341_42, 81.596_18, -76.580_1, 41.205_395, -12.271_263];

pub(super) type Lanes = [f32; LANES];

/// Three colours of a few pixels.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub(super) struct Block(pub [Lanes; 3]);

/// A filter and its phase, in turns.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wave {
    pub filter: [f32; 3],
    pub phase: f32,
}

impl Wave {
    /// Of a filter and a phase in radians, `shift` turns on.
    pub fn new(filter: &[f32; 3], phase: f32, shift: f64) -> Self {
        let turns = |radians: f32| f64::from(radians) / std::f64::consts::TAU;
        let phase = turns(phase) + shift;
        Self {
            filter: filter.map(|f| turns(f) as f32),
            phase: (phase - phase.round()) as f32,
        }
    }
}

/// A wave whose cosine goes into gradients to colours with these weights.
#[derive(Clone, Copy)]
pub(super) struct Slope {
    pub wave: Wave,
    pub weights: [f32; 3],
}

/// Sums of the sines of each wave, times the weight of each pixel. Pixels that only fill a block have none.
pub(super) struct WeightedSums<'a> {
    pub blocks: &'a [Block],
    pub weights: &'a [Lanes],
    pub waves: &'a [Wave],
    pub sums: &'a mut [f32],
}

impl Vectorised for WeightedSums<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        for (wave, sum) in self.waves.iter().zip(self.sums) {
            let mut lanes = [0.0; LANES];
            for (block, weights) in self.blocks.iter().zip(self.weights) {
                for i in 0..LANES {
                    let (slope, r) = sine::<FUSED>(wave, block, i);
                    lanes[i] = multiply_add::<FUSED>(slope * r, weights[i], lanes[i]);
                }
            }
            *sum = lanes.iter().sum();
        }
    }
}

/// Puts gradients in the place of colours.
pub(super) struct Differentiate<'a> {
    pub blocks: &'a mut [Block],
    pub slopes: &'a [Slope],
}

impl Vectorised for Differentiate<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        for block in self.blocks {
            let mut sums = [[0.0; LANES]; 3];
            for Slope { wave, weights } in self.slopes {
                for i in 0..LANES {
                    let (slope, r) = sine::<FUSED>(wave, block, i);
                    let cosine = slope * r;
                    for (sum, weight) in sums.iter_mut().zip(weights) {
                        sum[i] = multiply_add::<FUSED>(*weight, cosine, sum[i]);
                    }
                }
            }
            block.0 = sums;
        }
    }
}

/// Two factors of the sine of a wave at a pixel: the caller's sum takes the last multiplication.
#[inline(always)]
fn sine<const FUSED: bool>(wave: &Wave, block: &Block, i: usize) -> (f32, f32) {
    /// Adding and subtracting 1.5 * 2^23 rounds to a whole number.
    const ROUND: f32 = 12_582_912.0;
    let [red, green, blue] = wave.filter;
    let turns = multiply_add::<FUSED>(blue, block.0[2][i], wave.phase);
    let turns = multiply_add::<FUSED>(green, block.0[1][i], turns);
    let turns = multiply_add::<FUSED>(red, block.0[0][i], turns);
    let r = turns - ((turns + ROUND) - ROUND);
    let z = r * r;
    let mut value = SINE[5];
    for coefficient in SINE[..5].iter().rev() {
        value = multiply_add::<FUSED>(value, z, *coefficient);
    }
    (value, r)
}
