//! A ground that is seen all around a scene and whose colour changes smoothly: a white one in uneven light, or a backdrop.
//!
//! A polynomial of degree two of the place in each channel, fitted to the ground by least squares, what is none left out
//! (trimmed, in rounds).
use crate::extract::linear::solve;
use crate::picture::Picture;

/// Squares a side whose mean colours are looked at, at most, and the pixels of one, at least: noise averages out.
const BLOCKS: usize = 40;
const LEAST_PIXELS: usize = 4;
/// How far a block of ground is from the fit.
const TOLERANCE: f64 = 0.012;
/// Share of the outermost blocks that must be ground.
const SHARE: f64 = 0.7;
/// How much the ground differs over the picture from which on it is not of one colour: what compression does stays below.
const UNEVEN: f64 = 0.02;
/// Rounds of a fit.
const ROUNDS: usize = 8;
/// Terms of a polynomial: 1, x, y, x², xy, y².
const TERMS: usize = 6;

/// The ground of a picture.
pub(super) struct SmoothGround {
    fit: Polynomial,
    /// The least and the most of each channel over the picture.
    pub darkest: [f64; 3],
    pub brightest: [f64; 3],
}

impl SmoothGround {
    /// That of a picture; `None` where its border is no ground, or is all of one colour.
    pub fn seen(picture: &Picture) -> Option<Self> {
        let blocks = blocks(picture);
        let ring: Vec<&Block> = blocks.iter().filter(|block| block.outermost).collect();
        let every: Vec<&Block> = blocks.iter().collect();
        let mut fit = Polynomial::fitted(&ring)?;
        for round in 0..ROUNDS {
            let mut errors: Vec<f64> = ring.iter().map(|block| fit.error(block)).collect();
            let middle = errors.len() / 2;
            let typical = *errors.select_nth_unstable_by(middle, f64::total_cmp).1;
            // The ground within is looked for once that of the border is known.
            let among = if round < ROUNDS / 2 { &ring } else { &every };
            let near = |block: &&Block| fit.error(block) <= TOLERANCE.max(typical);
            let ground: Vec<&Block> = among.iter().copied().filter(near).collect();
            fit = Polynomial::fitted(&ground)?;
        }
        let fits = ring.iter().filter(|block| fit.error(block) <= TOLERANCE).count();
        if (fits as f64) < SHARE * ring.len() as f64 {
            return None;
        }
        let (darkest, brightest) = fit.range(&blocks);
        let mut differences = darkest.iter().zip(brightest).map(|(dark, bright)| bright - dark);
        differences.any(|difference| difference >= UNEVEN).then_some(Self {
            fit,
            darkest,
            brightest,
        })
    }

    /// The picture with each pixel changed as `after` says of it and the ground's colour at its place.
    pub fn changed(&self, picture: &Picture, after: impl Fn([f32; 3], [f64; 3]) -> [f32; 3]) -> Picture {
        let (width, height) = (picture.width as usize, picture.height as usize);
        let middle = |i: usize, side: usize| (2 * i + 1) as f64 / side as f64 - 1.0;
        let mut pixels = picture.pixels.clone();
        for (y, row) in pixels.chunks_exact_mut(3 * width).enumerate() {
            for (x, pixel) in row.as_chunks_mut::<3>().0.iter_mut().enumerate() {
                *pixel = after(*pixel, self.fit.at([middle(x, width), middle(y, height)]));
            }
        }
        Picture { pixels, ..*picture }
    }
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

/// The colour of the ground by place, in each channel.
#[derive(Clone, Copy)]
struct Polynomial([[f64; TERMS]; 3]);

fn terms([x, y]: [f64; 2]) -> [f64; TERMS] {
    [1.0, x, y, x * x, x * y, y * y]
}

impl Polynomial {
    /// Through blocks, by least squares; `None` where they do not determine it.
    fn fitted(blocks: &[&Block]) -> Option<Self> {
        let (mut products, mut sums) = (vec![0.0; TERMS * TERMS], vec![[0.0; 3]; TERMS]);
        for block in blocks {
            let terms = terms(block.at);
            for (p, a) in terms.into_iter().enumerate() {
                (0..TERMS).for_each(|q| products[p * TERMS + q] += a * terms[q]);
                (0..3).for_each(|c| sums[p][c] += a * block.colour[c]);
            }
        }
        let solved = solve(products, sums, 1e-9 * blocks.len() as f64)?;
        Some(Self(std::array::from_fn(|c| std::array::from_fn(|p| solved[p][c]))))
    }

    fn at(&self, place: [f64; 2]) -> [f64; 3] {
        let terms = terms(place);
        self.0
            .map(|channel| channel.iter().zip(terms).map(|(a, b)| a * b).sum())
    }

    /// How far a block is from it, in the channel where that is most.
    fn error(&self, block: &Block) -> f64 {
        let differences = self.at(block.at).into_iter().zip(block.colour);
        differences.map(|(fit, v)| (fit - v).abs()).fold(0.0, f64::max)
    }

    /// The least and the most of each channel.
    fn range(&self, blocks: &[Block]) -> ([f64; 3], [f64; 3]) {
        let colours = blocks.iter().map(|block| self.at(block.at));
        colours.fold(([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]), |(low, high), colour| {
            let of = |a: [f64; 3], f: fn(f64, f64) -> f64| std::array::from_fn(|c| f(a[c], colour[c]));
            (of(low, f64::min), of(high, f64::max))
        })
    }
}
