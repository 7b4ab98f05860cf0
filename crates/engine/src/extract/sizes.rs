//! Reads a picture at several sizes and takes the mean: one grid of pixels is an accident.
//!
//! A tower that averages sines of colours over pixels sees a surface through the grid that its picture was made small with.
//! Another grid mixes other neighbours into a pixel. What the mixtures add to a reading differs from grid to grid, and the
//! mark is the same in all of them.
use std::borrow::Cow;

use super::{Engine, Extractor};
use crate::error::Result;
use crate::picture::Picture;

/// Sizes at which a picture is read besides the extractor's own, as multiples of it (`docs/verify.md`, "Several sizes").
const LARGER: [f32; 3] = [1.1, 1.25, 1.4];

/// Sides besides the extractor's own at which a picture is read that has `pixels` along its shorter side: those that it has
/// pixels for. None where it matters to the extractor where things are.
pub(super) fn larger_sides(extractor: &dyn Extractor, pixels: usize) -> impl Iterator<Item = usize> + use<> {
    let own = extractor.side();
    let sides = extractor.square().into_iter().flat_map(move |square| {
        let squares = own as f32 / square as f32;
        LARGER.map(|times| (times * squares).round() as usize * square)
    });
    sides.filter(move |side| (own + 1..=pixels).contains(side))
}

/// Mean logits of a picture at the extractor's own side and [`larger_sides`].
///
/// # Errors
/// A picture without pixels, a failing device, or [`Error::Stopped`](crate::Error::Stopped).
pub(super) fn read_at_sizes(engine: &Engine, picture: &Picture) -> Result<Vec<f32>> {
    let read = |side| {
        Ok(engine
            .read_logits_at(side, std::slice::from_ref(picture))?
            .swap_remove(0))
    };
    let sides = engine.sides(shorter_side(picture));
    Ok(mean(&sides.into_iter().map(read).collect::<Result<Vec<_>>>()?))
}

/// [`read_at_sizes`] of each of some pictures. A card is given those of one size together.
///
/// # Errors
/// Those of [`read_at_sizes`].
pub(super) fn read_all_at_sizes(engine: &Engine, pictures: &[Cow<'_, Picture>]) -> Result<Vec<Vec<f32>>> {
    if engine.on_cpu() {
        return engine.each(pictures, |picture| read_at_sizes(engine, picture));
    }
    let mut logits = Vec::with_capacity(pictures.len());
    for alike in pictures.chunk_by(|a, b| (a.width, a.height) == (b.width, b.height)) {
        let alike: Vec<&Picture> = alike.iter().map(AsRef::as_ref).collect();
        let sides = engine.sides(shorter_side(alike[0]));
        let at_sides = sides.into_iter().map(|side| engine.read_logits_at(side, &alike));
        let at_sides: Vec<Vec<Vec<f32>>> = at_sides.collect::<Result<_>>()?;
        let of_picture = |index: usize| at_sides.iter().map(|read| read[index].clone()).collect::<Vec<_>>();
        logits.extend((0..alike.len()).map(|index| mean(&of_picture(index))));
    }
    Ok(logits)
}

/// Pixels along the shorter side of a picture.
pub(super) fn shorter_side(picture: &Picture) -> usize {
    picture.width.min(picture.height) as usize
}

/// The mean of readings, bit by bit.
pub(super) fn mean(readings: &[Vec<f32>]) -> Vec<f32> {
    let bits = readings.first().map_or(0, Vec::len);
    let sum = |bit: usize| readings.iter().map(|logits| logits[bit]).sum::<f32>();
    (0..bits).map(|bit| sum(bit) / readings.len() as f32).collect()
}

#[cfg(test)]
mod tests {
    use burn::tensor::Tensor;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::device::{DeviceChoice, open};
    use crate::resize::resize;

    /// Side of the pictures that [`Sines`] takes in.
    const SIDE: usize = 32;
    /// Its bits.
    const BITS: usize = 8;

    /// Mean sines of the red of a picture, at eight frequencies; squares of them, or what lies where.
    struct Sines {
        square: Option<usize>,
    }

    impl Extractor for Sines {
        fn bits(&self) -> usize {
            BITS
        }

        fn side(&self) -> usize {
            SIDE
        }

        fn parameters(&self) -> usize {
            0
        }

        fn square(&self) -> Option<usize> {
            self.square
        }

        fn square_logits(&self, pictures: Tensor<4>) -> Result<Tensor<2>> {
            let [count, _, height, width] = pictures.dims();
            let red = pictures.slice([0..count, 0..1, 0..height, 0..width]).flatten::<2>(1, 3);
            let sines = (0..BITS).map(|bit| (red.clone() * (60.0 + 8.0 * bit as f32)).sin().mean_dim(1));
            Ok(Tensor::cat(sines.collect(), 1))
        }

        fn logits(&self, pictures: Tensor<4>) -> Result<Tensor<2>> {
            self.square_logits(resize(pictures, SIDE, SIDE))
        }
    }

    fn engine(square: Option<usize>) -> Engine {
        let compute = open(DeviceChoice::Cpu).unwrap();
        Engine::with_extractor(compute, Box::new(Sines { square }), None)
    }

    /// Fine texture.
    fn texture(side: u32) -> Picture {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        Picture {
            width: side,
            height: side,
            pixels: (0..3 * side * side).map(|_| rng.random_range(0.2..0.8)).collect(),
        }
    }

    /// The square of that side whose first corner is this far along both sides.
    fn part(picture: &Picture, from: usize, side: usize) -> Picture {
        let row = |y: usize| &picture.pixels[3 * (y * picture.width as usize + from)..][..3 * side];
        Picture {
            width: side as u32,
            height: side as u32,
            pixels: (from..from + side).flat_map(row).copied().collect(),
        }
    }

    /// Mean variance of logits over readings of a picture through grids that lie differently.
    fn spread(read: impl Fn(&Picture) -> Vec<f32>) -> f32 {
        let texture = texture(180);
        let readings: Vec<Vec<f32>> = (0..20).map(|from| read(&part(&texture, from, 160))).collect();
        let mean = mean(&readings);
        let squares = readings
            .iter()
            .flat_map(|logits| logits.iter().zip(&mean).map(|(v, mean)| (v - mean).powi(2)));
        squares.sum::<f32>() / (readings.len() * BITS) as f32
    }

    #[test]
    fn sizes_that_a_picture_has_pixels_for_go_up_in_squares() {
        let sides = |square: Option<usize>, pixels| {
            let engine = engine(square);
            larger_sides(engine.extractor.as_ref(), pixels).collect::<Vec<_>>()
        };
        assert_eq!(sides(Some(1), 800), [35, 40, 45]);
        assert_eq!(sides(Some(4), 800), [36, 40, 44]);
        assert_eq!(sides(Some(4), 43), [36, 40]);
        assert!(sides(Some(4), 32).is_empty());
        // Where things are matters.
        assert!(sides(None, 800).is_empty());
    }

    #[test]
    fn how_the_grid_lies_matters_less_at_several_sizes() {
        let engine = engine(Some(4));
        let once = spread(|picture| {
            let read = engine.read_logits(std::slice::from_ref(picture));
            read.unwrap().swap_remove(0)
        });
        let at_sizes = spread(|picture| read_at_sizes(&engine, picture).unwrap());
        assert!(at_sizes < 0.6 * once, "{at_sizes} {once}");
    }

    #[test]
    fn a_small_picture_is_read_once() {
        let engine = engine(Some(4));
        let small = texture(SIDE as u32);
        let once = engine.read_logits(std::slice::from_ref(&small)).unwrap().swap_remove(0);
        assert_eq!(read_at_sizes(&engine, &small).unwrap(), once);
    }
}
