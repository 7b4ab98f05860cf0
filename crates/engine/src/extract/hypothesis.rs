//! Ways to look at a picture that somebody may have turned, mirrored, or put into a frame.
//!
//! Each is read for itself, and each is a hypothesis of its own: whoever decides on the best of them pays for all.
use super::Engine;
use super::photometric::{Guess, guesses, read_guesses};
use super::window::Window;
use crate::error::Result;
use crate::picture::Picture;

/// How far values of a border may be from its corner's: what JPEG does to a plain colour.
const TOLERANCE: f32 = 8.0 / 255.0;
/// Pixels a side that are left at least; less is nothing to read.
const LEAST_SIDE: u32 = 16;

/// What is done to a picture before it is read: borders are cut off, then it is turned, then mirrored.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Framing {
    /// Counterclockwise, 0 to 3.
    pub quarter_turns: u8,
    /// Left and right are exchanged.
    pub mirrored: bool,
    /// Borders of one colour are cut off.
    pub trimmed: bool,
    /// What is guessed to have been done to its tones, and undone.
    pub undone: Guess,
    /// A part of it is read, the rest is not.
    pub window: Option<Window>,
}

impl std::fmt::Display for Framing {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.undone.fmt(f)?;
        if self.quarter_turns > 0 {
            write!(f, ", turned by {} degrees", 90 * u32::from(self.quarter_turns))?;
        }
        if self.mirrored {
            f.write_str(", mirrored")?;
        }
        if self.trimmed {
            f.write_str(", without borders")?;
        }
        if let Some(window) = self.window {
            write!(f, ", {window}")?;
        }
        Ok(())
    }
}

impl Framing {
    /// The eight ways to lay a picture on a table, as given first; with borders or `trimmed`.
    pub fn laid(trimmed: bool) -> impl Iterator<Item = Self> {
        [false, true].into_iter().flat_map(move |mirrored| {
            (0..4).map(move |quarter_turns| Self {
                quarter_turns,
                mirrored,
                trimmed,
                ..Self::default()
            })
        })
    }

    /// A part of a picture, as it is.
    pub fn of(window: Window) -> Self {
        Self {
            window: Some(window),
            ..Self::default()
        }
    }

    /// The ways that this engine tries on a picture, as given first; with borders or `trimmed`. How a picture lies makes no
    /// difference to an average over its pixels, so where exact colours are read it is tones that are guessed.
    pub fn tried(engine: &Engine, trimmed: bool) -> Vec<Self> {
        if !engine.extractor.reads_exact_colours() {
            return Self::laid(trimmed).collect();
        }
        let guessed = guesses(engine).into_iter().map(|undone| Self {
            trimmed,
            undone,
            ..Self::default()
        });
        guessed.collect()
    }

    /// Logits of a picture in each of these ways, in their order; its borders, if they are to go, were cut off before.
    ///
    /// # Errors
    /// A picture without pixels, a failing device, or [`Error::Stopped`](crate::Error::Stopped).
    pub fn read(engine: &Engine, picture: &Picture) -> Result<Vec<Vec<f32>>> {
        if engine.extractor.reads_exact_colours() {
            return read_guesses(engine, picture);
        }
        // One at a time: a large picture need not fit in memory eight times.
        let laid = Self::laid(false).map(|framing| Ok(engine.read_logits(&[framing.lay(picture)])?.swap_remove(0)));
        laid.collect()
    }

    /// The picture turned and mirrored; its borders, if they are to go, were cut off before.
    fn lay(self, picture: &Picture) -> Picture {
        let (w, h) = (picture.width as usize, picture.height as usize);
        let (width, height) = match self.quarter_turns % 2 {
            0 => (w, h),
            _ => (h, w),
        };
        let mut pixels = Vec::with_capacity(picture.pixels.len());
        for y in 0..height {
            for column in 0..width {
                let x = if self.mirrored { width - 1 - column } else { column };
                // Where a pixel of the turned picture was before.
                let (x, y) = match self.quarter_turns % 4 {
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
    use super::*;

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
        let turn = Framing {
            quarter_turns: 1,
            ..Framing::default()
        };
        let turned = turn.lay(&picture);
        assert_eq!((turned.width, turned.height), (2, 3));
        // What was at the top right is at the top left.
        assert_eq!(turned.pixels[..3], picture.pixels[6..9]);
        let mut again = picture.clone();
        for quarter_turns in 0..4 {
            let at_once = Framing {
                quarter_turns,
                ..Framing::default()
            };
            assert_eq!(at_once.lay(&picture), again, "{quarter_turns}");
            again = turn.lay(&again);
        }
        assert_eq!(again, picture);
    }

    #[test]
    fn the_eight_ways_are_different_and_the_first_is_as_given() {
        let picture = places(5, 5);
        let all: Vec<_> = Framing::laid(false).map(|framing| framing.lay(&picture)).collect();
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
}
