//! What a picture's difference from the original says of each bit, behind all else that may have changed it: least squares.
use rayon::prelude::*;

use crate::extract::linear::solve;

/// Rows that one task sums.
const CHUNK: usize = 4096;
/// Differences beyond this count less, as something that was drawn over the scene (Huber's weights).
const LARGEST: f64 = 0.1;
/// How often these weights are found anew.
const ROUNDS: usize = 2;
/// What is added to the diagonal of a nuisance's squares, of their mean: some may be nothing at all.
const NUISANCE_RIDGE: f64 = 1e-6;
/// The same of bits: those that ask for nearly the same must not cancel. 0.03 to 1 read alike.
const RIDGE: f64 = 0.1;

/// Differences of some numbers of a picture, and what may explain each.
pub(super) struct Observations {
    /// Explanations that say nothing of bits, such as tones and blur; they come first.
    pub nuisances: usize,
    /// Explanations, and the difference behind them.
    pub columns: usize,
    /// `[rows][columns]`.
    pub values: Vec<f32>,
    /// How much each row counts: one over the variance of what can't be explained.
    pub weights: Vec<f32>,
}

/// What the observations of a picture say of bits: the matrix and the right side of their equations, nuisances left out.
pub(super) struct Evidence {
    /// `[bits][bits]`.
    pub matrix: Vec<f64>,
    /// One a bit.
    pub side: Vec<f64>,
}

impl Observations {
    /// What they say of bits; `None` where there is nothing to look at.
    pub fn evidence(mut self) -> Option<Evidence> {
        let (all, nuisances) = (self.columns, self.nuisances);
        let bits = all - 1 - nuisances;
        let weights = self.weights.clone();
        for _ in 0..ROUNDS {
            let sums = self.sums();
            let found = self.explained(&sums, all - 1)?;
            for ((row, weight), most) in self.values.chunks_exact(all).zip(&mut self.weights).zip(&weights) {
                let explained: f64 = row
                    .iter()
                    .zip(&found)
                    .map(|(value, factor)| f64::from(*value) * factor)
                    .sum();
                let left = (f64::from(row[all - 1]) - explained).abs();
                *weight = most * (LARGEST / left.max(LARGEST)) as f32;
            }
        }
        let sums = self.sums();
        let at = |i: usize, j: usize| sums[i.max(j) * all + i.min(j)];
        let behind = |j: usize| self.explained(&sums, j);
        let found = (nuisances..all).map(behind).collect::<Option<Vec<_>>>()?;
        let left = |i: usize, j: usize| {
            let factors = &found[j - nuisances];
            at(i, j)
                - factors
                    .iter()
                    .enumerate()
                    .map(|(k, factor)| at(i, k) * factor)
                    .sum::<f64>()
        };
        // Weights know variances but for a factor, which what is left tells.
        let variance = left(all - 1, all - 1) / self.weights.len() as f64;
        let scale = (variance > 0.0).then(|| 1.0 / variance)?;
        let of_bits = nuisances..all - 1;
        let pairs = of_bits.clone().flat_map(|i| of_bits.clone().map(move |j| (i, j)));
        let matrix: Vec<f64> = pairs.map(|(i, j)| scale * left(i, j)).collect();
        let side: Vec<f64> = of_bits.map(|i| scale * left(i, all - 1)).collect();
        let finite = matrix.len() == bits * bits && matrix.iter().chain(&side).all(|v| v.is_finite());
        finite.then_some(Evidence { matrix, side })
    }

    /// Weighted sums of products of columns, `[columns][columns]`, of which the lower triangle counts. Parts are added in
    /// order, so that they do not depend on the number of threads.
    fn sums(&self) -> Vec<f64> {
        let all = self.columns;
        let rows = self.values.par_chunks(CHUNK * all).zip(self.weights.par_chunks(CHUNK));
        let parts: Vec<Vec<f64>> = rows
            .map(|(values, weights)| {
                let mut sums = vec![0.0; all * all];
                for (row, weight) in values.chunks_exact(all).zip(weights) {
                    for (i, value) in row.iter().enumerate() {
                        let weighted = f64::from(weight * value);
                        let sums = &mut sums[i * all..=i * all + i];
                        sums.iter_mut()
                            .zip(row)
                            .for_each(|(sum, value)| *sum += weighted * f64::from(*value));
                    }
                }
                sums
            })
            .collect();
        parts.iter().fold(vec![0.0; all * all], |mut total, part| {
            total.iter_mut().zip(part).for_each(|(total, part)| *total += part);
            total
        })
    }

    /// How much of each nuisance a column has.
    fn explained(&self, sums: &[f64], column: usize) -> Option<Vec<f64>> {
        let (all, nuisances) = (self.columns, self.nuisances);
        let mut a: Vec<f64> = (0..nuisances)
            .flat_map(|i| sums[i * all..][..nuisances].iter().copied())
            .collect();
        let mean = (0..nuisances).map(|i| sums[i * all + i]).sum::<f64>() / nuisances.max(1) as f64;
        (0..nuisances).for_each(|i| a[i * nuisances + i] += NUISANCE_RIDGE * mean);
        let y = (0..nuisances).map(|i| [sums[column * all + i]]).collect();
        Some(solve(a, y, 0.0)?.into_iter().map(|[v]| v).collect())
    }
}

/// How much of each bit's change there is in each picture, by the evidence of all; the sum over pictures is what all say
/// together. Of so many pictures the root mean square of that is their number.
pub(super) fn solved(evidence: &[Evidence]) -> Option<Vec<Vec<f32>>> {
    let bits = evidence.first()?.side.len();
    let mut matrix = vec![0.0; bits * bits];
    for one in evidence {
        matrix
            .iter_mut()
            .zip(&one.matrix)
            .for_each(|(sum, value)| *sum += value);
    }
    let mean = (0..bits).map(|i| matrix[i * bits + i]).sum::<f64>() / bits.max(1) as f64;
    (0..bits).for_each(|i| matrix[i * bits + i] += RIDGE * mean);
    let of_picture = |one: &Evidence| {
        let side = one.side.iter().map(|v| [*v]).collect();
        Some(
            solve(matrix.clone(), side, 0.0)?
                .into_iter()
                .map(|[v]| v)
                .collect::<Vec<f64>>(),
        )
    };
    let found = evidence.iter().map(of_picture).collect::<Option<Vec<_>>>()?;
    let together = (0..bits).map(|bit| found.iter().map(|of_picture| of_picture[bit]).sum::<f64>());
    let size = (together.map(|sum| sum * sum).sum::<f64>() / bits as f64).sqrt() / evidence.len() as f64;
    let scaled = |of_picture: Vec<f64>| of_picture.into_iter().map(|v| (v / size) as f32).collect();
    (size > 0.0 && size.is_finite()).then(|| found.into_iter().map(scaled).collect())
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Rows that a nuisance and two bits explain, half of the first bit being the second's, with noise; some are nonsense.
    fn observed(factors: [f32; 3], noise: f32, nonsense: usize) -> Observations {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut uniform = || random.random_range(-1.0_f32..1.0);
        let mut values = Vec::new();
        for row in 0..20_000 {
            let (tone, first, second) = (uniform(), uniform(), uniform());
            let explanations = [tone, first + 0.5 * second + 0.3 * tone, second];
            let explained: f32 = explanations
                .iter()
                .zip(factors)
                .map(|(value, factor)| value * factor)
                .sum();
            let difference = if row < nonsense {
                0.9
            } else {
                explained + noise * uniform()
            };
            values.extend(explanations);
            values.push(difference);
        }
        Observations {
            nuisances: 1,
            columns: 4,
            values,
            weights: vec![1.0; 20_000],
        }
    }

    #[test]
    fn what_bits_ask_for_is_found_behind_tones_noise_and_nonsense() {
        let of_pictures = [
            observed([0.05, 0.002, -0.004], 0.02, 20),
            observed([-0.2, 0.002, -0.004], 0.08, 0),
        ];
        let evidence: Vec<_> = of_pictures.into_iter().map(|one| one.evidence().unwrap()).collect();
        let found = solved(&evidence).unwrap();
        let together = [0, 1].map(|bit| found[0][bit] + found[1][bit]);
        assert!((together[1] / together[0] + 2.0).abs() < 0.35, "{together:?}");
        // Two pictures: a root mean square of two.
        let square = together.iter().map(|v| v * v).sum::<f32>() / 2.0;
        assert!((square - 4.0).abs() < 1e-3, "{square}");
        // The picture with a quarter of the noise says most of it.
        assert!(found[0][1].abs() > 5.0 * found[1][1].abs(), "{found:?}");
    }

    #[test]
    fn nothing_to_look_at_says_nothing() {
        let none = Observations {
            nuisances: 1,
            columns: 4,
            values: Vec::new(),
            weights: Vec::new(),
        };
        assert!(none.evidence().is_none());
        assert_eq!(solved(&[]), None);
        let mut alike = observed([0.0; 3], 0.0, 0);
        alike.values.chunks_exact_mut(4).for_each(|row| row[3] = 0.0);
        assert!(alike.evidence().is_none());
    }
}
