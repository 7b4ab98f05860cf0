//! RS analysis: how much smoother groups of pixels get when least significant bits are flipped.
//!
//! Fridrich, Goljan, Du, "Reliable detection of LSB steganography in color and grayscale images", ACM Workshop on
//! Multimedia and Security 2001. As StegExpose does, groups are squares of 2 by 2 pixels with the mask of one diagonal
//! and that of the other, once disjoint and once overlapping, and the two estimates are averaged.
use super::channel::{Channel, mean_over_channels};
use super::detector::NoResult;
use super::quadratic::smaller_root;
use image::RgbImage;

/// Estimated share of samples that carry a bit, mean over the channels, in `[0, 1]`.
pub(super) fn estimate(picture: &RgbImage) -> Result<f64, NoResult> {
    mean_over_channels(picture, |channel| {
        let disjoint = rate(channel, 2)?;
        let overlapping = rate(channel, 1)?;
        Ok(f64::midpoint(disjoint, overlapping))
    })
}

/// Regular minus singular groups, under a mask and under its negative.
#[derive(Default)]
struct Balance {
    positive: f64,
    negative: f64,
}

/// The paper's equation, from the groups of every `step`th row and column.
///
/// With `d0 = R_M - S_M` and `d-0 = R_-M - S_-M` of the picture, `d1` and `d-1` the same after all bits are flipped, `x`
/// is a root of `a x² + b x + c = 0`, `a = 2(d1 + d0)`, `b = d-0 - d-1 - d1 - 3 d0`, `c = d0 - d-0`, and the rate is
/// `p = x / (x - 1/2)`. At full embedding `x` is infinite, so here the equation is that of `p`,
/// `(a/4 + b/2 + c) p² - (b/2 + 2c) p + c = 0`, and its smaller root is taken instead of the smaller `x`.
fn rate(channel: &Channel, step: usize) -> Result<f64, NoResult> {
    let (mut plain, mut flipped) = (Balance::default(), Balance::default());
    let mut groups = 0_usize;
    for (above, below) in channel.neighbouring_rows().step_by(step) {
        for (above, below) in above.windows(2).zip(below.windows(2)).step_by(step) {
            if let ([a, b], [c, d]) = (above, below) {
                // Around the square, so that neighbours in the array are neighbours in the picture.
                let square = [*a, *b, *d, *c].map(i32::from);
                add(&mut plain, square);
                add(&mut flipped, square.map(flip));
                groups += 1;
            }
        }
    }
    if groups == 0 {
        return Err(NoResult::TooSmall);
    }
    let (d0, d0_negative) = (plain.positive, plain.negative);
    let (d1, d1_negative) = (flipped.positive, flipped.negative);
    let a = 2.0 * (d1 + d0);
    let b = d0_negative - d1_negative - d1 - 3.0 * d0;
    let c = d0 - d0_negative;
    smaller_root(a / 4.0 + b / 2.0 + c, -(b / 2.0 + 2.0 * c), c)
}

/// Counts a group under both masks: regular where flipping makes it rougher, singular where smoother.
fn add(balance: &mut Balance, square: [i32; 4]) {
    let before = roughness(square);
    let [a, b, d, c] = square;
    let sign = |after: [i32; 4]| f64::from((roughness(after) - before).signum());
    balance.positive += sign([flip(a), b, flip(d), c]) + sign([a, flip(b), d, flip(c)]);
    balance.negative += sign([shifted(a), b, shifted(d), c]) + sign([a, shifted(b), d, shifted(c)]);
}

/// The paper's discrimination function: sum of differences of neighbours, around the square.
fn roughness([a, b, d, c]: [i32; 4]) -> i32 {
    (a - b).abs() + (b - d).abs() + (d - c).abs() + (c - a).abs()
}

/// `F1`: 0 and 1, 2 and 3, ... 254 and 255 change places.
fn flip(value: i32) -> i32 {
    value ^ 1
}

/// `F-1`: -1 and 0, 1 and 2, ... 255 and 256 change places.
fn shifted(value: i32) -> i32 {
    flip(value + 1) - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flips_are_those_of_the_paper() {
        assert_eq!([0, 1, 254, 255].map(flip), [1, 0, 255, 254]);
        assert_eq!([-1, 0, 1, 2, 255, 256].map(shifted), [0, -1, 2, 1, 256, 255]);
    }

    /// A group by hand: 4 5 / 4 4 around the square is 4, 5, 4, 4.
    #[test]
    fn regular_and_singular() {
        let mut balance = Balance::default();
        add(&mut balance, [4, 5, 4, 4]);
        // Roughness 2. F1 on the first diagonal: 5 5 5 4 has 2, so neither; on the other: 4 4 4 5 has 2.
        assert_eq!(balance.positive, 0.0);
        // F-1: 3 5 3 4 has 6, regular; 4 6 4 3 has 6, regular.
        assert_eq!(balance.negative, 2.0);
    }
}
