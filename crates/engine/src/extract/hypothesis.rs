//! Hypotheses about what was done to a picture (turned, mirrored, put into a frame, its tones changed), and their undoing.
//!
//! Each is read for itself, and is paid for by whoever decides on the best of them.
use guardsplat_codeword::{Hypothesis, NEXT_ESTIMATES};

use super::photometric::{corrections, read_corrections};
use super::window::windows;
use super::{Engine, Extractor};
use crate::clip::config::Tones;
use crate::error::Result;
use crate::picture::Picture;

/// How far values of a border may be from its corner's: what JPEG does to a plain colour.
const TOLERANCE: f32 = 8.0 / 255.0;
/// Pixels a side that are left at least; less is nothing to read.
const LEAST_SIDE: u32 = 16;

/// All hypotheses under which this extractor reads one picture that has borders and is large enough to be read in parts:
/// the most that a claim about a picture pays for. Where what was done is estimated without the claimed message, a picture
/// whose estimate is clear has the first two only.
pub fn searched_hypotheses(extractor: &dyn Extractor) -> Vec<Hypothesis> {
    let next = NEXT_ESTIMATES.map(Hypothesis::estimated_next);
    let estimated = std::iter::once(Hypothesis::estimated()).chain(next);
    let estimated = estimated.filter(|_| extractor.tones() == Tones::Estimated);
    let whole = [false, true].map(|trimmed| whole_hypotheses(extractor, trimmed));
    let mut all: Vec<_> = whole.into_iter().flatten().chain(part_hypotheses(extractor)).collect();
    all.splice(1..1, estimated);
    all
}

/// Hypotheses under which a whole picture is read, nothing done first; with borders or `trimmed`. How a picture lies makes
/// no difference to an average over its pixels, so where exact colours are read it is changed tones that are undone.
pub(super) fn whole_hypotheses(extractor: &dyn Extractor, trimmed: bool) -> Vec<Hypothesis> {
    if !extractor.reads_exact_colours() {
        return orientations(trimmed).collect();
    }
    let corrected = corrections(extractor).into_iter().map(|correction| Hypothesis {
        trimmed,
        correction,
        ..Hypothesis::default()
    });
    corrected.collect()
}

/// Hypotheses under which parts of a picture are read; none where the extractor does not read parts.
pub(super) fn part_hypotheses(extractor: &dyn Extractor) -> impl Iterator<Item = Hypothesis> {
    let part = |window| Hypothesis {
        window: Some(window),
        ..Hypothesis::default()
    };
    windows().filter(|_| extractor.reads_exact_colours()).map(part)
}

/// Logits of a picture under each of [`whole_hypotheses`], in their order; its borders, if they are to go, were cut off
/// before.
///
/// # Errors
/// A picture without pixels, a failing device, or [`Error::Stopped`](crate::Error::Stopped).
pub(super) fn read_whole(engine: &Engine, picture: &Picture) -> Result<Vec<Vec<f32>>> {
    if engine.extractor.reads_exact_colours() {
        return read_corrections(engine, picture);
    }
    // One at a time: a large picture need not fit in memory eight times.
    let turned = orientations(false).map(|way| Ok(engine.read_logits(&[reorient(way, picture)])?.swap_remove(0)));
    turned.collect()
}

/// The eight ways to lay a picture on a table, as given first; with borders or `trimmed`.
fn orientations(trimmed: bool) -> impl Iterator<Item = Hypothesis> {
    [false, true].into_iter().flat_map(move |mirrored| {
        (0..4).map(move |quarter_turns| Hypothesis {
            quarter_turns,
            mirrored,
            trimmed,
            ..Hypothesis::default()
        })
    })
}

/// The picture turned and mirrored; its borders, if they are to go, were cut off before.
fn reorient(hypothesis: Hypothesis, picture: &Picture) -> Picture {
    let (w, h) = (picture.width as usize, picture.height as usize);
    let (width, height) = match hypothesis.quarter_turns % 2 {
        0 => (w, h),
        _ => (h, w),
    };
    let mut pixels = Vec::with_capacity(picture.pixels.len());
    for y in 0..height {
        for column in 0..width {
            let x = if hypothesis.mirrored {
                width - 1 - column
            } else {
                column
            };
            // Where a pixel of the turned picture was before.
            let (x, y) = match hypothesis.quarter_turns % 4 {
                0 => (x, y),
                1 => (w - 1 - y, x),
                2 => (w - 1 - x, h - 1 - y),
                _ => (y, h - 1 - x),
            };
            let at = 3 * (y * w + x);
            pixels.extend_from_slice(&picture.pixels[at..at + 3]);
        }
    }
    Picture {
        width: width as u32,
        height: height as u32,
        pixels,
    }
}

/// The picture without borders of one colour, which may be another one on each side; `None` where there are none, or
/// where too little would be left.
pub fn without_borders(picture: &Picture) -> Option<Picture> {
    let (mut left, mut top) = (0, 0);
    let (mut right, mut bottom) = (picture.width, picture.height);
    // Rows first, over the whole width: the bars above and below a film.
    while top < bottom && is_plain(picture, left..right, top..top + 1) {
        top += 1;
    }
    while top < bottom && is_plain(picture, left..right, bottom - 1..bottom) {
        bottom -= 1;
    }
    if top == bottom {
        return None;
    }
    while left < right && is_plain(picture, left..left + 1, top..bottom) {
        left += 1;
    }
    while left < right && is_plain(picture, right - 1..right, top..bottom) {
        right -= 1;
    }
    let (width, height) = (right - left, bottom - top);
    if (width, height) == (picture.width, picture.height) || width < LEAST_SIDE || height < LEAST_SIDE {
        return None;
    }
    let row = |y: u32| {
        let at = |x: u32| 3 * (y as usize * picture.width as usize + x as usize);
        &picture.pixels[at(left)..at(right)]
    };
    let pixels = (top..bottom).flat_map(row).copied().collect();
    Some(Picture { width, height, pixels })
}

/// Whether a part of a picture has one colour, that of its first pixel.
fn is_plain(picture: &Picture, columns: std::ops::Range<u32>, rows: std::ops::Range<u32>) -> bool {
    let pixel = |x: u32, y: u32| {
        let at = 3 * (y as usize * picture.width as usize + x as usize);
        &picture.pixels[at..at + 3]
    };
    let first = pixel(columns.start, rows.start);
    let like = |other: &[f32]| other.iter().zip(first).all(|(a, b)| (a - b).abs() <= TOLERANCE);
    rows.into_iter().all(|y| columns.clone().all(|x| like(pixel(x, y))))
}

#[cfg(test)]
mod tests {
    use burn::tensor::Tensor;

    use super::*;

    /// Reads nothing.
    struct Fake {
        exact: bool,
        tones: Tones,
    }

    impl Extractor for Fake {
        fn bits(&self) -> usize {
            64
        }

        fn side(&self) -> usize {
            32
        }

        fn parameters(&self) -> usize {
            0
        }

        fn reads_exact_colours(&self) -> bool {
            self.exact
        }

        fn tones(&self) -> Tones {
            self.tones
        }

        fn logits(&self, _: Tensor<4>) -> Result<Tensor<2>> {
            unreachable!("nothing is read")
        }
    }

    /// A picture whose pixels tell their places.
    fn places(width: u32, height: u32) -> Picture {
        let pixel = |i: u32| [(i % width) as f32 / 64.0, (i / width) as f32 / 64.0, 0.5];
        let pixels = (0..width * height).flat_map(pixel).collect();
        Picture { width, height, pixels }
    }

    fn framed(inner: &Picture, [left, top, right, bottom]: [u32; 4], grey: f32) -> Picture {
        let (width, height) = (left + inner.width + right, top + inner.height + bottom);
        let mut pixels = vec![grey; 3 * (width * height) as usize];
        for y in 0..inner.height {
            let (from, to) = (3 * y * inner.width, 3 * ((top + y) * width + left));
            let len = 3 * inner.width as usize;
            pixels[to as usize..to as usize + len].copy_from_slice(&inner.pixels[from as usize..from as usize + len]);
        }
        Picture { width, height, pixels }
    }

    #[test]
    fn a_quarter_turn_is_counterclockwise_and_four_are_none() {
        let picture = places(3, 2);
        let turn = Hypothesis {
            quarter_turns: 1,
            ..Hypothesis::default()
        };
        let turned = reorient(turn, &picture);
        assert_eq!((turned.width, turned.height), (2, 3));
        // What was at the top right is at the top left.
        assert_eq!(turned.pixels[..3], picture.pixels[6..9]);
        let mut again = picture.clone();
        for quarter_turns in 0..4 {
            let at_once = Hypothesis {
                quarter_turns,
                ..Hypothesis::default()
            };
            assert_eq!(reorient(at_once, &picture), again, "{quarter_turns}");
            again = reorient(turn, &again);
        }
        assert_eq!(again, picture);
    }

    #[test]
    fn the_eight_ways_are_different_and_the_first_is_as_given() {
        let picture = places(5, 5);
        let all: Vec<_> = orientations(false).map(|way| reorient(way, &picture)).collect();
        assert_eq!(all[0], picture);
        for (i, a) in all.iter().enumerate() {
            assert!(all[..i].iter().all(|b| a != b), "{i}");
        }
        let mirrored = all[4].pixels[..3].to_vec();
        assert_eq!(mirrored, picture.pixels[12..15]);
    }

    #[test]
    fn borders_are_cut_off_and_nothing_else() {
        let inner = places(40, 20);
        for border in [[7, 5, 3, 9], [0, 6, 0, 6], [0, 0, 1, 0]] {
            assert_eq!(
                without_borders(&framed(&inner, border, 0.9)),
                Some(inner.clone()),
                "{border:?}"
            );
        }
        assert_eq!(without_borders(&inner), None);
        // A plain picture, and one whose content is too small, are left as they are.
        let plain = framed(&places(0, 0), [30, 30, 0, 0], 0.5);
        assert_eq!(without_borders(&plain), None);
        assert_eq!(without_borders(&framed(&places(8, 8), [20; 4], 0.9)), None);
    }

    #[test]
    fn as_many_hypotheses_are_searched_as_claims_about_pictures_are_told_to_pay_for() {
        let of = |exact, tones| searched_hypotheses(&Fake { exact, tones });
        let exact = of(true, Tones::Searched);
        // 123 tones with borders and without, and 34 parts (docs/verify.md).
        assert_eq!(exact.len(), 280);
        assert_eq!(of(false, Tones::Searched).len(), 16);
        let estimated = of(true, Tones::Estimated);
        assert_eq!(estimated[..2], [Hypothesis::default(), Hypothesis::estimated()]);
        assert_eq!(estimated[4], Hypothesis::estimated_next(4));
        assert_eq!(estimated[5..], exact[1..]);
        assert_eq!(exact[0], Hypothesis::default());
        for (place, hypothesis) in exact.iter().enumerate() {
            assert!(!exact[..place].contains(hypothesis), "{hypothesis}");
        }
    }
}
