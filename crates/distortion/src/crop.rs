//! Windows of pictures, enlarged to the size of the whole.
use std::collections::BTreeMap;

use burn::tensor::Tensor;
use serde::{Deserialize, Serialize};

use crate::groups::{Group, assemble};
use crate::matrices::{Lines, resample};

/// The window that is left of one picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Crop {
    /// Share of each side that is kept, within 0 and 1; at least one pixel is.
    pub keep: f32,
    /// Where the window is along y and x, within 0 (top, left) and 1; 0.5 is the centre.
    pub at: [f32; 2],
}

impl Crop {
    /// First row, first column, height and width of the window. Sizes are rounded down, as
    /// `torchvision.transforms.functional.center_crop(x, int(keep * side))` has them.
    pub(crate) fn window(&self, height: usize, width: usize) -> [usize; 4] {
        let along = |side: usize, at: f32| {
            let kept = ((f64::from(self.keep) * side as f64 + 1e-6) as usize).clamp(1, side);
            let free = (side - kept) as f64;
            // Half to even, as Python rounds.
            let first = (free * f64::from(at)).round_ties_even() as usize;
            [first.min(side - kept), kept]
        };
        let ([y, h], [x, w]) = (along(height, self.at[0]), along(width, self.at[1]));
        [y, x, h, w]
    }
}

/// Cuts one window out of each picture of `[b, 3, h, w]` and enlarges it (bilinear) to the size of the whole, because
/// the pictures of a batch share one size; a reader resizes what it gets to one size, too.
pub(crate) fn crop(pictures: Tensor<4>, crops: &[Crop]) -> Tensor<4> {
    crop_and(pictures, crops, |windows, _| windows)
}

/// As [`crop`]; what else happens to pictures after they were cut and before they are enlarged is up to `then`, which
/// gets windows of one size and the positions of their pictures.
pub(crate) fn crop_and(
    pictures: Tensor<4>,
    crops: &[Crop],
    then: impl Fn(Tensor<4>, &[usize]) -> Tensor<4>,
) -> Tensor<4> {
    let [_, c, h, w] = pictures.dims();
    let mut sizes: BTreeMap<[usize; 2], (Vec<usize>, Vec<Tensor<4>>)> = BTreeMap::new();
    for (i, one) in crops.iter().enumerate() {
        let [y, x, height, width] = one.window(h, w);
        let window = pictures.clone().slice([i..i + 1, 0..c, y..y + height, x..x + width]);
        let (positions, windows) = sizes.entry([height, width]).or_default();
        positions.push(i);
        windows.push(window);
    }
    let groups = sizes
        .into_iter()
        .map(|([height, width], (positions, windows))| -> Group {
            let windows = then(Tensor::cat(windows, 0), &positions);
            let whole = match [height, width] == [h, w] {
                true => windows,
                false => resample(windows, &[Lines::resize(height, h)], &[Lines::resize(width, w)]),
            };
            (positions, whole)
        });
    assemble(groups.collect()).unwrap_or(pictures)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_are_torchvisions_and_inside() {
        let centre = |keep| Crop { keep, at: [0.5; 2] };
        assert_eq!(centre(0.4).window(160, 100), [48, 30, 64, 40]);
        // center_crop of a side of 7 to 2 begins at round(2.5) = 2.
        assert_eq!(centre(0.4).window(7, 1), [2, 0, 2, 1]);
        assert_eq!(centre(1.0).window(33, 47), [0, 0, 33, 47]);
        assert_eq!(centre(0.0).window(5, 5), [2, 2, 1, 1]);
        let corner = Crop {
            keep: 0.6,
            at: [1.0, 0.0],
        };
        assert_eq!(corner.window(10, 10), [4, 0, 6, 6]);
    }
}
