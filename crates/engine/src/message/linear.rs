//! A linear decoder in closed form: each bit is read along the direction in which it moves text features.
//!
//! With t the projected text features of random messages (alike in all directions) and s their bits as ±1, the mean of
//! `t s^T` holds a direction a bit. These are made orthogonal by the smallest change there is (symmetric, Löwdin 1950),
//! so that bits can be set one by one. A perceptron trained on the same features bends its borders between texts it has
//! seen; pictures lie elsewhere, and a mark pays for every bend.
use super::decoder::{DecoderWeights, LayerWeights};
use super::eigen;
use super::matrix::product;
use super::samples::Samples;

/// Logits of a natural deviation: of about the size that a perceptron's have, for the same weights of the loss.
const LOGITS: f64 = 8.0;
/// Smallest squared length of a combination of directions that is made as long as all others, against the largest. Texts
/// hardly tell some combinations of bits, pictures do: a mark would need a multiple of the change there. More bits than
/// dimensions have combinations of no length.
const FLOOR: f64 = 1e-9;

/// The decoder for these samples, `None` where they tell nothing apart.
pub(super) fn fit(samples: &Samples) -> Option<DecoderWeights> {
    let (rank, bits) = (samples.rank, samples.bits);
    let mut directions = vec![0.0; rank * bits]; // [rank][bits]
    for (features, targets) in samples
        .features
        .chunks_exact(rank)
        .zip(samples.targets.chunks_exact(bits))
    {
        for (feature, row) in features.iter().zip(directions.chunks_exact_mut(bits)) {
            let pairs = row.iter_mut().zip(targets);
            pairs.for_each(|(d, target)| *d += f64::from(*feature) * f64::from(2.0 * target - 1.0));
        }
    }
    // R (R^T R)^-1/2: orthonormal columns, nearest to those of R.
    let mut gram = vec![0.0; bits * bits];
    for row in directions.chunks_exact(bits) {
        for (gram, x) in gram.chunks_exact_mut(bits).zip(row) {
            gram.iter_mut().zip(row).for_each(|(g, y)| *g += x * y);
        }
    }
    let found = eigen::symmetric(gram, bits)?;
    let floor = found.values[0] * FLOOR;
    if !(floor.is_finite() && floor > 0.0) {
        return None;
    }
    let mut root = vec![0.0; bits * bits];
    for (vector, value) in found.vectors.chunks_exact(bits).zip(&found.values) {
        let factor = LOGITS / value.max(floor).sqrt();
        for (i, row) in root.chunks_exact_mut(bits).enumerate() {
            row.iter_mut()
                .zip(vector)
                .for_each(|(r, v)| *r += factor * vector[i] * v);
        }
    }
    let weight = product(&directions, &root, bits, bits);
    Some(DecoderWeights {
        layers: vec![LayerWeights {
            inputs: rank,
            outputs: bits,
            weight: weight.into_iter().map(|w| w as f32).collect(),
            bias: vec![0.0; bits],
        }],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two bits in three dimensions, their directions at 60 degrees, all messages once.
    fn samples() -> Samples {
        let directions = [[1.0, 0.0, 0.0], [0.5, 0.75_f32.sqrt(), 0.0]];
        let mut samples = Samples {
            features: Vec::new(),
            targets: Vec::new(),
            rank: 3,
            bits: 2,
        };
        for message in 0..4 {
            let bits = [message >> 1 & 1, message & 1].map(|b| b as f32);
            for axis in 0..3 {
                let along = |k: usize| (2.0 * bits[k] - 1.0) * directions[k][axis];
                samples.features.push(along(0) + along(1));
            }
            samples.targets.extend(bits);
        }
        samples
    }

    #[test]
    fn directions_are_orthogonal_of_one_length_and_read_every_message() {
        let samples = samples();
        let decoder = fit(&samples).unwrap();
        decoder.check().unwrap();
        let weight = &decoder.layers[0].weight;
        let dot = |a: usize, b: usize| -> f32 { (0..3).map(|i| weight[2 * i + a] * weight[2 * i + b]).sum() };
        assert!((dot(0, 0) - 64.0).abs() < 1e-3 && (dot(1, 1) - 64.0).abs() < 1e-3 && dot(0, 1).abs() < 1e-3);
        for (features, targets) in samples.features.chunks(3).zip(samples.targets.chunks(2)) {
            for bit in 0..2 {
                let logit: f32 = (0..3).map(|i| features[i] * weight[2 * i + bit]).sum();
                assert_eq!(logit > 0.0, targets[bit] > 0.5);
            }
        }
    }

    #[test]
    fn a_combination_that_texts_hardly_tell_is_read_as_well_as_others() {
        // The second bit hardly moves texts but along the first one's direction.
        let mut samples = samples();
        for (features, targets) in samples.features.chunks_mut(3).zip(samples.targets.chunks(2)) {
            let [first, second] = [targets[0], targets[1]].map(|bit| 2.0 * bit - 1.0);
            features.copy_from_slice(&[first + second, 0.004 * second, 0.0]);
        }
        let decoder = fit(&samples).unwrap();
        let weight = &decoder.layers[0].weight;
        let dot = |a: usize, b: usize| -> f32 { (0..3).map(|i| weight[2 * i + a] * weight[2 * i + b]).sum() };
        assert!((dot(0, 0) - 64.0).abs() < 1e-2 && (dot(1, 1) - 64.0).abs() < 1e-2 && dot(0, 1).abs() < 1e-2);
    }

    #[test]
    fn what_tells_nothing_apart_is_no_decoder() {
        let mut samples = samples();
        samples.features.fill(0.0);
        assert!(fit(&samples).is_none());
        samples.features.fill(f32::NAN);
        assert!(fit(&samples).is_none());
    }
}
