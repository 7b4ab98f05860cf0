//! Adam (Kingma and Ba 2015) over the offsets of the Gaussians that views show, with the offset penalty.
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::settings::within;
use crate::error::Result;

/// Rows that one task updates.
const CHUNK: usize = 512;

/// Rates and decays.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AdamOptions {
    /// Learning rate of constant (DC) coefficients.
    pub rate_dc: f32,
    /// Learning rate of all others.
    pub rate_rest: f32,
    /// Both rates fall along a half cosine to this share at the last step; 1 keeps them.
    pub final_rate: f32,
    /// Decay of the mean of gradients.
    pub beta1: f32,
    /// Decay of the mean of their squares.
    pub beta2: f32,
    /// Added to the root of the latter. Gradients of the penalty are down to 1e-9 in large scenes, so the common 1e-8
    /// would freeze them.
    pub epsilon: f32,
    /// Leaves Gaussians alone in steps whose views do not show them: their means wait, and their clock stands. Otherwise
    /// their steps shrink with how rarely they are seen, and the more so the larger the scene is.
    pub sparse: bool,
}

impl Default for AdamOptions {
    fn default() -> Self {
        Self {
            rate_dc: 5e-3,
            rate_rest: 5e-3 / 20.0,
            final_rate: 1.0,
            beta1: 0.9,
            beta2: 0.999,
            epsilon: 1e-15,
            sparse: false,
        }
    }
}

impl AdamOptions {
    /// The rates that fit the presets' losses.
    pub fn tuned() -> Self {
        Self {
            rate_dc: 0.014,
            rate_rest: 0.0012,
            final_rate: 0.1,
            sparse: true,
            ..Self::default()
        }
    }

    pub(super) fn check(&self) -> Result<()> {
        within("adam.rate_dc", f64::from(self.rate_dc), 0.0, 10.0)?;
        within("adam.rate_rest", f64::from(self.rate_rest), 0.0, 10.0)?;
        within("adam.final_rate", f64::from(self.final_rate), 0.0, 1.0)?;
        within("adam.beta1", f64::from(self.beta1), 0.0, 0.999_999)?;
        within("adam.beta2", f64::from(self.beta2), 0.0, 0.999_999)?;
        // Squares of gradients below 1e-21 vanish in single precision; what they are divided by then must not.
        within("adam.epsilon", f64::from(self.epsilon), 1e-20, 1.0)
    }
}

/// `dc * mean(o_dc^2) + rest * mean(o_rest^2)`, means over all Gaussians of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Penalty {
    /// Weight of constant coefficients.
    pub dc: f32,
    /// Weight of the others.
    pub rest: f32,
}

impl Penalty {
    /// Value for offsets `[slots][stride]`, of which the first three of a Gaussian are constant coefficients, in a scene
    /// of `gaussians`; those without a slot have no offsets.
    pub fn value(&self, offsets: &[f32], stride: usize, gaussians: usize) -> f64 {
        // Partial sums are added in order, so that the value does not depend on the number of threads.
        let parts: Vec<[f64; 2]> = offsets
            .par_chunks(CHUNK * stride)
            .map(|chunk| {
                let mut sums = [0.0; 2];
                for row in chunk.chunks_exact(stride) {
                    for (k, &o) in row.iter().enumerate() {
                        sums[usize::from(k >= 3)] += f64::from(o).powi(2);
                    }
                }
                sums
            })
            .collect();
        let [dc, rest] = parts
            .iter()
            .fold([0.0; 2], |sum, part| [sum[0] + part[0], sum[1] + part[1]]);
        let [scale_dc, scale_rest] = self.scales(gaussians, stride);
        dc * scale_dc + rest * scale_rest
    }

    /// What a squared offset of each kind is multiplied by: weight over count.
    pub(super) fn scales(&self, rows: usize, stride: usize) -> [f64; 2] {
        let over = |weight: f32, count: usize| match count {
            0 => 0.0, // no Gaussians, or no coefficients beyond the constant one
            count => f64::from(weight) / count as f64,
        };
        [over(self.dc, 3 * rows), over(self.rest, (stride - 3) * rows)]
    }
}

/// The state of the optimiser; Gaussians that are not learned take none.
pub struct Adam {
    pub(super) options: AdamOptions,
    stride: usize,
    pub(super) gaussians: usize,
    /// Steps that each row has taken.
    steps: Vec<u32>,
    /// Of the step sizes after so many steps, for what the means still lack of having begun at 0.
    corrections: Vec<Correction>,
    mean: Vec<f32>,
    square: Vec<f32>,
}

impl Adam {
    /// For `rows` learned Gaussians of `stride` coefficients each, in a scene of `gaussians`.
    pub fn new(options: AdamOptions, rows: usize, stride: usize, gaussians: usize) -> Self {
        Self {
            options,
            stride,
            gaussians,
            steps: vec![0; rows],
            corrections: Vec::new(),
            mean: vec![0.0; rows * stride],
            square: vec![0.0; rows * stride],
        }
    }

    /// One step; rates are multiplied by `rate`. The penalty's gradient is added to `gradient`, which is all zero
    /// afterwards.
    pub fn step(&mut self, rate: f32, penalty: Penalty, offsets: &mut [f32], gradient: &mut [f32]) {
        let (o, stride) = (self.options, self.stride);
        let [dc, rest] = penalty.scales(self.gaussians, stride).map(|s| 2.0 * s as f32);
        let [rate_dc, rate_rest] = [o.rate_dc, o.rate_rest].map(|r| r * rate);
        // No row has taken more steps than there were calls.
        self.corrections
            .push(Correction::new(o, self.corrections.len() as i32 + 1));
        let corrections = &self.corrections;
        let size = CHUNK * stride;
        (
            self.steps.par_chunks_mut(CHUNK),
            offsets.par_chunks_mut(size),
            gradient.par_chunks_mut(size),
            self.mean.par_chunks_mut(size),
            self.square.par_chunks_mut(size),
        )
            .into_par_iter()
            .for_each(|(steps, offsets, gradient, mean, square)| {
                for row in 0..steps.len() {
                    let columns = row * stride..(row + 1) * stride;
                    if o.sparse && gradient[columns.clone()].iter().all(|g| *g == 0.0) {
                        continue;
                    }
                    let correction = corrections[steps[row] as usize];
                    steps[row] += 1;
                    for (k, at) in columns.enumerate() {
                        let (rate, pull) = if k < 3 { (rate_dc, dc) } else { (rate_rest, rest) };
                        let g = gradient[at] + pull * offsets[at];
                        gradient[at] = 0.0;
                        mean[at] = o.beta1 * mean[at] + (1.0 - o.beta1) * g;
                        square[at] = o.beta2 * square[at] + (1.0 - o.beta2) * g * g;
                        let root = square[at].sqrt() / correction.root + o.epsilon;
                        offsets[at] -= rate * correction.scale * mean[at] / root;
                    }
                }
            });
    }
}

/// What the means lack after some steps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Correction {
    /// Of the mean of gradients, as a factor.
    pub scale: f32,
    /// Of the root of the mean of squares, as a divisor.
    pub root: f32,
}

impl Correction {
    pub fn new(options: AdamOptions, steps: i32) -> Self {
        let lack = |beta: f32| 1.0 - f64::from(beta).powi(steps);
        Self {
            scale: (1.0 / lack(options.beta1)) as f32,
            root: lack(options.beta2).sqrt() as f32,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NONE: Penalty = Penalty { dc: 0.0, rest: 0.0 };

    #[test]
    fn follows_a_sequence_computed_by_hand() {
        let options = AdamOptions {
            rate_dc: 0.1,
            rate_rest: 0.01,
            ..AdamOptions::default()
        };
        let mut adam = Adam::new(options, 1, 12, 1);
        let mut offsets = vec![0.0; 12];
        let mut step = |g: f32, offsets: &mut Vec<f32>| {
            let mut gradient = vec![0.0; 12];
            (gradient[0], gradient[3]) = (g, g);
            adam.step(1.0, NONE, offsets, &mut gradient);
            assert_eq!(gradient, [0.0; 12]);
        };
        // Gradients 1 and -2: means 0.1 and -0.11, squares 0.001 and 0.004999, corrected by 0.1, 0.19, 0.001, 0.001999.
        step(1.0, &mut offsets);
        assert!((offsets[0] + 0.1).abs() < 1e-6 && (offsets[3] + 0.01).abs() < 1e-7);
        step(-2.0, &mut offsets);
        let second = 0.1 * (0.11 / 0.19) / (0.004_999_f32 / 0.001_999).sqrt();
        assert!((offsets[0] - (-0.1 + second)).abs() < 1e-6, "{}", offsets[0]);
        assert!((offsets[3] - 0.1 * (-0.1 + second)).abs() < 1e-7);
        assert_eq!(offsets[1], 0.0);
    }

    #[test]
    fn tiny_gradients_move_offsets() {
        let mut adam = Adam::new(AdamOptions::default(), 2, 3, 2);
        let mut offsets = vec![0.0; 6];
        let mut gradient = vec![1e-10; 6];
        adam.step(0.5, NONE, &mut offsets, &mut gradient);
        assert!((offsets[0] + 2.5e-3).abs() < 1e-6, "{}", offsets[0]);
    }

    #[test]
    fn sparse_rows_wait_without_gradient_and_go_on_where_they_were() {
        let options = AdamOptions {
            sparse: true,
            ..AdamOptions::default()
        };
        // The second row is shown in two of four steps, and ends where the first is after two.
        let mut adam = Adam::new(options, 2, 3, 2);
        let mut offsets = vec![0.0; 6];
        for (step, g) in [0.5, 0.0, 0.0, -0.2].into_iter().enumerate() {
            let always = [0.5, -0.2, 0.7, 0.1][step];
            let mut gradient = vec![always, always, always, g, g, g];
            adam.step(1.0, NONE, &mut offsets, &mut gradient);
            if step == 1 {
                assert!(offsets[3] != offsets[0]);
            }
        }
        let mut alone = Adam::new(options, 1, 3, 1);
        let mut expected = vec![0.0; 3];
        for g in [0.5, -0.2] {
            alone.step(1.0, NONE, &mut expected, &mut [g; 3]);
        }
        assert_eq!(offsets[3..], expected[..]);
    }

    #[test]
    fn the_penalty_pulls_by_its_gradient() {
        // Two Gaussians of degree 1: 6 constant coefficients, 18 others.
        let penalty = Penalty { dc: 6.0, rest: 1.8 };
        let mut offsets = vec![0.0; 24];
        (offsets[0], offsets[15]) = (0.5, -2.0);
        let value = penalty.value(&offsets, 12, 2);
        assert!((value - (0.25 + 0.1 * 4.0)).abs() < 1e-6, "{value}");
        // With both betas at 0 a step is rate * g / |g|; the root of the second moment is |g|.
        let options = AdamOptions {
            beta1: 0.0,
            beta2: 0.0,
            epsilon: 1.0,
            rate_dc: 1.0,
            rate_rest: 1.0,
            ..AdamOptions::default()
        };
        let mut adam = Adam::new(options, 2, 12, 2);
        let before = offsets.clone();
        adam.step(1.0, penalty, &mut offsets, &mut [0.0; 24]);
        for at in 0..24 {
            let h = 1e-3;
            let at_step = |sign: f32| {
                let mut moved = before.clone();
                moved[at] += sign * h;
                penalty.value(&moved, 12, 2)
            };
            let slope = ((at_step(1.0) - at_step(-1.0)) / (2.0 * f64::from(h))) as f32;
            let expected = before[at] - slope / (slope.abs() + 1.0);
            assert!((offsets[at] - expected).abs() < 1e-4, "{at}");
        }
        // Degree 0 has no other coefficients.
        assert_eq!(penalty.value(&[1.0, 0.0, 0.0], 3, 1), 2.0);
    }
}
