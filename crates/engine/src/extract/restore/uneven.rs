//! Grounds in uneven light: the dark corners of a photograph, a light from one side, a filter that makes such.
//!
//! One correction of tones for all of a picture can't undo that. Where a ground is seen all around it tells how bright the
//! light is where, and the scene is divided by it: a flat field, as it is called in photography, of the picture itself.
//!
//! The light is a polynomial of degree two of the place in each channel, fitted to the ground by least squares, what is none
//! left out (trimmed, in rounds). Pictures whose border is no such ground stay as they are.
use crate::picture::Picture;

/// Squares a side whose mean colours are looked at, at most, and the pixels of one, at least: noise averages out.
const BLOCKS: usize = 40;
const LEAST_PIXELS: usize = 4;
/// How far a block of ground is from the fit.
const TOLERANCE: f64 = 0.012;
/// Share of the outermost blocks that must be ground.
const SHARE: f64 = 0.7;
/// How much the ground differs over the picture from which on its light is uneven: what compression does stays below.
const UNEVEN: f64 = 0.02;
/// A ground is at least that bright: a dark one says little of the light.
const DARKEST: f64 = 0.25;
/// Rounds of a fit.
const ROUNDS: usize = 8;
/// Terms of a polynomial: 1, x, y, x², xy, y².
const TERMS: usize = 6;

/// The picture in even light, as bright as where it is brightest; `None` where its border is no ground, or is lit evenly.
pub(super) fn evened(picture: &Picture) -> Option<Picture> {
    let blocks = blocks(picture);
    let ring: Vec<&Block> = blocks.iter().filter(|block| block.outermost).collect();
    let every: Vec<&Block> = blocks.iter().collect();
    let mut light = Light::fitted(&ring)?;
    for round in 0..ROUNDS {
        let mut errors: Vec<f64> = ring.iter().map(|block| light.error(block)).collect();
        let middle = errors.len() / 2;
        let typical = *errors.select_nth_unstable_by(middle, f64::total_cmp).1;
        // The ground within is looked for once that of the border is known.
        let among = if round < ROUNDS / 2 { &ring } else { &every };
        let near = |block: &&Block| light.error(block) <= TOLERANCE.max(typical);
        let ground: Vec<&Block> = among.iter().copied().filter(near).collect();
        light = Light::fitted(&ground)?;
    }
    let fits = ring.iter().filter(|block| light.error(block) <= TOLERANCE).count();
    if (fits as f64) < SHARE * ring.len() as f64 {
        return None;
    }
    let (darkest, brightest) = light.range(&blocks);
    let is_uneven = darkest
        .iter()
        .zip(brightest)
        .any(|(dark, bright)| bright - dark >= UNEVEN);
    let is_bright = darkest.iter().all(|dark| *dark >= DARKEST);
    (is_uneven && is_bright).then(|| light.evened(picture, brightest))
}

/// A square of a picture.
struct Block {
    /// The middle, -1 to 1 along x and y.
    at: [f64; 2],
    colour: [f64; 3],
    outermost: bool,
}

/// The squares of a picture; none of one that is too small.
fn blocks(picture: &Picture) -> Vec<Block> {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let count = BLOCKS.min(width.min(height) / LEAST_PIXELS);
    let bounds = |side: usize, i: usize| i * side / count..(i + 1) * side / count;
    let place = |side: usize, i: usize| {
        let range = bounds(side, i);
        (range.start + range.end) as f64 / side as f64 - 1.0
    };
    let pixels = picture.pixels.as_chunks::<3>().0;
    let block = |i: usize| {
        let (column, row) = (i % count, i / count);
        let (columns, rows) = (bounds(width, column), bounds(height, row));
        let mut sums = [0.0_f64; 3];
        for y in rows.clone() {
            for pixel in &pixels[y * width..][columns.clone()] {
                sums.iter_mut().zip(pixel).for_each(|(sum, v)| *sum += f64::from(*v));
            }
        }
        let inner = 1..count.saturating_sub(1);
        Block {
            at: [place(width, column), place(height, row)],
            colour: sums.map(|sum| sum / (columns.len() * rows.len()) as f64),
            outermost: !(inner.contains(&column) && inner.contains(&row)),
        }
    };
    (0..count * count).map(block).collect()
}

/// How bright the ground is where, in each channel.
#[derive(Clone, Copy)]
struct Light([[f64; TERMS]; 3]);

fn terms([x, y]: [f64; 2]) -> [f64; TERMS] {
    [1.0, x, y, x * x, x * y, y * y]
}

impl Light {
    /// Through blocks, by least squares; `None` where they do not determine it.
    fn fitted(blocks: &[&Block]) -> Option<Self> {
        let mut matrix = [[0.0; TERMS + 3]; TERMS];
        for block in blocks {
            let terms = terms(block.at);
            for (row, a) in matrix.iter_mut().zip(terms) {
                for (sum, b) in row.iter_mut().zip(terms.iter().chain(&block.colour)) {
                    *sum += a * b;
                }
            }
        }
        // Elimination by Gauss and Jordan; the matrix is symmetric and positive, so that no pivot has to be looked for.
        for i in 0..TERMS {
            let pivot = matrix[i][i];
            if pivot.is_nan() || pivot <= 1e-9 * blocks.len() as f64 {
                return None;
            }
            let row = matrix[i].map(|v| v / pivot);
            for (k, other) in matrix.iter_mut().enumerate() {
                let factor = if k == i { pivot - 1.0 } else { other[i] };
                other.iter_mut().zip(row).for_each(|(v, r)| *v -= factor * r);
            }
        }
        Some(Self(std::array::from_fn(|c| matrix.map(|row| row[TERMS + c]))))
    }

    fn at(&self, place: [f64; 2]) -> [f64; 3] {
        let terms = terms(place);
        self.0.map(|light| light.iter().zip(terms).map(|(a, b)| a * b).sum())
    }

    /// How far a block is from it, in the channel where that is most.
    fn error(&self, block: &Block) -> f64 {
        let differences = self.at(block.at).into_iter().zip(block.colour);
        differences.map(|(light, v)| (light - v).abs()).fold(0.0, f64::max)
    }

    /// The least and the most of each channel.
    fn range(&self, blocks: &[Block]) -> ([f64; 3], [f64; 3]) {
        let lights = blocks.iter().map(|block| self.at(block.at));
        lights.fold(([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]), |(low, high), light| {
            let of = |a: [f64; 3], f: fn(f64, f64) -> f64| std::array::from_fn(|c| f(a[c], light[c]));
            (of(low, f64::min), of(high, f64::max))
        })
    }

    /// The picture as if all of it had the light where that is `brightest`.
    fn evened(&self, picture: &Picture, brightest: [f64; 3]) -> Picture {
        let (width, height) = (picture.width as usize, picture.height as usize);
        let middle = |i: usize, side: usize| (2 * i + 1) as f64 / side as f64 - 1.0;
        let mut pixels = picture.pixels.clone();
        for (y, row) in pixels.chunks_exact_mut(3 * width).enumerate() {
            for (x, pixel) in row.as_chunks_mut::<3>().0.iter_mut().enumerate() {
                let light = self.at([middle(x, width), middle(y, height)]);
                for c in 0..3 {
                    pixel[c] = (f64::from(pixel[c]) * brightest[c] / light[c]).clamp(0.0, 1.0) as f32;
                }
            }
        }
        Picture { pixels, ..*picture }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::largest_difference;

    /// A disc with a gradient, a fifth of it beyond the border, on a ground.
    fn disc(side: u32, ground: f32) -> Picture {
        of(side, |x, y| match (x + 0.5).hypot(y - 0.1) < 0.7 {
            true => [0.4 + 0.3 * x, 0.4, 0.5 + 0.3 * y],
            false => [ground; 3],
        })
    }

    /// The picture of a function of -1 to 1 along x and y.
    fn of(side: u32, pixel: impl Fn(f32, f32) -> [f32; 3]) -> Picture {
        let at = |i: u32| (2 * i + 1) as f32 / side as f32 - 1.0;
        let pixels = (0..side * side)
            .flat_map(|i| pixel(at(i % side), at(i / side)))
            .collect();
        Picture {
            width: side,
            height: side,
            pixels,
        }
    }

    /// In a light that falls off by `by` to the corners, and is redder at the right, 1 where it is brightest.
    fn lit(picture: &Picture, by: f32) -> Picture {
        let light = of(picture.width, |x, y| {
            let corners = 1.0 - by * (x * x + y * y) / 2.0;
            // Brightest at x = 0.2, y = 0.
            let red = (corners - 0.2 * by * (1.0 - x)) / (1.0 - 0.18 * by);
            [red, corners, corners]
        });
        let pixels = picture.pixels.iter().zip(&light.pixels).map(|(v, light)| v * light);
        Picture {
            pixels: pixels.collect(),
            ..*picture
        }
    }

    #[test]
    fn dark_corners_and_light_from_a_side_go_and_the_scene_is_as_it_was() {
        for (side, by) in [(400, 0.25), (400, 0.5), (61, 0.1)] {
            let clean = disc(side, 1.0);
            let even = evened(&lit(&clean, by)).unwrap();
            assert!(
                largest_difference(&even, &clean) < 0.02,
                "{side} {by}: {}",
                largest_difference(&even, &clean)
            );
            assert!(evened(&even).is_none());
        }
    }

    #[test]
    fn even_grounds_dark_ones_and_scenes_without_one_stay() {
        for picture in [
            disc(400, 1.0),
            disc(400, 0.5),
            disc(400, 0.0),
            lit(&disc(400, 0.1), 0.5),
        ] {
            assert!(evened(&picture).is_none());
        }
        // Walls in soft light, with a corner between them, and a texture of some squares.
        let walls = of(400, |x, y| match x < 0.1 {
            true => [0.7 + 0.1 * x, 0.6 + 0.1 * y, 0.5],
            false => [0.5 - 0.2 * x, 0.5 + 0.1 * y, 0.45],
        });
        let tiles = of(400, |x, y| {
            [0.6 + 0.05 * (12.0 * x).sin() * (9.0 * y).cos() - 0.1 * x * x; 3]
        });
        assert!(evened(&walls).is_none() && evened(&tiles).is_none());
    }

    #[test]
    fn pictures_of_few_pixels_or_of_none_and_values_that_are_no_numbers_stay() {
        for side in [0, 1, 3, 5, 9] {
            assert!(evened(&disc(side, 0.5)).is_none(), "{side}");
        }
        assert!(evened(&of(100, |_, _| [f32::NAN; 3])).is_none());
        assert!(evened(&of(100, |x, _| [if x > 0.5 { f32::INFINITY } else { 0.5 }; 3])).is_none());
    }
}
