//! The chi-square attack: values that differ in the last bit only occur equally often once bits are replaced.
//!
//! Westfeld, Pfitzmann, "Attacks on steganographic systems", Information Hiding 1999. As StegExpose does, the samples
//! are taken in the order of the file, red, green and blue in turn, and the mean is over the beginnings of 1024, 2048, ...
//! samples. The attack is made for messages that fill a picture from its first pixel; few scattered bits escape it.
use super::detector::NoResult;
use image::RgbImage;
use statrs::function::gamma::checked_gamma_ur;

/// Samples by which the beginnings grow.
const BLOCK: usize = 1024;
/// The paper leaves out categories with an expectation up to this.
const RARE: f64 = 4.0;

/// Mean probability of embedding over the beginnings that have one, in `[0, 1]`. A picture of fewer samples than a
/// block is one beginning; what is left after the last block counts in none, as in StegExpose.
pub(super) fn probability(picture: &RgbImage) -> Result<f64, NoResult> {
    let samples = picture.as_raw();
    let mut counts = [0_u64; 256];
    let (mut sum, mut valid) = (0.0, 0_u64);
    for block in samples.chunks(BLOCK) {
        if block.len() < BLOCK && samples.len() > BLOCK {
            break;
        }
        for sample in block {
            counts[usize::from(*sample)] += 1;
        }
        if let Some(probability) = of_counts(&counts) {
            sum += probability;
            valid += 1;
        }
    }
    if valid == 0 {
        return Err(NoResult::TooSmall);
    }
    Ok((sum / valid as f64).clamp(0.0, 1.0))
}

/// With `n_i` the count of the even value of pair `i` and `n*_i` the mean of both, `χ² = Σ (n_i - n*_i)² / n*_i` over
/// the `k` pairs that are not rare; the probability is 1 minus the chi-square distribution of `k - 1` degrees of freedom.
/// `None` with fewer than two such pairs.
fn of_counts(counts: &[u64; 256]) -> Option<f64> {
    let (mut statistic, mut pairs) = (0.0, 0_u32);
    for pair in counts.as_chunks::<2>().0 {
        let [even, odd] = pair.map(|count| count as f64);
        let expected = f64::midpoint(even, odd);
        if expected > RARE {
            statistic += (even - expected) * (even - expected) / expected;
            pairs += 1;
        }
    }
    if pairs < 2 {
        return None;
    }
    if statistic == 0.0 {
        return Some(1.0);
    }
    checked_gamma_ur(f64::from(pairs - 1) / 2.0, statistic / 2.0).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_hand() {
        let mut counts = [0; 256];
        counts[0..6].copy_from_slice(&[12, 8, 5, 15, 20, 20]);
        // (12-10)²/10 + (5-10)²/10 + 0 = 2.9 with two degrees of freedom: exp(-1.45).
        assert!((of_counts(&counts).unwrap() - (-1.45_f64).exp()).abs() < 1e-12);
        // Rare ones change nothing.
        counts[6..8].copy_from_slice(&[7, 1]);
        assert!((of_counts(&counts).unwrap() - (-1.45_f64).exp()).abs() < 1e-12);
        counts[8..10].copy_from_slice(&[9, 0]);
        // 2.9 + 4.5²/4.5 with three.
        assert!((of_counts(&counts).unwrap() - 0.060_090_6).abs() < 1e-4);
    }

    #[test]
    fn one_pair_says_nothing() {
        let mut counts = [0; 256];
        counts[254..].copy_from_slice(&[0, 5000]);
        assert_eq!(of_counts(&counts), None);
    }
}
