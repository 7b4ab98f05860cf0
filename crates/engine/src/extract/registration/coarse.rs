//! From where a picture may have been taken: small views of the original are laid over it at several sizes and places.
use rayon::prelude::*;

use super::Original;
use super::drawn::Drawn;
use super::overlay::{ObservedColours, View};
use crate::error::Result;
use crate::extract::stands_for;
use crate::picture::Picture;
use crate::view::{Camera, Split};

/// Longer side of the picture, and side of views, pixels.
const SIDE: u32 = 32;
/// Views that are tried: any run of them is spread evenly over where viewers are.
const VIEWS: u64 = 320;
/// How large a view is laid over the picture, times the picture's shorter side.
const SIZES: [f32; 7] = [0.35, 0.5, 0.7, 0.85, 1.0, 1.25, 1.7];
/// Pixels between two places that are tried.
const STEP: i32 = 2;

/// The best cameras by [each measure](View::scores) in turn, best first, of each view at most one of each: one measure finds
/// views that the other does not.
///
/// # Errors
/// A picture without pixels, a failing device, or [`Error::Stopped`](crate::Error::Stopped).
pub(super) fn guesses(original: &Original<'_>, picture: &Picture, count: usize) -> Result<Vec<Camera>> {
    let seen = ObservedColours::of(picture, SIDE)?;
    let views: Vec<u64> = (0..VIEWS).collect();
    let best = original.engine.each(&views, |index| {
        let camera = original.sampler.camera(Split::Training, *index, SIDE);
        let drawn = Drawn::of(original.engine, &original.geometry, &camera, stands_for(SIDE))?;
        let laid = SIZES.par_iter().map(|size| laid_over(&seen, &camera, &drawn, *size));
        let laid: Vec<[Option<Guess>; 2]> = laid.collect::<Result<_>>()?;
        let best = |measure: usize| {
            let laid = laid.iter().filter_map(|both| both[measure].clone());
            laid.max_by(|a, b| a.score.total_cmp(&b.score))
        };
        Ok([best(0), best(1)])
    })?;
    let best = [0, 1].map(|measure| {
        let mut best: Vec<&Guess> = best.iter().filter_map(|both| both[measure].as_ref()).collect();
        best.sort_by(|a, b| b.score.total_cmp(&a.score));
        best
    });
    let longest = best[0].len().max(best[1].len());
    let in_turn = (0..longest).flat_map(|rank| best.iter().filter_map(move |best| best.get(rank)));
    let mut cameras: Vec<Camera> = Vec::with_capacity(count);
    for guess in in_turn {
        if cameras.len() < count && !cameras.contains(&guess.camera) {
            cameras.push(guess.camera.clone());
        }
    }
    Ok(cameras)
}

#[derive(Clone)]
struct Guess {
    camera: Camera,
    /// More is better.
    score: f32,
}

/// The best places of a view that is so many times as large as the picture, by each measure.
fn laid_over(seen: &ObservedColours, camera: &Camera, drawn: &Drawn, size: f32) -> Result<[Option<Guess>; 2]> {
    let observed = &seen.observed;
    let shorter = observed.width.min(observed.height) as f32;
    let side = (size * shorter).round().max(4.0);
    let view = View::of(drawn, SIDE, side as usize)?;
    let starts = |length: usize| {
        let half = view.side / 2;
        (-half..=length as i32 - half).step_by(STEP as usize)
    };
    let places = starts(observed.height).flat_map(|y| starts(observed.width).map(move |x| [x, y]));
    let mut best: [Option<(f32, [i32; 2])>; 2] = [None; 2];
    for place in places {
        for (best, score) in best.iter_mut().zip(view.scores(seen, place)) {
            if let Some(score) = score.filter(|score| best.is_none_or(|(most, _)| score.total_cmp(&most).is_ge())) {
                *best = Some((score, place));
            }
        }
    }
    let zoom = side / SIDE as f32;
    Ok(best.map(|best| {
        best.map(|(score, [x, y])| Guess {
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
        })
    }))
}
