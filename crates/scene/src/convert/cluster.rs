//! Codebooks of SOG: the 256 numbers that stand best for many.
//!
//! Optimal in one dimension up to the width of a bin, by dynamic programming over a histogram as splat-transform has
//! it: bins of equal width and of equal counts blended, and a bin weighs as much as the root of its count, so that
//! rare values at the ends get numbers too. Up to 256 different values are their own codebook, so that a scene from a
//! SOG keeps its numbers.

/// Numbers of a codebook.
const MOST: usize = 256;
/// Bins of the histogram.
const BINS: usize = 1024;
/// How far below the least finite value the number is that stands for minus infinity: as a log scale a factor of 2e-9.
const BELOW: f32 = 20.0;

/// Up to 256 numbers, ascending, for values that are finite or minus infinity; at least one.
pub(crate) fn codebook(values: impl Iterator<Item = f32>) -> Vec<f32> {
    let mut flat = false;
    // Adding 0 makes the negative one positive.
    let mut finite: Vec<f32> = values
        .filter(|v| {
            flat |= !v.is_finite();
            v.is_finite()
        })
        .map(|v| v + 0.0)
        .collect();
    finite.sort_unstable_by(f32::total_cmp);
    let least = finite.first().copied().unwrap_or(0.0);
    let room = MOST - usize::from(flat);
    let mut numbers = finite.clone();
    numbers.dedup();
    if numbers.len() > room {
        numbers = Histogram::of(&finite).best(room);
    }
    if flat || numbers.is_empty() {
        numbers.insert(0, if flat { (least - BELOW).max(f32::MIN) } else { 0.0 });
    }
    numbers
}

/// Sums over the bins that have values.
struct Histogram {
    /// What means are relative to, the least value: squares keep their digits.
    least: f64,
    /// Of the bins before each: weights, weights times means, weights times squared means. One more than bins.
    sums: Vec<[f64; 3]>,
}

impl Histogram {
    /// The histogram of ascending values, at least two of which differ.
    fn of(sorted: &[f32]) -> Histogram {
        let n = sorted.len();
        let at = |i: usize| f64::from(sorted[i]);
        let (least, range) = (at(0), at(n - 1) - at(0));
        let bins = BINS.min(n);
        // Where the middle half of the values is narrow beside the range, bins are of equal counts rather.
        let middle = at(n * 3 / 4) - at(n / 4);
        let blend = (1.0 - middle / range).clamp(0.5, 0.999);
        let mut counted = vec![(0.0f64, 0.0); bins];
        for i in 0..n {
            let above = at(i) - least;
            let place = blend * (i as f64 / n as f64) + (1.0 - blend) * (above / range);
            let (count, sum) = &mut counted[((bins as f64 * place) as usize).min(bins - 1)];
            *count += 1.0;
            *sum += above;
        }
        let mut sums = vec![[0.0; 3]];
        let mut last = [0.0; 3];
        for (count, sum) in counted.into_iter().filter(|(count, _)| *count > 0.0) {
            let (weight, mean) = (count.sqrt(), sum / count);
            for (sum, term) in last.iter_mut().zip([weight, weight * mean, weight * mean * mean]) {
                *sum += term;
            }
            sums.push(last);
        }
        Histogram { least, sums }
    }

    fn bins(&self) -> usize {
        self.sums.len() - 1
    }

    /// Weight, and weighted sums of means and their squares, of bins `first..end`.
    fn over(&self, first: usize, end: usize) -> [f64; 3] {
        std::array::from_fn(|i| self.sums[end][i] - self.sums[first][i])
    }

    /// Sum of the weighted squared distances of bins `first..end` from their mean.
    fn cost(&self, first: usize, end: usize) -> f64 {
        let [weight, sum, squares] = self.over(first, end);
        squares - sum * sum / weight
    }

    /// The means of the `most` groups of neighbouring bins with the least cost.
    fn best(&self, most: usize) -> Vec<f32> {
        let bins = self.bins();
        let groups = most.min(bins);
        // Entry `end` is the least cost of bins `..end` in as many groups as the layer has.
        let mut costs: Vec<f64> = (0..=bins)
            .map(|end| if end == 0 { 0.0 } else { self.cost(0, end) })
            .collect();
        // For each further layer and end, where its last group starts.
        let mut starts: Vec<Vec<usize>> = Vec::new();
        for layer in 2..=groups {
            let mut next = vec![f64::INFINITY; bins + 1];
            let mut first = vec![0; bins + 1];
            // The best start never moves back as the end moves on: halves, each within the bounds of its neighbours.
            let mut spans = vec![(layer, bins, layer - 1, bins - 1)];
            while let Some((low, high, least, most)) = spans.pop() {
                let end = low.midpoint(high);
                let mut best = (f64::INFINITY, least);
                for start in least..=most.min(end - 1) {
                    let cost = costs[start] + self.cost(start, end);
                    if cost < best.0 {
                        best = (cost, start);
                    }
                }
                (next[end], first[end]) = best;
                if low < end {
                    spans.push((low, end - 1, least, best.1));
                }
                if end < high {
                    spans.push((end + 1, high, best.1, most));
                }
            }
            costs = next;
            starts.push(first);
        }
        let mut numbers = Vec::with_capacity(groups);
        let mut end = bins;
        for layer in (1..=groups).rev() {
            let start = if layer == 1 { 0 } else { starts[layer - 2][end] };
            let [weight, sum, _] = self.over(start, end);
            numbers.push((self.least + sum / weight) as f32);
            end = start;
        }
        numbers.reverse();
        numbers
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn few_values_are_their_own_codebook() {
        assert_eq!(codebook([2.0, -1.0, 2.0, -0.0, 0.0].into_iter()), [-1.0, 0.0, 2.0]);
        let many: Vec<f32> = (0..256).map(|i| (i as f32).sin()).collect();
        let mut sorted = many.clone();
        sorted.sort_by(f32::total_cmp);
        assert_eq!(codebook(many.into_iter()), sorted);
        assert_eq!(codebook(std::iter::empty()), [0.0]);
    }

    #[test]
    fn minus_infinity_has_a_number_of_its_own() {
        let flat = f32::NEG_INFINITY;
        assert_eq!(codebook([flat, 3.0, 5.0].into_iter()), [-17.0, 3.0, 5.0]);
        assert_eq!(codebook([flat, flat].into_iter()), [-20.0]);
        let many = (0..5000).map(|i| i as f32 * 0.01).chain([flat]);
        let numbers = codebook(many);
        assert_eq!((numbers.len(), numbers[0]), (256, -20.0));
        assert!(numbers[1] >= 0.0);
    }

    /// Against all ways to group few bins.
    #[test]
    fn groups_are_the_best() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..50 {
            let mut values: Vec<f32> = (0..12).map(|_| random.random_range(-3.0..3.0f32).powi(3)).collect();
            values.sort_by(f32::total_cmp);
            let histogram = Histogram::of(&values);
            let bins = histogram.bins();
            let groups = 4.min(bins);
            let mut least = f64::INFINITY;
            // Bits say after which bins a group ends.
            for ends in 0u32..1 << (bins - 1) {
                if ends.count_ones() as usize != groups - 1 {
                    continue;
                }
                let mut cuts: Vec<usize> = (0..bins - 1).filter(|i| ends >> i & 1 == 1).map(|i| i + 1).collect();
                cuts.insert(0, 0);
                cuts.push(bins);
                least = least.min(cuts.windows(2).map(|cut| histogram.cost(cut[0], cut[1])).sum());
            }
            let numbers = histogram.best(groups);
            assert_eq!(numbers.len(), groups);
            let cost: f64 = (0..bins)
                .map(|bin| {
                    let [weight, sum, _] = histogram.over(bin, bin + 1);
                    let mean = histogram.least + sum / weight;
                    let nearest = numbers
                        .iter()
                        .map(|v| (f64::from(*v) - mean).powi(2))
                        .fold(f64::INFINITY, f64::min);
                    weight * nearest
                })
                .sum();
            assert!(cost <= least * (1.0 + 1e-5) + 1e-9, "{cost} {least}");
        }
    }

    #[test]
    fn numbers_are_dense_where_values_are() {
        let mut random = ChaCha8Rng::seed_from_u64(2);
        // A narrow heap and far outliers.
        let values: Vec<f32> = (0..20_000)
            .map(|i| {
                if i % 1000 == 0 {
                    random.random_range(-50.0..50.0)
                } else {
                    random.random_range(-1.0..1.0)
                }
            })
            .collect();
        let numbers = codebook(values.iter().copied());
        assert_eq!(numbers.len(), 256);
        assert!(numbers.is_sorted());
        let error = |v: &f32| numbers.iter().map(|n| (n - v).abs()).fold(f32::INFINITY, f32::min);
        let dense = values.iter().filter(|v| v.abs() < 0.9).map(error).fold(0.0, f32::max);
        assert!(dense < 0.02, "{dense}; 256 even steps of the range would leave 0.2");
    }
}
