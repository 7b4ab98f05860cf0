//! From where a picture may have been taken: small views of the original are laid over it at several sizes and places.
use rayon::prelude::*;

use super::Original;
use super::drawn::Drawn;
use super::observed::Observed;
use crate::error::Result;
use crate::extract::stands_for;
use crate::picture::Picture;
use crate::resize::resized;
use crate::view::{Camera, Split};

/// Longer side of the picture, and side of views, pixels.
const SIDE: u32 = 32;
/// Views that are tried: any run of them is spread evenly over where viewers are.
const VIEWS: u64 = 320;
/// How large a view is laid over the picture, times the picture's shorter side.
const SIZES: [f32; 7] = [0.35, 0.5, 0.7, 0.85, 1.0, 1.25, 1.7];
/// Pixels between two places that are tried.
const STEP: i32 = 2;
/// Share of what a view shows that must lie in the picture, and the least of it in pixels.
const INSIDE: f32 = 0.25;
const LEAST: f32 = 6.0;
/// What contrast may have been multiplied by: with none left anything looks like anything.
const CONTRAST: [f32; 2] = [0.4, 2.5];

/// The best cameras, best first, one of each view.
///
/// # Errors
/// A picture without pixels, a failing device, or [`Error::Stopped`](crate::Error::Stopped).
pub(super) fn guesses(original: &Original<'_>, picture: &Picture, count: usize) -> Result<Vec<Camera>> {
    let observed = Observed::of(picture, SIDE)?;
    let views: Vec<u64> = (0..VIEWS).collect();
    let best = original.engine.each(&views, |index| {
        let camera = original.sampler.camera(Split::Training, *index, SIDE);
        let drawn = Drawn::of(original.engine, &original.geometry, &camera, stands_for(SIDE))?;
        let laid = SIZES
            .par_iter()
            .map(|size| laid_over(&observed, &camera, &drawn, *size));
        let laid: Vec<Option<Guess>> = laid.collect::<Result<_>>()?;
        Ok(laid.into_iter().flatten().max_by(|a, b| a.score.total_cmp(&b.score)))
    })?;
    let mut best: Vec<Guess> = best.into_iter().flatten().collect();
    best.sort_by(|a, b| b.score.total_cmp(&a.score));
    best.truncate(count);
    Ok(best.into_iter().map(|guess| guess.camera).collect())
}

struct Guess {
    camera: Camera,
    /// More is better.
    score: f32,
}

/// The best place of a view that is so many times as large as the picture.
fn laid_over(observed: &Observed, camera: &Camera, drawn: &Drawn, size: f32) -> Result<Option<Guess>> {
    let shorter = observed.width.min(observed.height) as f32;
    let side = (size * shorter).round().max(4.0);
    let view = View::of(drawn, side as usize)?;
    let starts = |length: usize| {
        let half = view.side / 2;
        (-half..=length as i32 - half).step_by(STEP as usize)
    };
    let places = starts(observed.height).flat_map(|y| starts(observed.width).map(move |x| [x, y]));
    let scored = places.filter_map(|place| Some((view.score(observed, place)?, place)));
    let best = scored.max_by(|(a, _), (b, _)| a.total_cmp(b));
    let zoom = side / SIDE as f32;
    Ok(best.map(|(score, [x, y])| Guess {
        score,
        camera: Camera {
            width: observed.width as u32,
            height: observed.height as u32,
            fx: camera.fx * zoom,
            fy: camera.fy * zoom,
            cx: camera.cx * zoom + x as f32,
            cy: camera.cy * zoom + y as f32,
            ..camera.clone()
        },
    }))
}

/// A view of the original.
struct View {
    side: i32,
    /// Red, green and blue over black, and coverage.
    pixels: Vec<[f32; 4]>,
    covered: f32,
}

impl View {
    fn of(drawn: &Drawn, side: usize) -> Result<Self> {
        let small = |pixels: Vec<f32>| {
            let picture = Picture {
                width: SIDE,
                height: SIDE,
                pixels,
            };
            resized(&picture, side, side)
        };
        let colours = small(drawn.colours.as_flattened().to_vec())?;
        let coverage = small(drawn.coverage.iter().flat_map(|coverage| [*coverage; 3]).collect())?;
        let pairs = colours
            .pixels
            .as_chunks::<3>()
            .0
            .iter()
            .zip(coverage.pixels.as_chunks::<3>().0);
        let pixels: Vec<[f32; 4]> = pairs.map(|(c, coverage)| [c[0], c[1], c[2], coverage[0]]).collect();
        Ok(Self {
            side: side as i32,
            covered: pixels.iter().map(|pixel| pixel[3]).sum(),
            pixels,
        })
    }

    /// How well the view explains the picture with its upper left corner here; `None` where too little of it is inside.
    fn score(&self, observed: &Observed, [left, top]: [i32; 2]) -> Option<f32> {
        let (width, height) = (observed.width as i32, observed.height as i32);
        let (columns, rows) = (
            (-left).max(0)..self.side.min(width - left),
            (-top).max(0)..self.side.min(height - top),
        );
        let pairs = rows.flat_map(|row| {
            let view = &self.pixels[(row * self.side + columns.start) as usize..][..columns.len()];
            let seen = &observed.pixels[((row + top) * width + columns.start + left) as usize..];
            view.iter().zip(seen)
        });
        let least = (INSIDE * self.covered).max(LEAST);
        match observed.ground {
            Some(ground) => over_ground(pairs, ground, least),
            None => over_anything(pairs, least),
        }
    }
}

/// How much smaller the squared differences from the picture are with the view than with the ground alone.
fn over_ground<'a>(
    pairs: impl Iterator<Item = (&'a [f32; 4], &'a [f32; 3])>,
    ground: [f32; 3],
    least: f32,
) -> Option<f32> {
    let (mut covered, mut gained) = (0.0, 0.0);
    for (view, seen) in pairs {
        covered += view[3];
        for k in 0..3 {
            let shown = view[k] + (1.0 - view[3]) * ground[k];
            gained += (seen[k] - ground[k]).powi(2) - (seen[k] - shown).powi(2);
        }
    }
    (covered >= least).then_some(gained)
}

/// How much of the variance under the view it explains, where each channel may be brighter and of more contrast: by the
/// square root of the pixels times the logarithm of all over what is left.
fn over_anything<'a>(pairs: impl Iterator<Item = (&'a [f32; 4], &'a [f32; 3])>, least: f32) -> Option<f32> {
    // Weights, and sums over them of the view, its squares, the picture, its squares, and products.
    let (mut count, mut sums) = (0.0, [[0.0_f32; 3]; 5]);
    for (view, seen) in pairs.filter(|(view, _)| view[3] > 0.5) {
        count += view[3];
        for k in 0..3 {
            let (shown, seen) = (view[k] / view[3], seen[k]);
            let terms = [shown, shown * shown, seen, seen * seen, shown * seen];
            sums.iter_mut()
                .zip(terms)
                .for_each(|(sum, term)| sum[k] += view[3] * term);
        }
    }
    if count < least {
        return None;
    }
    let (mut all, mut left) = (0.0, 0.0);
    for k in 0..3 {
        let [shown, shown_squares, seen, seen_squares, products] = sums.map(|sum| sum[k]);
        let variance = seen_squares - seen * seen / count;
        let of_view = shown_squares - shown * shown / count;
        let common = products - shown * seen / count;
        let contrast = (common / of_view.max(1e-6)).clamp(CONTRAST[0], CONTRAST[1]);
        all += variance;
        left += variance - 2.0 * contrast * common + contrast * contrast * of_view;
    }
    (all > 1e-6 && left > 0.0).then(|| count.sqrt() * (all / left).ln())
}
