//! Which colours a written file can have: those of 256 steps of a range that each chunk has for each channel.
//!
//! Writers make the ranges as narrow as the colours of a chunk, so that the Gaussians at their ends could change to
//! one side only, and those of a plain surface not at all. The header leaves room for wider ranges; a file with
//! changed colours gets them, and all its colours are put on the new steps.
use super::CHUNK;
use super::decode::{Chunk, word};
use super::layout::Layout;
use crate::range::Range;

/// How far the new ranges go beyond the colours of the file, as a part of the way from black to white.
///
/// A mark moves colours by 0.015 on average and by 0.1 at most. Chunks of real scenes mostly reach from near black to
/// near white: there the steps grow from 0.0036 to 0.0044 for this margin, and unchanged colours move by 0.0013 on
/// average (a third of a step of an 8-bit picture). Without it 7 % of the marked Gaussians would be cut off at an end
/// of their range, and a tenth of the mark lost.
const MARGIN: f64 = 0.1;
/// Ranges that the file has stay, and with them its colours, where they leave no less than this...
const ENOUGH: f64 = MARGIN / 2.0;
/// ...and no more than this: their steps are not much wider than those of a new range. So a scene that is marked for
/// the second time mostly has the ranges that it got the first time.
const TOO_MUCH: f64 = 2.0 * MARGIN;

/// The ranges for writing, of red, green and blue, a chunk each.
pub(super) fn grids(layout: &Layout, chunks: &[Chunk], body: &[u8]) -> Vec<[Range; 3]> {
    if layout.colour.is_none() {
        // There is no place for ranges in the file: all colours are between black and white.
        return chunks.iter().map(|chunk| chunk.colour).collect();
    }
    let mut used = vec![[(u8::MAX, u8::MIN); 3]; chunks.len()];
    for (i, row) in layout.gaussians.rows(body).enumerate() {
        let bytes = word(row, layout.words[3]).to_be_bytes();
        for ((least, most), byte) in used[i / CHUNK].iter_mut().zip(bytes) {
            *least = byte.min(*least);
            *most = byte.max(*most);
        }
    }
    let grid = |(chunk, used): (&Chunk, &[(u8, u8); 3])| {
        std::array::from_fn(|k| widened(chunk.colour[k], used[k].0, used[k].1))
    };
    chunks.iter().zip(&used).map(grid).collect()
}

/// The range for the colours that the bytes `least` to `most` of the file's range stand for.
fn widened(file: Range, least: u8, most: u8) -> Range {
    let ends = [least, most].map(|byte| file.at(u32::from(byte), 255));
    // A range may be the wrong way round.
    let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
    let leaves = [low - f64::from(file.min), f64::from(file.max) - high];
    if leaves.into_iter().all(|left| (ENOUGH..=TOO_MUCH).contains(&left)) {
        return file;
    }
    Range {
        min: (low - MARGIN) as f32,
        max: (high + MARGIN) as f32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_get_a_margin_unless_they_have_one() {
        let range = |min: f32, max: f32| Range { min, max };
        assert_eq!(widened(range(0.25, 0.75), 0, 255), range(0.15, 0.85));
        assert_eq!(widened(range(0.25, 0.25), 3, 9), range(0.15, 0.35));
        assert_eq!(
            widened(range(0.75, 0.25), 0, 255),
            range(0.15, 0.85),
            "the wrong way round"
        );
        // A fifth of the range is left on both sides; what that is depends on the range.
        assert_eq!(widened(range(0.0, 0.5), 51, 204), range(0.0, 0.5), "0.1 each");
        assert_eq!(widened(range(0.0, 0.24), 51, 204), range(-0.052, 0.292), "0.048 each");
        assert_eq!(widened(range(0.0, 5.0), 51, 204), range(0.9, 4.1), "1 each");
        assert_eq!(widened(range(0.0, 0.5), 0, 204), range(-0.1, 0.5), "on one side only");
    }

    #[test]
    fn colours_move_by_no_more_than_half_a_step() {
        for file in [
            Range::UNIT,
            Range { min: 0.3, max: 0.31 },
            Range { min: -2.0, max: 7.0 },
        ] {
            let grid = widened(file, 0, 255);
            let half = (f64::from(grid.max) - f64::from(grid.min)) / 510.0;
            for byte in 0..=255u8 {
                let kept = grid.at(u32::from(grid.nearest(file.coefficient(byte))), 255);
                let moved = (kept - file.at(u32::from(byte), 255)).abs();
                assert!(moved <= half * 1.0001, "{byte}: {moved}");
            }
        }
    }
}
