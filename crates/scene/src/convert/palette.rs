//! Palettes of SOG: the rows of harmonics that stand best for those of all Gaussians.
//!
//! k-means from the top down: the group whose rows are farthest from their mean in sum is split in two (by 2-means from
//! the halves along the coefficient that varies most), until there are as many groups as wanted. That takes
//! n log k steps, where rounds of plain k-means take n k: seconds instead of hours for 100,000 rows into 65,536, and
//! there is no random start. The palette's size is splat-transform's: the largest power of two that is not above the
//! number of Gaussians, 65,536 at most.
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Rows of a palette at most: labels have 16 bits.
const MOST: usize = 1 << 16;
/// Rounds of 2-means at most; few are needed from a good start.
const ROUNDS: usize = 6;
/// Partial sums of a product, so that it is done many numbers at once, and in the same order everywhere.
const LANES: usize = 8;

/// Groups of rows.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Groups {
    /// Group of each row.
    pub labels: Vec<u16>,
    /// Mean of each group, as long as a row.
    pub means: Vec<f32>,
    /// Rows of each group, one at least.
    pub counts: Vec<u32>,
}

/// Rows of the palette for so many Gaussians, if they all differ.
pub(crate) fn size(gaussians: usize) -> usize {
    match gaussians.checked_ilog2() {
        Some(bits) => (1 << bits.min(MOST.ilog2())) as usize,
        None => 0,
    }
}

/// Puts rows of `width` numbers into `most` groups, or into as many as there are different rows.
pub(crate) fn groups(rows: &[f32], width: usize, most: usize) -> Groups {
    let n = rows.len() / width;
    let mut splitter = Splitter {
        rows,
        width,
        order: (0..n as u32).collect(),
        side: Vec::new(),
    };
    let mut heap = BinaryHeap::new();
    if n > 0 && most > 0 {
        heap.push(splitter.group(0, n));
    }
    while heap.len() < most.min(MOST) {
        match heap.pop() {
            Some(group) if group.spread > 0.0 => heap.extend(splitter.split(&group)),
            // Nothing in it differs, nor in any other.
            Some(group) => {
                heap.push(group);
                break;
            }
            None => break,
        }
    }
    let mut all = heap.into_vec();
    all.sort_unstable_by_key(|group| group.start);
    let mut found = Groups {
        labels: vec![0; n],
        means: Vec::with_capacity(all.len() * width),
        counts: Vec::with_capacity(all.len()),
    };
    for (label, group) in all.iter().enumerate() {
        for row in &splitter.order[group.start..group.end] {
            found.labels[*row as usize] = label as u16;
        }
        found.means.extend(group.mean.iter().map(|v| *v as f32));
        found.counts.push((group.end - group.start) as u32);
    }
    found
}

/// Rows `order[start..end]`.
struct Group {
    start: usize,
    end: usize,
    mean: Vec<f64>,
    /// The coefficient that varies most.
    widest: usize,
    /// Sum of the squared distances from the mean.
    spread: f64,
}

// The widest first; ties by place, which no two groups share.
impl Ord for Group {
    fn cmp(&self, other: &Group) -> Ordering {
        self.spread
            .total_cmp(&other.spread)
            .then_with(|| other.start.cmp(&self.start))
    }
}

impl PartialOrd for Group {
    fn partial_cmp(&self, other: &Group) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Group {
    fn eq(&self, other: &Group) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Group {}

struct Splitter<'a> {
    rows: &'a [f32],
    width: usize,
    /// All rows, those of a group together.
    order: Vec<u32>,
    /// Whether each row of the group that is being split goes to its second half.
    side: Vec<bool>,
}

impl Splitter<'_> {
    fn row(&self, i: usize) -> &[f32] {
        let start = self.order[i] as usize * self.width;
        &self.rows[start..start + self.width]
    }

    /// What is to be known of the rows at `start..end`, of which there is one at least. Where all are equal the mean
    /// is that row, and the spread 0 exactly.
    fn group(&self, start: usize, end: usize) -> Group {
        let mut mean = vec![0.0; self.width];
        for i in start..end {
            add(&mut mean, self.row(i));
        }
        let count = (end - start) as f64;
        mean.iter_mut().for_each(|v| *v /= count);
        let mut squares = vec![0.0; self.width];
        if end - start > 1 {
            for i in start..end {
                for ((square, value), mean) in squares.iter_mut().zip(self.row(i)).zip(&mean) {
                    let apart = f64::from(*value) - mean;
                    *square += apart * apart;
                }
            }
        }
        let mut widest = 0;
        for place in 1..self.width {
            if squares[place] > squares[widest] {
                widest = place;
            }
        }
        Group {
            start,
            end,
            mean,
            widest,
            spread: squares.iter().sum(),
        }
    }

    /// Two groups, neither of them empty, of one whose rows differ.
    fn split(&mut self, group: &Group) -> [Group; 2] {
        let (start, end) = (group.start, group.end);
        let middle = group.mean[group.widest];
        let mut side = std::mem::take(&mut self.side);
        side.clear();
        side.extend((start..end).map(|i| f64::from(self.row(i)[group.widest]) > middle));
        for _ in 0..ROUNDS {
            if end - start == 2 || !self.round(start, end, &mut side) {
                break;
            }
        }
        // Those of the first half, then those of the second, both in their order.
        let rows = self.order[start..end].iter().zip(&side);
        let (first, second): (Vec<_>, Vec<_>) = rows.map(|(row, side)| (*row, *side)).partition(|(_, side)| !side);
        let cut = start + first.len();
        for (slot, (row, _)) in self.order[start..end].iter_mut().zip(first.into_iter().chain(second)) {
            *slot = row;
        }
        self.side = side;
        [self.group(start, cut), self.group(cut, end)]
    }

    /// A round of 2-means: each row goes to the nearer of the two means. Whether any row changed sides; none does where
    /// one side would be empty.
    fn round(&self, start: usize, end: usize, side: &mut [bool]) -> bool {
        let mut means = [vec![0.0; self.width], vec![0.0; self.width]];
        let mut counts = [0.0; 2];
        for (i, second) in (start..end).zip(&*side) {
            counts[usize::from(*second)] += 1.0;
            add(&mut means[usize::from(*second)], self.row(i));
        }
        for (mean, count) in means.iter_mut().zip(counts) {
            mean.iter_mut().for_each(|v| *v /= count);
        }
        // Nearer to the second mean is beyond the plane in the middle of both.
        let [a, b] = means;
        let normal: Vec<f64> = b.iter().zip(&a).map(|(b, a)| b - a).collect();
        let plane: f64 = normal
            .iter()
            .zip(a.iter().zip(&b))
            .map(|(n, (a, b))| n * (a + b) / 2.0)
            .sum();
        let new: Vec<bool> = (start..end).map(|i| product(&normal, self.row(i)) > plane).collect();
        let seconds = new.iter().filter(|second| **second).count();
        if seconds == 0 || seconds == new.len() || new == *side {
            return false;
        }
        side.copy_from_slice(&new);
        true
    }
}

fn add(sums: &mut [f64], row: &[f32]) {
    for (sum, value) in sums.iter_mut().zip(row) {
        *sum += f64::from(*value);
    }
}

fn product(normal: &[f64], row: &[f32]) -> f64 {
    let mut sums = [0.0; LANES];
    for (normal, row) in normal.chunks(LANES).zip(row.chunks(LANES)) {
        for ((sum, n), v) in sums.iter_mut().zip(normal).zip(row) {
            *sum += n * f64::from(*v);
        }
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn noise(count: usize, seed: u64) -> Vec<f32> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        (0..count).map(|_| random.random_range(-1.0..1.0)).collect()
    }

    #[test]
    fn sizes_are_powers_of_two() {
        let sizes = [0, 1, 2, 3, 700, 1024, 45_624, 65_535, 65_536, 101_407, 9_000_000].map(size);
        assert_eq!(sizes, [0, 1, 2, 2, 512, 1024, 32_768, 32_768, 65_536, 65_536, 65_536]);
    }

    #[test]
    fn different_rows_that_fit_stay_as_they_are() {
        let few = noise(40 * 9, 1);
        // Each row three times, in another order.
        let rows: Vec<f32> = (0..120).flat_map(|i| few[i * 7 % 40 * 9..][..9].to_vec()).collect();
        let found = groups(&rows, 9, 64);
        assert_eq!((found.means.len(), found.counts.clone()), (40 * 9, vec![3; 40]));
        for (row, label) in rows.chunks(9).zip(&found.labels) {
            assert_eq!(row, &found.means[usize::from(*label) * 9..][..9]);
        }
    }

    #[test]
    fn groups_have_their_means_and_all_rows() {
        let rows = noise(700 * 24, 2);
        let found = groups(&rows, 24, 128);
        assert_eq!(found.counts.len(), 128);
        assert_eq!(found, groups(&rows, 24, 128));
        for (label, mean) in found.means.chunks(24).enumerate() {
            let members: Vec<&[f32]> = rows
                .chunks(24)
                .zip(&found.labels)
                .filter(|(_, other)| usize::from(**other) == label)
                .map(|(row, _)| row)
                .collect();
            assert_eq!(members.len(), found.counts[label] as usize);
            for place in 0..24 {
                let expected = members.iter().map(|row| f64::from(row[place])).sum::<f64>() / members.len() as f64;
                assert!((f64::from(mean[place]) - expected).abs() < 1e-6);
            }
        }
    }

    /// Heaps that are apart are found, whatever their sizes.
    #[test]
    fn heaps_are_groups() {
        let centres = noise(16 * 9, 3);
        let shake = noise(2000 * 9, 4);
        let heap = |i: usize| (i * i) % 16;
        let rows: Vec<f32> = (0..2000 * 9)
            .map(|k| 50.0 * centres[heap(k / 9) * 9 + k % 9] + 0.01 * shake[k])
            .collect();
        let heaps: std::collections::BTreeSet<usize> = (0..2000).map(heap).collect();
        let found = groups(&rows, 9, heaps.len());
        for i in 0..2000 {
            for j in i + 1..i + 40 {
                let same = found.labels[i] == found.labels[j % 2000];
                assert_eq!(same, heap(i) == heap(j % 2000), "{i} and {j}");
            }
        }
    }

    #[test]
    fn nothing_and_one_row() {
        assert!(groups(&[], 9, 4).counts.is_empty());
        assert_eq!(groups(&[0.5; 9], 9, 1).means, [0.5; 9]);
        assert_eq!(groups(&[0.5; 90], 9, 8).counts, [10]);
    }
}
