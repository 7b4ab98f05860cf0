//! Parts of a picture that are read for themselves: a screenshot may show the scene somewhere on a page.
//!
//! A CLIP that averages over a picture reads a mark from any part of the scene, and whatever else the picture shows only
//! adds to it. So the part need not fit the scene: it is to lie inside of it.
use std::ops::Range;

use guardsplat_codeword::{WINDOW_STEPS as STEPS, Window};

use super::Engine;
use crate::error::Result;
use crate::picture::Picture;

/// Sides of windows, and what lies from one to the next: halves by quarters, thirds by sixths.
const TRIED: [(u32, u32); 2] = [(6, 3), (4, 2)];
/// Pixels of a window's shorter side, at least; less is nothing to read.
const LEAST_SIDE: u32 = 16;

/// All windows that are read: 9 halves and 25 thirds.
pub(super) fn windows() -> impl Iterator<Item = Window> {
    TRIED.into_iter().flat_map(|(side, step)| {
        let places = move || (0..=STEPS - side).step_by(step as usize);
        places().flat_map(move |top| places().map(move |left| Window { left, top, side }))
    })
}

/// All windows of a picture; none where it is too small for them.
pub(super) fn windows_of(picture: &Picture) -> impl Iterator<Item = Window> {
    let least = TRIED.iter().map(|(side, _)| *side).min().unwrap_or(STEPS);
    let large = picture.width.min(picture.height) * least / STEPS >= LEAST_SIDE;
    windows().filter(move |_| large)
}

/// Logits of a picture in each of these windows, in their order; `None` where the picture is too small for them.
///
/// # Errors
/// A failing device, or [`Error::Stopped`](crate::Error::Stopped).
pub(super) fn read_windows(engine: &Engine, picture: &Picture) -> Result<Option<Vec<Vec<f32>>>> {
    let windows: Vec<Window> = windows_of(picture).collect();
    if windows.is_empty() {
        return Ok(None);
    }
    Ok(Some(engine.read_logits(&small(engine, &windows, picture)?)?))
}

/// Windows of a picture, at the side that the extractor takes in.
///
/// # Errors
/// A picture without pixels, or [`Error::Stopped`](crate::Error::Stopped).
pub(super) fn small(engine: &Engine, windows: &[Window], picture: &Picture) -> Result<Vec<Picture>> {
    engine.each(windows, |window| engine.resized_part(place(*window, picture), picture))
}

/// Columns and rows of a window.
fn place(window: Window, picture: &Picture) -> [Range<usize>; 2] {
    let place = |side: u32, twelfths: u32| (u64::from(side) * u64::from(twelfths) / u64::from(STEPS)) as usize;
    [(window.left, picture.width), (window.top, picture.height)]
        .map(|(first, side)| place(side, first)..place(side, first + window.side))
}

/// A part of a picture.
pub(super) fn crop(window: Window, picture: &Picture) -> Picture {
    let [columns, rows] = place(window, picture);
    let row = |y: usize| &picture.pixels[3 * (y * picture.width as usize + columns.start)..][..3 * columns.len()];
    Picture {
        width: columns.len() as u32,
        height: rows.len() as u32,
        pixels: rows.flat_map(row).copied().collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_lie_inside_and_every_scene_of_half_a_page_holds_one() {
        let all: Vec<Window> = windows().collect();
        assert_eq!(all.len(), 34);
        assert!(all.iter().all(|w| w.left + w.side <= STEPS && w.top + w.side <= STEPS));
        // Along one side, in hundredths: wherever half of it is the scene, a window lies within.
        for start in 0..=50 {
            let within = |w: &Window| w.left * 100 >= start * STEPS && (w.left + w.side) * 100 <= (start + 50) * STEPS;
            assert!(all.iter().any(within), "{start}");
        }
    }

    #[test]
    fn a_window_is_that_part_of_the_picture() {
        let (width, height) = (25_u32, 14_u32);
        let pixels = (0..width * height).flat_map(|i| [(i % width) as f32, (i / width) as f32, 0.0]);
        let picture = Picture {
            width,
            height,
            pixels: pixels.collect(),
        };
        let window = Window {
            left: 3,
            top: 6,
            side: 6,
        };
        let part = crop(window, &picture);
        // From a quarter to three quarters of 25, and the lower half of 14.
        assert_eq!((part.width, part.height), (12, 7));
        assert_eq!(part.pixels[..3], [6.0, 7.0, 0.0]);
        assert_eq!(part.pixels[part.pixels.len() - 3..], [17.0, 13.0, 0.0]);
        assert_eq!(window.to_string(), "50 % of its sides from 25 % right and 50 % down");
    }
}
