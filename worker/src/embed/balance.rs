//! Holds a PSNR: one factor on the reconstruction terms, large while pictures are too far off, small while there is room
//! and bits are still wrong.
//!
//! After every step the mean PSNR and bit accuracy of its views enter exponential running means. With e the dB that the
//! running PSNR is below the target, the factor is `exp(proportional * e + integral * sum of e)`, within `1 / limit` and
//! `limit`; the sum is kept within them too, so that nothing builds up which then takes as long to go. Room above the
//! target counts only while the accuracy is below `bit_accuracy`. PSNR follows the factor some twenty steps late: an
//! integral alone overshoots by 1 to 2 dB. Adam does not mind the overall scale of a loss, so this is a dial between
//! seeing and reading.
use serde::{Deserialize, Serialize};

use super::settings::within;
use crate::error::Result;

/// How the factor is controlled.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Balance {
    /// PSNR to hold on training views, dB.
    pub target_psnr_db: f64,
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
}

impl Default for Balance {
    fn default() -> Self {
        Self {
            target_psnr_db: 36.0,
            bit_accuracy: 0.999,
            proportional: 2.0,
            integral: 0.05,
            limit: 100.0,
            memory: 0.8,
        }
    }
}

impl Balance {
    pub(super) fn check(&self) -> Result<()> {
        within("balance.target_psnr_db", self.target_psnr_db, 0.0, 200.0)?;
        within("balance.proportional", self.proportional, 0.0, 100.0)?;
        within("balance.integral", self.integral, 0.0, 100.0)?;
        within("balance.limit", self.limit, 1.0, 1e6)?;
        within("balance.memory", self.memory, 0.0, 0.9999)
    }
}

/// The factor and what it follows.
#[derive(Clone, Debug)]
pub struct Balancer {
    balance: Option<Balance>,
    running: Option<[f64; 2]>,
    /// `integral * sum of e`.
    sum: f64,
    factor: f64,
}

impl Balancer {
    /// Starts at 1, and stays there without a `balance`.
    pub fn new(balance: Option<Balance>) -> Self {
        Self {
            balance,
            running: None,
            sum: 0.0,
            factor: 1.0,
        }
    }

    /// What the reconstruction terms are multiplied by.
    pub fn factor(&self) -> f32 {
        self.factor as f32
    }

    /// Takes in the mean PSNR and bit accuracy of a step.
    pub fn update(&mut self, psnr_db: f64, bit_accuracy: f64) {
        let Some(b) = self.balance else { return };
        // The first steps have nearly identical pictures; a cap keeps them from ruling the mean.
        let now = [psnr_db.min(b.target_psnr_db + 10.0), bit_accuracy];
        let before = self.running.unwrap_or(now);
        let running: [f64; 2] = std::array::from_fn(|k| b.memory * before[k] + (1.0 - b.memory) * now[k]);
        self.running = Some(running);
        let mut below = b.target_psnr_db - running[0];
        if running[1] >= b.bit_accuracy {
            below = below.max(0.0);
        }
        let limit = b.limit.ln();
        self.sum = (self.sum + b.integral * below).clamp(-limit, limit);
        self.factor = (self.sum + b.proportional * below).clamp(-limit, limit).exp();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn balancer(proportional: f64, integral: f64) -> Balancer {
        Balancer::new(Some(Balance {
            proportional,
            integral,
            limit: 8.0,
            memory: 0.0,
            ..Balance::default()
        }))
    }

    fn factors(mut b: Balancer, psnr_and_bits: &[(f64, f64)]) -> Vec<f64> {
        let follow = |(psnr, bits): &(f64, f64)| {
            b.update(*psnr, *bits);
            f64::from(b.factor()).ln()
        };
        psnr_and_bits.iter().map(follow).collect()
    }

    fn close(found: &[f64], expected: &[f64]) {
        let gap = found
            .iter()
            .zip(expected)
            .map(|(f, e)| (f - e).abs())
            .fold(0.0, f64::max);
        assert!(gap < 1e-6, "{found:?} {expected:?}");
    }

    #[test]
    fn follows_the_error_and_its_sum() {
        let seen = [(35.0, 1.0), (36.0, 0.5), (37.5, 0.5), (37.0, 1.0)];
        // Room is not used once all bits are right.
        close(&factors(balancer(0.5, 0.0), &seen), &[0.5, 0.0, -0.75, 0.0]);
        close(&factors(balancer(0.0, 0.5), &seen), &[0.5, 0.5, -0.25, -0.25]);
        close(&factors(balancer(0.5, 0.5), &seen), &[1.0, 0.5, -1.0, -0.25]);
    }

    #[test]
    fn stays_within_its_limits_and_comes_back_at_once() {
        let limit = 8.0_f64.ln();
        close(
            &factors(balancer(0.0, 1.0), &[(0.0, 0.5), (37.0, 0.5)]),
            &[limit, limit - 1.0],
        );
        close(&factors(balancer(1.0, 1.0), &[(f64::INFINITY, 0.5)]), &[-limit]);
    }

    #[test]
    fn without_a_target_nothing_changes_and_means_run() {
        let mut none = Balancer::new(None);
        none.update(10.0, 0.5);
        assert_eq!(none.factor(), 1.0);
        let mut slow = Balancer::new(Some(Balance::default()));
        slow.update(40.0, 0.5);
        slow.update(30.0, 0.5); // the mean is 38
        assert!(slow.factor() < 1.0);
    }
}
