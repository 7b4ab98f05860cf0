//! Preconditioned SGD with momentum over the offsets: a step is divided by what it costs in the picture.
//!
//! Adam divides a gradient by its own size, so that a Gaussian whose gradients from different views cancel moves as far
//! as one whose gradients agree, at random: most of what a mark then costs is that walk. Here a coefficient's step is
//! its mean gradient over the curvature of the reconstruction, `2 sum_p w c` with the weights w of the Gaussian's pixels
//! and c the cover of the pixel (a row sum of the Gauss-Newton matrix, which bounds it): gradients that cancel, cancel.
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::settings::within;
use crate::error::Result;

/// Rows that one task updates.
const CHUNK: usize = 512;
/// The square of the constant spherical harmonic, and the mean square over directions of all others.
pub(super) const MEAN_SQUARE: f32 = 0.079_577_47;
/// Smallest energy of a Gaussian that is believed, against the mean of all.
const FLOOR: f32 = 1e-2;
/// The same where views are from inside, as among cameras that were given: each shows another part of the scene, so what few show
/// is known badly, and a step that is divided by too little is seen from the next camera. One mark of 32 bits in a room of
/// the project's own reads 97.5, 96.9 and 90.6 % with 0.3, 1 and 3, at 35.2, 37.5 and 37.9 dB; with 0.01 half.
const FLOOR_OF_PARTS: f32 = 1.0;

/// Rates of the steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PreconditionedSgdOptions {
    /// Length of a step: the root mean square change of a picture.
    pub length: f32,
    /// Share of constant (DC) coefficients in it; 0 leaves them alone.
    pub dc: f32,
    /// Share of all others.
    pub rest: f32,
    /// The length falls along a half cosine to this share at the last step; 1 keeps it.
    pub final_rate: f32,
    /// Decay of the mean of gradients. Steps have a given length, so with a slow decay offsets swing about where they should
    /// be: with 0.2 a room reads more than with 0.8 after twice the steps (docs/evaluation.md, "What was tried").
    pub momentum: f32,
}

impl Default for PreconditionedSgdOptions {
    fn default() -> Self {
        Self {
            length: 2e-3,
            dc: 1.0,
            rest: 0.1,
            final_rate: 0.05,
            momentum: 0.2,
        }
    }
}

impl PreconditionedSgdOptions {
    pub(super) fn check(&self) -> Result<()> {
        within("preconditioned_sgd.length", f64::from(self.length), 0.0, 1.0)?;
        within("preconditioned_sgd.dc", f64::from(self.dc), 0.0, 100.0)?;
        within("preconditioned_sgd.rest", f64::from(self.rest), 0.0, 100.0)?;
        within("preconditioned_sgd.final_rate", f64::from(self.final_rate), 0.0, 1.0)?;
        within("preconditioned_sgd.momentum", f64::from(self.momentum), 0.0, 0.999)
    }
}

/// The state of the optimiser.
pub struct PreconditionedSgd {
    pub(super) options: PreconditionedSgdOptions,
    stride: usize,
    /// Of each slot: one over the mean over views of `sum_p w c`, a colour's squared change in a picture's squares.
    pub(super) inverse: Vec<f32>,
    velocity: Vec<f32>,
    /// Running mean of the squared length of steps before they are scaled, and the largest that it was.
    running: f32,
    largest: f32,
}

impl PreconditionedSgd {
    /// For slots of `stride` coefficients with these energies: the mean over views of the sum over pixels of a Gaussian's
    /// weight times the cover of the pixel.
    /// `of_parts` says whether each of these views shows another part of the scene.
    pub fn new(options: PreconditionedSgdOptions, stride: usize, energies: &[f32], of_parts: bool) -> Self {
        let mean = energies.iter().map(|e| f64::from(*e)).sum::<f64>() / energies.len().max(1) as f64;
        let floor = if of_parts { FLOOR_OF_PARTS } else { FLOOR };
        let floor = (floor * mean as f32).max(f32::MIN_POSITIVE);
        Self {
            options,
            stride,
            inverse: energies.iter().map(|e| e.max(floor).recip()).collect(),
            velocity: vec![0.0; stride * energies.len()],
            running: 0.0,
            largest: 0.0,
        }
    }

    /// One step along `gradient`, which is all zero afterwards. `rate` multiplies the length; `pixels` are the numbers of a
    /// picture.
    pub fn step(&mut self, rate: f32, pixels: f32, offsets: &mut [f32], gradient: &mut [f32]) {
        let (o, stride) = (self.options, self.stride);
        let size = CHUNK * stride;
        // Partial sums are added in order, so that the step does not depend on the number of threads.
        let energies: Vec<f64> = (
            self.inverse.par_chunks(CHUNK),
            gradient.par_chunks_mut(size),
            self.velocity.par_chunks_mut(size),
        )
            .into_par_iter()
            .map(|(inverse, gradient, velocity)| {
                let mut energy = 0.0;
                for (row, inverse) in inverse.iter().enumerate() {
                    let mut squares = 0.0;
                    for (k, at) in (row * stride..(row + 1) * stride).enumerate() {
                        let share = if k < 3 { o.dc } else { o.rest };
                        let step = share * inverse * gradient[at];
                        gradient[at] = 0.0;
                        velocity[at] = o.momentum * velocity[at] + (1.0 - o.momentum) * step;
                        squares += velocity[at] * velocity[at];
                    }
                    energy += f64::from(squares / inverse);
                }
                energy
            })
            .collect();
        let energy = energies.iter().sum::<f64>() as f32 * MEAN_SQUARE / pixels;
        if energy > 0.0 {
            self.running = if self.largest == 0.0 {
                energy
            } else {
                0.9 * self.running + 0.1 * energy
            };
            self.largest = self.largest.max(self.running);
            let scale = rate * o.length / self.largest.max(energy).sqrt();
            let pairs = offsets.par_chunks_mut(size).zip(self.velocity.par_chunks(size));
            pairs.for_each(|(offsets, velocity)| offsets.iter_mut().zip(velocity).for_each(|(o, v)| *o -= scale * v));
        }
    }
}
