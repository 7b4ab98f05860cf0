//! How common each colour is in a picture: what explains a rare one says more.
use super::observed::Observed;

/// Steps of a channel. Finer ones would be empty in a picture of a thousand pixels.
const BINS: usize = 8;
/// Weights of a step's neighbours and of itself.
const SMOOTH: [f32; 3] = [0.25, 0.5, 0.25];
/// Pixels that every step has besides.
const FLOOR: f32 = 0.01;

/// The logarithm of how dense a picture's colours are at the colour of each of its pixels; 0 were all alike common.
pub(super) fn log_densities(observed: &Observed) -> Vec<f32> {
    let bin = |v: f32| ((v.clamp(0.0, 1.0) * BINS as f32) as usize).min(BINS - 1);
    let place = |pixel: &[f32; 3]| pixel.iter().fold(0, |place, v| place * BINS + bin(*v));
    let mut counts = vec![0.0_f32; BINS.pow(3)];
    for pixel in &observed.pixels {
        counts[place(pixel)] += 1.0;
    }
    for stride in [1, BINS, BINS * BINS] {
        counts = smoothed(&counts, stride);
    }
    let all: f32 = counts.iter().map(|count| count + FLOOR).sum();
    let densities = counts
        .iter()
        .map(|count| ((count + FLOOR) / all * counts.len() as f32).ln());
    let densities: Vec<f32> = densities.collect();
    observed.pixels.iter().map(|pixel| densities[place(pixel)]).collect()
}

/// Counts shared with the next steps of the channel whose steps are `stride` apart; the last ones keep what they would give away.
fn smoothed(counts: &[f32], stride: usize) -> Vec<f32> {
    let at = |place: usize, offset: usize| {
        let step = (place / stride % BINS + offset).clamp(1, BINS) - 1;
        counts[place - place / stride % BINS * stride + step * stride]
    };
    let mean = |place: usize| (0..3).map(|offset| SMOOTH[offset] * at(place, offset)).sum();
    (0..counts.len()).map(mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::Picture;

    #[test]
    fn rare_colours_are_less_dense_and_their_neighbours_more_than_those_of_nobody() {
        let mut pixels = vec![[0.2, 0.5, 0.8]; 24];
        pixels.extend([[0.9, 0.1, 0.1], [0.2, 0.5, 0.95], [0.2, 0.5, 0.8]]);
        let (width, height) = (9, 3);
        let picture = Picture {
            width,
            height,
            pixels: pixels.as_flattened().to_vec(),
        };
        let densities = log_densities(&Observed::of(&picture, 9).unwrap());
        let [common, rare, beside] = [densities[0], densities[24], densities[25]];
        assert!(common > beside && beside > rare, "{common} {beside} {rare}");
        // 25 of 27 pixels in a step, of which an eighth stays there, and all steps have something.
        let expected = (25.0 / 8.0 + 1.0 / 16.0) / (27.0 + 512.0 * FLOOR) * 512.0;
        assert!(
            (common - f32::ln(expected)).abs() < 0.01,
            "{common} {}",
            f32::ln(expected)
        );
    }

    #[test]
    fn counts_are_shared_and_none_is_lost() {
        let mut counts = vec![0.0; BINS.pow(3)];
        (counts[0], counts[77], counts[511]) = (8.0, 8.0, 8.0);
        for stride in [1, BINS, BINS * BINS] {
            counts = smoothed(&counts, stride);
        }
        assert!((counts.iter().sum::<f32>() - 24.0).abs() < 1e-4);
        assert!((counts[77] - 1.0).abs() < 1e-5 && counts[0] > 3.0);
    }
}
