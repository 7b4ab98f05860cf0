//! Black rectangles over parts of pictures.
use burn::tensor::{Tensor, TensorData};
use serde::{Deserialize, Serialize};

/// A rectangle in shares of the sides, each within 0 and 1. It covers whole pixels and at most `height` x `width` of
/// the picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rectangle {
    /// Where it is along y and x, of the room that there is.
    pub at: [f32; 2],
    /// Share of the picture's height.
    pub height: f32,
    /// Share of the picture's width.
    pub width: f32,
}

/// How many rectangles a picture has at most.
pub const MAX_RECTANGLES: usize = 4;

/// Paints the rectangles of each of the pictures `[b, 3, h, w]` black. No gradient passes where they are.
pub(crate) fn mask(pictures: Tensor<4>, each: &[Vec<Rectangle>]) -> Tensor<4> {
    let [b, _, h, w] = pictures.dims();
    let device = pictures.device();
    let count = each.iter().map(Vec::len).max().unwrap_or(0);
    if count == 0 {
        return pictures;
    }
    // A rectangle is the product of a line along y and one along x, which is all that has to reach the device.
    let line = |side: usize, span: fn(&Rectangle, usize) -> [usize; 2]| -> Vec<f32> {
        let mut values = vec![0.0; b * count * side];
        for (lines, rectangles) in values.chunks_exact_mut(count * side).zip(each) {
            for (line, rectangle) in lines.chunks_exact_mut(side).zip(rectangles) {
                let [from, to] = span(rectangle, side);
                line[from..to].fill(1.0);
            }
        }
        values
    };
    let rows = line(h, |r, side| span(side, r.height, r.at[0]));
    let columns = line(w, |r, side| span(side, r.width, r.at[1]));
    let mut kept: Option<Tensor<4>> = None;
    let rows = Tensor::<4>::from_data(TensorData::new(rows, [b, count, h, 1]), &device);
    let columns = Tensor::<4>::from_data(TensorData::new(columns, [b, count, 1, w]), &device);
    for i in 0..count {
        let row = rows.clone().slice([0..b, i..i + 1]);
        let column = columns.clone().slice([0..b, i..i + 1]);
        let outside = -(row * column) + 1.0;
        kept = Some(kept.map_or(outside.clone(), |k| k * outside));
    }
    match kept {
        Some(kept) => pictures * kept,
        None => pictures,
    }
}

/// First pixel and the one after the last. Rounded down, so that a rectangle never covers more than its share.
fn span(side: usize, share: f32, at: f32) -> [usize; 2] {
    let length = ((f64::from(share) * side as f64) as usize).min(side);
    let from = ((f64::from(at) * (side - length) as f64).round() as usize).min(side - length);
    [from, from + length]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_stay_inside_and_within_their_share() {
        assert_eq!(span(10, 0.25, 0.0), [0, 2]);
        assert_eq!(span(10, 0.25, 1.0), [8, 10]);
        assert_eq!(span(10, 1.0, 0.7), [0, 10]);
        assert!(span(1, 0.9, 0.5)[1] - span(1, 0.9, 0.5)[0] == 0);
    }
}
