//! A controller of loss weights that holds a PSNR: one factor on the reconstruction terms, large while pictures are too far off, small while there is room
//! and bits are still wrong.
//!
//! After every step the mean PSNR and bit accuracy of its views enter exponential running means. With e the dB that the
//! running PSNR is below the target, the factor is `exp(proportional * e + integral * sum of e)`, within `1 / limit` and
//! `limit`; the sum is kept within them too, so that nothing builds up which then takes as long to go. Room above the
//! target counts only while the accuracy is below `bit_accuracy`. PSNR follows the factor some twenty steps late: an
//! integral alone overshoots by 1 to 2 dB. Adam does not mind the overall scale of a loss, so this is a dial between
//! seeing and reading.
//!
//! A second factor, on SSIM within reconstruction, holds an SSIM in the same way, between 0 and 1: a weight that scenes full of
//! texture do not feel would leave a scene of few smooth surfaces hardly any place for a mark.
//!
//! A scene that covers little of its pictures would be changed the more for it, to no use: a change of several turns of what
//! reads it is no stronger mark. So a PSNR is also held over the pixels that are covered.
//!
//! Where bits stay wrong, both targets give way a little, and no further than the scene needs ([`TargetRelaxation`]): a scene of few
//! smooth surfaces holds 64 bits at 38 dB that it does not hold at 40, and one full of texture gains nothing.
use serde::{Deserialize, Serialize};

use super::settings::within;
use crate::error::Result;

/// Targets and gains of the [`LossWeightController`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LossWeightControl {
    /// PSNR to hold on training views, dB.
    pub target_psnr_db: f64,
    /// PSNR to hold over covered pixels, dB, however far the other one gives way; `None` for none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covered_psnr_db: Option<f64>,
    /// Training bit accuracy from which on the factor is not lowered any more.
    pub bit_accuracy: f64,
    /// Of the logarithm of the factor, for each dB below the target.
    pub proportional: f64,
    /// Of the logarithm of the factor, for each dB below the target and step.
    pub integral: f64,
    /// Largest factor, and one over the smallest.
    pub limit: f64,
    /// Decay of the running means.
    pub memory: f64,
    /// SSIM to hold on training views, by weighing it less where it is above; `None` leaves its weight.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target_ssim: Option<f64>,
    /// What is given up of both where bits stay wrong; `None` for nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub yielding: Option<TargetRelaxation>,
}

/// How far targets give way. After [`RELAXES_AFTER`] steps the share that they have given way grows by [`RELAXATION_GAIN`] times what
/// the running bit accuracy lacks of `below`, and shrinks likewise; it stays within 0 and 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TargetRelaxation {
    /// Training bit accuracy below which they do.
    pub below: f64,
    /// Of the PSNR at most, dB.
    pub psnr_db: f64,
    /// Of the SSIM at most.
    pub ssim: f64,
}

/// Steps before which bits may be wrong because they were not learnt yet.
const RELAXES_AFTER: usize = 80;
/// Of the share of a [`TargetRelaxation`], for each step and all bits that are lacking: all of it within 80 steps of 0.05.
const RELAXATION_GAIN: f64 = 0.25;

/// Of the dB that held-out views lack, what a look at them adds to the PSNR that is held. The next look comes after 25 steps,
/// and PSNR follows within twenty.
const RAISE_GAIN: f64 = 0.5;
/// Most that is added, dB.
const MOST_RAISED_DB: f64 = 4.0;

/// Of the logarithm of the factor on SSIM, for each unit below the target.
const SSIM_PROPORTIONAL: f64 = 300.0;
/// The same, for each unit below the target and step.
const SSIM_INTEGRAL: f64 = 20.0;
/// Smallest factor on SSIM.
const SSIM_LEAST: f64 = 0.01;

impl Default for LossWeightControl {
    fn default() -> Self {
        Self {
            target_psnr_db: 36.0,
            covered_psnr_db: None,
            bit_accuracy: 0.999,
            proportional: 2.0,
            integral: 0.05,
            limit: 100.0,
            memory: 0.8,
            target_ssim: None,
            yielding: None,
        }
    }
}

impl LossWeightControl {
    pub(super) fn check(&self) -> Result<()> {
        within("balance.target_psnr_db", self.target_psnr_db, 0.0, 200.0)?;
        within(
            "balance.covered_psnr_db",
            self.covered_psnr_db.unwrap_or(0.0),
            0.0,
            200.0,
        )?;
        within("balance.proportional", self.proportional, 0.0, 100.0)?;
        within("balance.integral", self.integral, 0.0, 100.0)?;
        within("balance.limit", self.limit, 1.0, 1e6)?;
        within("balance.target_ssim", self.target_ssim.unwrap_or(0.0), 0.0, 1.0)?;
        if let Some(yielding) = self.yielding {
            within("balance.yielding.below", yielding.below, 0.0, 1.0)?;
            within("balance.yielding.psnr_db", yielding.psnr_db, 0.0, 100.0)?;
            within("balance.yielding.ssim", yielding.ssim, 0.0, 1.0)?;
        }
        within("balance.memory", self.memory, 0.0, 0.9999)
    }
}

/// The factor and what it follows.
#[derive(Clone, Debug)]
pub struct LossWeightController {
    balance: Option<LossWeightControl>,
    /// PSNR of whole pictures that is held in any case: where covered pixels have theirs, and the others do not change.
    least_db: f64,
    running: Option<[f64; 3]>,
    /// `integral * sum of e`.
    sum: f64,
    factor: f64,
    /// The same two of SSIM.
    ssim: (f64, f64),
    steps: usize,
    /// Share of the [`TargetRelaxation`] that is given up.
    given: f64,
    /// dB by which the PSNR of training views is held higher, because held-out views have less than they must.
    raised: f64,
}

/// What terms of the loss are multiplied by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LossWeightFactors {
    /// All that compare pictures.
    pub reconstruction: f32,
    /// SSIM among these, besides.
    pub ssim: f32,
}

impl LossWeightController {
    /// Starts at 1, and stays there without a `balance`. `covered` is the share of a view that the scene covers.
    pub fn new(balance: Option<LossWeightControl>, covered: f64) -> Self {
        let over_covered = balance.and_then(|balance| balance.covered_psnr_db);
        // Of a scene that covers nothing there is nothing to hold.
        let over_covered = over_covered.filter(|_| covered > 0.0);
        Self {
            balance,
            least_db: over_covered.map_or(f64::NEG_INFINITY, |db| db - 10.0 * covered.log10()),
            running: None,
            sum: 0.0,
            factor: 1.0,
            ssim: (0.0, 1.0),
            steps: 0,
            given: 0.0,
            raised: 0.0,
        }
    }

    /// Takes in that held-out views lack so many dB of what they must have, or have more where that is negative. A mark
    /// that was held weaker reads better than one that is made weaker afterwards.
    pub fn held_out(&mut self, lacking_db: f64) {
        if self.steps >= RELAXES_AFTER && lacking_db.is_finite() {
            self.raised = (self.raised + RAISE_GAIN * lacking_db).clamp(0.0, MOST_RAISED_DB);
        }
    }

    /// What terms are multiplied by at the next step.
    pub fn factors(&self) -> LossWeightFactors {
        LossWeightFactors {
            reconstruction: self.factor as f32,
            ssim: self.ssim.1 as f32,
        }
    }

    /// Takes in the mean PSNR, bit accuracy and SSIM of a step.
    pub fn update(&mut self, psnr_db: f64, bit_accuracy: f64, ssim: f64) {
        let Some(b) = self.balance else { return };
        // The first steps have nearly identical pictures; a cap keeps them from ruling the mean.
        let most = b.target_psnr_db.max(self.least_db) + 10.0;
        let now = [psnr_db.min(most), bit_accuracy, ssim];
        let before = self.running.unwrap_or(now);
        let running: [f64; 3] = std::array::from_fn(|k| b.memory * before[k] + (1.0 - b.memory) * now[k]);
        self.running = Some(running);
        self.steps += 1;
        let mut given = [0.0; 2];
        if let Some(yielding) = b.yielding {
            if self.steps > RELAXES_AFTER {
                self.given = (self.given + RELAXATION_GAIN * (yielding.below - running[1])).clamp(0.0, 1.0);
            }
            given = [yielding.psnr_db, yielding.ssim].map(|most| most * self.given);
        }
        let mut below = (b.target_psnr_db - given[0]).max(self.least_db) + self.raised - running[0];
        if running[1] >= b.bit_accuracy {
            below = below.max(0.0);
        }
        let limit = b.limit.ln();
        self.sum = (self.sum + b.integral * below).clamp(-limit, limit);
        self.factor = (self.sum + b.proportional * below).clamp(-limit, limit).exp();
        if let Some(target) = b.target_ssim {
            let below = target - given[1] - running[2];
            let least = SSIM_LEAST.ln();
            let sum = (self.ssim.0 + SSIM_INTEGRAL * below).clamp(least, 0.0);
            self.ssim = (sum, (sum + SSIM_PROPORTIONAL * below).clamp(least, 0.0).exp());
        }
    }
}

#[cfg(test)]
mod tests;
