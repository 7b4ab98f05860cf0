//! How numbers of several scales lie in one buffer, so that one launch computes all of them.
//!
//! Scale by scale, and of each view by view: squares as `[scales][views][3][squares of the scale]`, numbers of squares as
//! `[scales][views][squares of the scale]`, those of chunks of [`CHUNK`] squares as `[scales][views][chunks of the scale]`.
use cubecl::prelude::*;

use super::CHUNK;

/// Most scales that there are.
const MOST: usize = 16;

/// Sides in pixels of the squares of each scale.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Sides {
    pub count: usize,
    of: [usize; MOST],
}

impl Sides {
    /// Of at most [`MOST`] scales; configurations allow no more.
    pub fn new(sides: &[usize]) -> Self {
        let mut of = [1; MOST];
        let count = sides.len().min(MOST);
        of[..count].copy_from_slice(&sides[..count]);
        Self { count, of }
    }

    /// The side of a scale.
    pub fn side(&self, scale: usize) -> usize {
        self.of[scale]
    }

    /// Squares of each scale of a picture.
    pub fn squares(&self, height: usize, width: usize) -> impl Iterator<Item = usize> {
        self.of
            .into_iter()
            .take(self.count)
            .map(move |side| (height / side) * (width / side))
    }
}

/// Where a square, or a chunk of them, is.
#[derive(CubeType)]
pub(super) struct Place {
    pub scale: usize,
    pub view: usize,
    /// Its number in its view and scale.
    pub within: usize,
    /// Side of the scale's squares in pixels.
    pub side: usize,
    /// Squares of a view at the scale.
    pub squares: usize,
    /// Squares before the first of its view and scale.
    pub first: usize,
}

/// The place of the square of that number, or of the chunk if `chunked`, of all scales and views.
#[cube]
pub(super) fn place_of(
    number: usize,
    views: usize,
    width: usize,
    height: usize,
    #[comptime] sides: Sides,
    #[comptime] chunked: bool,
) -> Place {
    let mut scale = 0usize;
    let mut side = 1usize;
    let mut squares = 1usize;
    let mut of_view = 1usize;
    let mut begin = 0usize;
    let mut first = 0usize;
    let mut numbers_before = 0usize;
    let mut squares_before = 0usize;
    #[unroll]
    for s in 0..comptime!(sides.count) {
        let own = comptime!(sides.side(s));
        let own_squares = (width / own) * (height / own);
        let mut numbers = own_squares;
        if comptime!(chunked) {
            numbers = own_squares.div_ceil(CHUNK);
        }
        if number >= numbers_before {
            scale = s;
            side = own;
            squares = own_squares;
            of_view = numbers;
            begin = numbers_before;
            first = squares_before;
        }
        numbers_before += numbers * views;
        squares_before += own_squares * views;
    }
    let view = (number - begin) / of_view;
    Place {
        scale,
        view,
        within: (number - begin) % of_view,
        side,
        squares,
        first: first + view * squares,
    }
}

/// The number of the first chunk of a view at a scale, how many there are, and how many squares.
#[cube]
pub(super) fn chunks_of(
    of_scale: usize,
    view: usize,
    views: usize,
    width: usize,
    height: usize,
    #[comptime] sides: Sides,
) -> (usize, usize, usize) {
    let mut first = 0usize;
    let mut count = 0usize;
    let mut squares = 0usize;
    let mut before = 0usize;
    #[unroll]
    for s in 0..comptime!(sides.count) {
        let own = comptime!(sides.side(s));
        let own_squares = (width / own) * (height / own);
        let chunks = own_squares.div_ceil(CHUNK);
        if of_scale == s {
            first = before + view * chunks;
            count = chunks;
            squares = own_squares;
        }
        before += chunks * views;
    }
    (first, count, squares)
}
