//! What a marked scene must reach to be handed out, by the length of its message.
//!
//! A message of up to 32 bits is compared bit by bit by whoever gave it, so all of it must be read. Longer ones are the
//! words of assets, or compared with a claim, and a claim wants many bits and not all of them: so many must match in the
//! mean picture, and in the scene as a claim renders it, that no chance explains them in whatever framing they are read.
//! Whether the code of words reads its payload as well (up to 5 bits of 64 wrong) decides nothing: no claim rests on it.
use guardsplat_codeword::chance;
use serde::{Deserialize, Serialize};

use super::verify::Verification;

/// Messages up to here must be right to the last bit.
const SHORT: usize = 32;
/// What a claim is decided at, and the framings of a picture that it pays for ([`crate::extract::framings`]).
const RATE: f64 = 1e-6;
const FRAMINGS: u64 = 178;

/// A mark that is this much too strong at most is made weaker, dB.
const WEAKENED_DB: f64 = 1.0;
/// And by so much more than is missing: 8-bit pictures do not follow a factor exactly.
const SPARE_DB: f64 = 0.03;

/// What a marked scene must reach to be written.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// Mean bit accuracy on held-out views; beyond 32 bits no more than what a claim about a picture needs.
    pub bit_accuracy: f64,
    /// Mean PSNR on held-out views, dB.
    pub psnr_db: f64,
    /// Whether the message must be read: up to 32 bits all of it, from [`Verify::message_views`](super::Verify::message_views)
    /// views; beyond, as much as a claim about a picture needs, from all views.
    pub message: bool,
}

impl Target {
    /// What is wanted of a message of so many bits.
    fn accuracy(&self, bits: usize) -> f64 {
        let enough = needed(bits) as f64 / bits.max(1) as f64;
        match bits {
            ..=SHORT => self.bit_accuracy,
            _ => self.bit_accuracy.min(enough),
        }
    }

    /// What a mark's changes are to be multiplied by where held-out views show it a little more than they may: they are other
    /// views than those whose PSNR was held, and a scene is to be handed out that is a hundredth of a dB short. `None` where
    /// they show it as little as they may, or so much more that what is left would hardly be read.
    pub fn weaken(&self, found: &Verification) -> Option<f32> {
        let short = self.psnr_db - found.quality.psnr.psnr_db?;
        // A difference that is smaller by a factor has a PSNR that is higher by twenty times its logarithm.
        (short > 0.0 && short <= WEAKENED_DB).then(|| 10_f64.powf(-(short + SPARE_DB) / 20.0) as f32)
    }

    /// What a verification misses, in words; nothing when all is reached.
    pub fn missed(&self, found: &Verification) -> Vec<String> {
        let mut missed = Vec::new();
        let bits = found.message.len();
        let (accuracy, wanted) = (found.comparison.bit_accuracy, self.accuracy(bits));
        if accuracy < wanted {
            missed.push(format!("bit accuracy {accuracy:.4} is below {wanted:.3}"));
        }
        if let Some(psnr) = found.quality.psnr.psnr_db
            && psnr < self.psnr_db
        {
            missed.push(format!("PSNR {psnr:.2} dB is below {} dB", self.psnr_db));
        }
        let allowed = bits - needed(bits);
        let wrong = if bits <= SHORT {
            found.wrong_bits
        } else {
            found.wrong_bits_of_all
        };
        if self.message && wrong > allowed {
            // How many, and not which: the words of assets are told to nobody.
            missed.push(format!(
                "{wrong} of {bits} bits of the message are wrong, at most {allowed} may be"
            ));
        }
        missed
    }
}

/// Bits of so many that must match: all of a short message, and of others what a claim needs.
fn needed(bits: usize) -> usize {
    let claimed = |bits: usize| chance::least_matches(bits as u32, RATE, FRAMINGS).ok().flatten();
    match bits {
        ..=SHORT => bits,
        _ => claimed(bits).map_or(bits, |needed| needed as usize),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_messages_must_be_right_and_long_ones_claimable() {
        let target = Target {
            bit_accuracy: 0.95,
            psnr_db: 37.5,
            message: true,
        };
        assert_eq!((target.accuracy(32), needed(32)), (0.95, 32));
        assert_eq!((target.accuracy(8), needed(8)), (0.95, 8));
        // 55 of 64 is what a claim about a picture needs (docs/verify.md).
        assert_eq!((target.accuracy(64), needed(64)), (55.0 / 64.0, 55));
        assert!(target.accuracy(128) < target.accuracy(64) && target.accuracy(128) > 0.7);
        // A target that asks for less is not raised.
        let low = Target {
            bit_accuracy: 0.6,
            ..target
        };
        assert_eq!(low.accuracy(64), 0.6);
    }
}
