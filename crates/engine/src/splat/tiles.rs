//! Which splats touch which 16 x 16 tile of a picture, front to back.
use super::project::{Splat2d, TileRect};
use crate::error::{Error, Result};
use rayon::prelude::*;

/// Side of a tile in pixels, as in the reference.
pub const TILE: u32 = 16;
/// Pixels of a tile.
pub(crate) const TILE_PIXELS: usize = (TILE * TILE) as usize;
/// Most (splat, tile) pairs a view may have: lists of this length take 2 GiB.
pub const MAX_PAIRS: u64 = 1 << 28;

/// Splats of every tile, and for every splat its places in those lists.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TileLists {
    /// Tiles a row.
    pub columns: u32,
    /// Rows of tiles.
    pub rows: u32,
    /// `tiles + 1` offsets into `splats`; tiles row by row.
    pub start: Vec<u32>,
    /// Indices into [`super::PreparedView::splats`], by depth, then row, within a tile. A place in this list is a *slot*.
    pub splats: Vec<u32>,
    /// `visible + 1` offsets into `slots`.
    pub slot_start: Vec<u32>,
    /// Slots of each splat, ascending: the order in which a Gaussian's gradient is summed.
    pub slots: Vec<u32>,
}

impl TileLists {
    /// Sorts `splats` (in ascending row order) into the tiles of `rects`. Ties in depth go to the lower row: the order is
    /// total. Slots are left for [`TileLists::with_slots`], when it is known which pairs stay.
    pub(crate) fn new(columns: u32, rows: u32, splats: &[Splat2d], rects: &[TileRect]) -> Result<Self> {
        let pairs: u64 = rects.iter().map(TileRect::area).sum();
        check_pairs(pairs)?;
        let tiles_of = |rect: &TileRect| {
            let columns = columns as usize;
            let [x, y] = [rect.x, rect.y].map(|[first, end]| usize::from(first)..usize::from(end));
            y.flat_map(move |y| (y * columns + x.start)..(y * columns + x.end))
        };
        let mut start = vec![0u32; columns as usize * rows as usize + 1];
        for rect in rects {
            tiles_of(rect).for_each(|tile| start[tile + 1] += 1);
        }
        for i in 1..start.len() {
            start[i] += start[i - 1];
        }
        let mut next = start.clone();
        let mut lists = vec![0u32; pairs as usize];
        for index in by_depth(splats) {
            for tile in tiles_of(&rects[index as usize]) {
                let next = &mut next[tile];
                lists[*next as usize] = index;
                *next += 1;
            }
        }
        Ok(TileLists {
            columns,
            rows,
            start,
            splats: lists,
            ..TileLists::default()
        })
    }

    /// The lists with the slots of each of `count` splats.
    pub(crate) fn with_slots(self, count: usize) -> Self {
        let (slot_start, slots) = slots_of(count, &self.splats);
        TileLists {
            slot_start,
            slots,
            ..self
        }
    }

    /// Splats of tile `index`, front to back.
    pub fn of(&self, index: usize) -> &[u32] {
        &self.splats[self.start[index] as usize..self.start[index + 1] as usize]
    }

    /// Number of (splat, tile) pairs, and so of slots.
    pub fn pairs(&self) -> usize {
        self.splats.len()
    }

    /// The lists with only the pairs of `keep`, and splats renumbered by `renumber`; without slots.
    pub(crate) fn pruned(&self, keep: &[bool], renumber: &[u32]) -> Self {
        let mut start = Vec::with_capacity(self.start.len());
        start.push(0);
        let mut splats = Vec::with_capacity(keep.iter().filter(|k| **k).count());
        for tile in 0..self.start.len() - 1 {
            let range = self.start[tile] as usize..self.start[tile + 1] as usize;
            splats.extend(
                range
                    .filter(|slot| keep[*slot])
                    .map(|slot| renumber[self.splats[slot] as usize]),
            );
            start.push(splats.len() as u32);
        }
        TileLists {
            columns: self.columns,
            rows: self.rows,
            start,
            splats,
            ..TileLists::default()
        }
    }

    /// Sums `values` (`[slots][3]`) over the slots of each splat, always in the same order: `[visible][3]`.
    pub(crate) fn sum_slots(&self, values: &[[f32; 3]]) -> Vec<f32> {
        let mut out = vec![0.0; 3 * (self.slot_start.len() - 1)];
        out.par_chunks_exact_mut(3)
            .with_min_len(4096)
            .enumerate()
            .for_each(|(i, out)| {
                for slot in &self.slots[self.slot_start[i] as usize..self.slot_start[i + 1] as usize] {
                    let value = values[*slot as usize];
                    for j in 0..3 {
                        out[j] += value[j];
                    }
                }
            });
        out
    }

    /// Memory of the lists.
    pub fn bytes(&self) -> usize {
        4 * (self.start.len() + self.splats.len() + self.slot_start.len() + self.slots.len())
    }
}

/// Most bits that the sort looks at in a pass: counts of all their values fit the first cache.
const DIGIT: u32 = 11;

/// Indices of splats by depth, those of the same depth in ascending order.
///
/// A radix sort, least significant digit first: it takes time in proportion to the splats, and is stable. Depths are
/// positive, so their bits sort as they do; digits cover the bits in which they differ.
fn by_depth(splats: &[Splat2d]) -> Vec<u32> {
    let depths = || splats.iter().map(|s| s.depth.to_bits());
    let least = depths().min().unwrap_or(0);
    let bits = 32 - (depths().max().unwrap_or(0) - least).leading_zeros();
    let passes = bits.div_ceil(DIGIT).max(1);
    let digit = bits.div_ceil(passes);
    let mut keys: Vec<u64> = depths()
        .enumerate()
        .map(|(i, depth)| u64::from(depth - least) << 32 | i as u64)
        .collect();
    let mut sorted = vec![0u64; keys.len()];
    for pass in 0..passes {
        let place = |key: u64| (key >> (32 + pass * digit)) as usize & ((1 << digit) - 1);
        let mut next = vec![0u32; (1 << digit) + 1];
        keys.iter().for_each(|key| next[place(*key) + 1] += 1);
        for i in 1..next.len() {
            next[i] += next[i - 1];
        }
        for key in &keys {
            let next = &mut next[place(*key)];
            sorted[*next as usize] = *key;
            *next += 1;
        }
        std::mem::swap(&mut keys, &mut sorted);
    }
    keys.into_iter().map(|key| key as u32).collect()
}

fn check_pairs(pairs: u64) -> Result<()> {
    if pairs <= MAX_PAIRS {
        return Ok(());
    }
    Err(Error::BadOption {
        field: "size",
        reason: format!(
            "the view has {pairs} (Gaussian, tile) pairs, the limit is {MAX_PAIRS}; render a smaller picture"
        ),
    })
}

/// Inverts `splats` (slot to splat): offsets and slots of each of `count` splats.
fn slots_of(count: usize, splats: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let mut start = vec![0u32; count + 1];
    for splat in splats {
        start[*splat as usize + 1] += 1;
    }
    for i in 0..count {
        start[i + 1] += start[i];
    }
    let mut next = start.clone();
    let mut slots = vec![0u32; splats.len()];
    for (slot, splat) in splats.iter().enumerate() {
        let next = &mut next[*splat as usize];
        slots[*next as usize] = slot as u32;
        *next += 1;
    }
    (start, slots)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;

    fn at_depth(depth: f32) -> Splat2d {
        Splat2d {
            depth,
            ..Splat2d::zeroed()
        }
    }

    #[test]
    fn depths_are_sorted_whatever_bits_they_differ_in() {
        let sorted = |depths: &[f32]| {
            let splats: Vec<Splat2d> = depths.iter().copied().map(at_depth).collect();
            let mut expected: Vec<u32> = (0..splats.len() as u32).collect();
            expected.sort_by(|a, b| depths[*a as usize].total_cmp(&depths[*b as usize]));
            assert_eq!(by_depth(&splats), expected, "{depths:?}");
        };
        let spread = |scale: f32| (0..3000).map(move |i: u32| 0.2 + scale * (i.wrapping_mul(7919) % 1009) as f32);
        sorted(&spread(1e-2).collect::<Vec<_>>());
        sorted(&spread(1e-7).chain(spread(1e30)).collect::<Vec<_>>());
        sorted(&[f32::MAX, 0.21, f32::MAX, 3.0]);
        sorted(&[5.0; 9]);
        sorted(&[1.0]);
        sorted(&[]);
    }

    #[test]
    fn too_many_pairs_are_refused_with_their_number() {
        let rect = TileRect { x: [0, 50], y: [0, 50] };
        assert_eq!(rect.area(), 2500);
        // What 120,000 full-screen splats at 800 x 800 would need.
        let error = check_pairs(2500 * 120_000).unwrap_err().to_string();
        assert!(error.contains("300000000") && error.contains("268435456"), "{error}");
        assert!(check_pairs(MAX_PAIRS).is_ok());
    }

    #[test]
    fn lists_go_front_to_back_and_ties_to_the_lower_row() {
        let splats = [2.0, 1.0, 2.0, 0.5].map(at_depth);
        let rects = [[0, 2], [1, 2], [0, 1], [0, 2]].map(|x| TileRect { x, y: [0, 1] });
        let lists = TileLists::new(2, 1, &splats, &rects).unwrap().with_slots(4);
        assert_eq!(lists.of(0), [3, 0, 2]);
        assert_eq!(lists.of(1), [3, 1, 0]);
        assert_eq!(lists.slot_start, [0, 2, 3, 4, 6]);
        assert_eq!(lists.slots, [1, 5, 4, 2, 0, 3]);
        let values: Vec<_> = (0..6).map(|i| [i as f32, 1.0, 0.0]).collect();
        assert_eq!(lists.sum_slots(&values)[..6], [6.0, 2.0, 0.0, 4.0, 1.0, 0.0]);
    }

    #[test]
    fn pruning_renumbers() {
        let rects = [[0, 2], [1, 2], [0, 1]].map(|x| TileRect { x, y: [0, 1] });
        let lists = TileLists::new(2, 1, &[2.0, 1.0, 3.0].map(at_depth), &rects).unwrap();
        // Tile 0: 0, 2; tile 1: 1, 0. Drop splat 1, and splat 0 from tile 1.
        let pruned = lists
            .pruned(&[true, true, false, false], &[0, u32::MAX, 1])
            .with_slots(2);
        assert_eq!((pruned.of(0), pruned.of(1)), (&[0, 1][..], &[][..]));
        assert_eq!(pruned.slots, [0, 1]);
    }
}
