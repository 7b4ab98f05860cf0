//! Sample pair analysis: how pairs of neighbours move between the sets of their differences.
//!
//! Dumitrescu, Wu, Wang, "Detection of LSB steganography via sample pair analysis", IEEE Transactions on Signal
//! Processing 51 (2003). All horizontal and all vertical neighbours are pairs.
//!
//! `D_n` are the pairs that differ by `n`; `C_m` those whose values differ by `m` once the last bits are cut off. Of the
//! pairs of odd difference `n`, `X_n` have the even value as the larger one and `Y_n` the odd one. In a picture without
//! a message, the expectations of `|X_n|` and `|Y_n|` are equal.
use super::channel::{Channel, mean_over_channels};
use super::detector::NoResult;
use super::quadratic::smaller_root;
use image::RgbImage;

/// The paper's `j`: differences up to `2 j + 1` are used.
const LAST: usize = 30;

/// Estimated share of samples that carry a bit, mean over the channels, in `[0, 1]`.
pub(super) fn estimate(picture: &RgbImage) -> Result<f64, NoResult> {
    mean_over_channels(picture, rate)
}

/// Counts of pairs by difference.
struct Pairs {
    /// `|D_n|`
    by_difference: [u64; 256],
    /// `|C_m|`
    by_trace: [u64; 128],
    /// `|Y_n| - |X_n|` of odd `n`, summed over those up to `2 j + 1`.
    odd_minus_even: i64,
    total: u64,
}

impl Pairs {
    fn add(&mut self, u: u8, v: u8) {
        let difference = usize::from(u.abs_diff(v));
        self.by_difference[difference] += 1;
        self.by_trace[usize::from((u >> 1).abs_diff(v >> 1))] += 1;
        self.total += 1;
        if difference % 2 == 1 && difference <= 2 * LAST + 1 {
            self.odd_minus_even += if u.max(v) % 2 == 1 { 1 } else { -1 };
        }
    }
}

/// The sum of the paper's equations for `m` = 0 to `j`, which telescopes. With `S = Σ (|Y_2m+1| - |X_2m+1|)`:
/// `(2|C_0| - |C_j+1|)/4 · p² - (2|D_0| - |D_2j+2| + 2S)/2 · p + S = 0`, of which the smaller root is the rate.
fn rate(channel: &Channel) -> Result<f64, NoResult> {
    let mut pairs = Pairs {
        by_difference: [0; 256],
        by_trace: [0; 128],
        odd_minus_even: 0,
        total: 0,
    };
    for row in channel.rows() {
        for (u, v) in row.iter().zip(row.iter().skip(1)) {
            pairs.add(*u, *v);
        }
    }
    for (above, below) in channel.neighbouring_rows() {
        for (u, v) in above.iter().zip(below) {
            pairs.add(*u, *v);
        }
    }
    if pairs.total == 0 {
        return Err(NoResult::TooSmall);
    }
    let trace = |m: usize| pairs.by_trace[m] as f64;
    let difference = |n: usize| pairs.by_difference[n] as f64;
    let sum = pairs.odd_minus_even as f64;
    smaller_root(
        (2.0 * trace(0) - trace(LAST + 1)) / 4.0,
        -(2.0 * difference(0) - difference(2 * LAST + 2) + 2.0 * sum) / 2.0,
        sum,
    )
}
