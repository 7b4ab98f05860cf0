//! Holds a PSNR: one factor on the reconstruction terms, raised while pictures are too far off and lowered while there
//! is room and bits are still wrong.
//!
//! After every step the mean PSNR and bit accuracy of its views enter exponential running means. Below the target the
//! factor is multiplied by `rate`; above target and slack, while the accuracy is below `bit_accuracy`, it is divided
//! by it. It stays within `1 / limit` and `limit`. Adam does not mind the overall scale of a loss, so this is a dial
//! between seeing and reading.
use serde::{Deserialize, Serialize};

use super::settings::within;
use crate::error::Result;

/// How the factor is controlled.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Balance {
    /// PSNR to hold on training views, dB.
    pub target_psnr_db: f64,
    /// Room above the target before the factor is lowered, dB.
    pub slack_db: f64,
    /// Training bit accuracy from which on the factor is not lowered any more.
    pub bit_accuracy: f64,
    /// Change of the factor a step.
    pub rate: f64,
    /// Largest factor, and one over the smallest.
    pub limit: f64,
    /// Decay of the running means.
    pub memory: f64,
}

impl Default for Balance {
    fn default() -> Self {
        Self {
            target_psnr_db: 36.0,
            slack_db: 0.3,
            bit_accuracy: 0.999,
            rate: 1.03,
            limit: 100.0,
            memory: 0.9,
        }
    }
}

impl Balance {
    pub(super) fn check(&self) -> Result<()> {
        within("balance.target_psnr_db", self.target_psnr_db, 0.0, 200.0)?;
        within("balance.slack_db", self.slack_db, 0.0, 200.0)?;
        within("balance.rate", self.rate, 1.0, 10.0)?;
        within("balance.limit", self.limit, 1.0, 1e6)?;
        within("balance.memory", self.memory, 0.0, 0.9999)
    }
}

/// The factor and what it follows.
#[derive(Clone, Debug)]
pub struct Balancer {
    balance: Option<Balance>,
    running: Option<[f64; 2]>,
    factor: f64,
}

impl Balancer {
    /// Starts at 1, and stays there without a `balance`.
    pub fn new(balance: Option<Balance>) -> Self {
        Self {
            balance,
            running: None,
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
        if running[0] < b.target_psnr_db {
            self.factor *= b.rate;
        } else if running[0] > b.target_psnr_db + b.slack_db && running[1] < b.bit_accuracy {
            self.factor /= b.rate;
        }
        self.factor = self.factor.clamp(1.0 / b.limit, b.limit);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn balancer() -> Balancer {
        Balancer::new(Some(Balance {
            rate: 2.0,
            limit: 8.0,
            memory: 0.0,
            ..Balance::default()
        }))
    }

    #[test]
    fn follows_psnr_and_bits_within_its_limits() {
        let mut b = balancer();
        b.update(35.0, 1.0);
        assert_eq!(b.factor(), 2.0);
        b.update(36.1, 0.5);
        assert_eq!(b.factor(), 2.0, "within the slack");
        b.update(40.0, 1.0);
        assert_eq!(b.factor(), 2.0, "all bits are right");
        b.update(40.0, 0.9);
        assert_eq!(b.factor(), 1.0);
        (0..9).for_each(|_| b.update(0.0, 0.5));
        assert_eq!(b.factor(), 8.0);
        (0..9).for_each(|_| b.update(f64::INFINITY, 0.5));
        assert_eq!(b.factor(), 0.125);
    }

    #[test]
    fn without_a_target_nothing_changes_and_means_run() {
        let mut none = Balancer::new(None);
        none.update(10.0, 0.5);
        assert_eq!(none.factor(), 1.0);
        let mut slow = Balancer::new(Some(Balance::default()));
        slow.update(40.0, 0.5);
        let lowered = slow.factor();
        slow.update(30.0, 0.5); // the mean is 39
        assert!(slow.factor() < lowered);
    }
}
