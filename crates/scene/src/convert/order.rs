//! The order of rows in which neighbours in space are neighbours in the file.
use std::cmp::Ordering;

/// Cells along each axis.
const CELLS: f64 = 1024.0;
/// Gaussians of one cell that stay in the order that they have; more are ordered within it.
const FEW: usize = 256;

/// Rows in Morton order of their positions, as splat-transform has them: 10 bits an axis of the box around all, x in
/// the lowest; cells of more than 256 Gaussians in Morton order of the box around those. Ties by row.
pub(crate) fn morton(positions: &[[f32; 3]]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..positions.len()).collect();
    // A stack instead of a recursion: its depth would be up to the positions.
    let mut boxes = Vec::from([(0, order.len())]);
    while let Some((mut start, end)) = boxes.pop() {
        let rows = &mut order[start..end];
        let Some(code) = coder(positions, rows) else { continue };
        let mut coded: Vec<(u32, usize)> = rows.iter().map(|row| (code(*row), *row)).collect();
        coded.sort_unstable();
        rows.iter_mut()
            .zip(&coded)
            .for_each(|(row, (_, sorted))| *row = *sorted);
        for same in coded.chunk_by(|a, b| a.0 == b.0) {
            if same.len() > FEW {
                boxes.push((start, start + same.len()));
            }
            start += same.len();
        }
    }
    order
}

/// What gives a row its place in the box around all of `rows`; `None` where all are at one place.
fn coder<'a>(positions: &'a [[f32; 3]], rows: &[usize]) -> Option<impl Fn(usize) -> u32 + use<'a>> {
    let mut least = [f64::INFINITY; 3];
    let mut most = [f64::NEG_INFINITY; 3];
    for row in rows {
        for axis in 0..3 {
            let value = f64::from(positions[*row][axis]);
            least[axis] = least[axis].min(value);
            most[axis] = most[axis].max(value);
        }
    }
    if rows.is_empty() || least == most {
        return None;
    }
    let scale: [f64; 3] = std::array::from_fn(|axis| match most[axis].partial_cmp(&least[axis]) {
        Some(Ordering::Greater) => CELLS / (most[axis] - least[axis]),
        _ => 0.0,
    });
    Some(move |row: usize| {
        (0..3).fold(0, |code, axis| {
            let place = (f64::from(positions[row][axis]) - least[axis]) * scale[axis];
            code | spread(place.min(CELLS - 1.0) as u32) << axis
        })
    })
}

/// The ten bits of a number with two zeros between each.
fn spread(mut bits: u32) -> u32 {
    bits = (bits ^ (bits << 16)) & 0xff00_00ff;
    bits = (bits ^ (bits << 8)) & 0x0300_f00f;
    bits = (bits ^ (bits << 4)) & 0x030c_30c3;
    (bits ^ (bits << 2)) & 0x0924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_spread() {
        for bits in 0..1024u32 {
            let expected = (0..10).fold(0, |sum, i| sum | (bits >> i & 1) << (3 * i));
            assert_eq!(spread(bits), expected);
        }
    }

    #[test]
    fn corners_of_a_cube_are_in_order() {
        let corner = |i: u32| [0, 1, 2].map(|axis| (i >> axis & 1) as f32 * 5.0 - 2.0);
        let positions: Vec<_> = [6, 3, 0, 7, 5, 1, 4, 2].map(corner).to_vec();
        assert_eq!(morton(&positions), [2, 5, 7, 1, 6, 4, 0, 3]);
    }

    /// One far Gaussian makes one cell of all others; they are in order all the same.
    #[test]
    fn full_cells_are_ordered_within() {
        let mut positions: Vec<[f32; 3]> = (0..1000).map(|i| [((i * 389) % 1000) as f32, 0.0, 0.0]).collect();
        positions.push([1e9, 0.0, 0.0]);
        let order = morton(&positions);
        assert!(order.windows(2).all(|pair| positions[pair[0]] < positions[pair[1]]));
        assert_eq!(order[1000], 1000);
    }

    #[test]
    fn every_row_once_whatever_the_positions() {
        for positions in [
            vec![],
            vec![[1.0; 3]; 2000],
            vec![[f32::MAX, f32::MIN, 0.0], [f32::MIN, f32::MAX, -0.0]],
            (0..3000)
                .map(|i| [1.0 + (i % 7) as f32 * f32::EPSILON, 1e-40, 3.0])
                .collect(),
        ] {
            let mut order = morton(&positions);
            let equal = positions.windows(2).all(|pair| pair[0] == pair[1]);
            assert!(!equal || order.is_sorted(), "equal ones stay");
            order.sort_unstable();
            assert_eq!(order, (0..positions.len()).collect::<Vec<_>>());
        }
    }
}
