//! Primary sets: neighbours by whether one is the larger, and which is even.
//!
//! Dumitrescu, Wu, Memon, "On steganalysis of random LSB embedding in continuous-tone images", ICIP 2002. As StegExpose
//! does, pairs are disjoint and horizontal. It takes them of red alone; here all three channels are averaged.
use super::channel::{Channel, mean_over_channels};
use super::detector::NoResult;
use super::quadratic::smaller_root;
use image::RgbImage;

/// Estimated share of samples that carry a bit, mean over the channels, in `[0, 1]`.
pub(super) fn estimate(picture: &RgbImage) -> Result<f64, NoResult> {
    mean_over_channels(picture, rate)
}

/// Of pairs (u, v): in `X`, v is even and larger, or odd and smaller; in `Y`, v is even and smaller, or odd and larger;
/// in `Z` they are equal. `W` are the pairs of `Y` that differ in the last bit only. Without a message `X` and `Y` are
/// of one size, so that the rate is the smaller root of `(|W| + |Z|)/2 · p² + (2|X| - |P|) p + |Y| - |X| = 0`, with `P`
/// all pairs.
fn rate(channel: &Channel) -> Result<f64, NoResult> {
    let (mut x, mut y, mut z, mut w) = (0_u64, 0_u64, 0_u64, 0_u64);
    for row in channel.rows() {
        let firsts = row.iter().step_by(2);
        let seconds = row.iter().skip(1).step_by(2);
        for (u, v) in firsts.zip(seconds) {
            if u == v {
                z += 1;
            } else if (v % 2 == 0) == (u < v) {
                x += 1;
            } else {
                y += 1;
                w += u64::from(u >> 1 == v >> 1);
            }
        }
    }
    let (x, y, z, w) = (x as f64, y as f64, z as f64, w as f64);
    let pairs = x + y + z;
    if pairs == 0.0 {
        return Err(NoResult::TooSmall);
    }
    smaller_root(f64::midpoint(w, z), 2.0 * x - pairs, y - x)
}
