//! Restoration: what is not of the scene is taken out of a picture before it is read.
//!
//! - **Uneven light.** Dark corners, or light from one side, as a [ground](uneven) shows it.
//! - **A backdrop**, as a [gradient](backdrop) behind the scene. Where it is so bright that it may be uneven light, both are
//!   tried.
//! - **What several pictures show alike**, as a photograph or a page [behind](static_background) all of them, where pictures are
//!   searched. As they were given they are read with it.
//! - **Noise.** A tower of sines reads exact colours, so that noise blurs what it reads. Worse, a white ground with noise is
//!   not white any more: values beyond white are cut, which leaves it darker by four tenths of the noise, and a ground covers
//!   more of a picture than the scene does.
//! - **Plain areas with sharp edges**: covers and boxes that somebody drew.
//! - **A plain ground**, where a picture is read as it was given. It says nothing of the scene, but covers more of a picture.
//!   White and black add nothing to a reading; JPEG makes 253 or 254 of white at some qualities, and viewers have grey ones.
//!   Elsewhere it is kept, for it tells what was done to its white.
//!
//! Nothing is guessed: the picture alone decides, so that no claim pays for it.
mod backdrop;
mod median;
mod noise;
mod plain;
mod smooth_ground;
mod static_background;
mod uneven;

use std::borrow::Cow;

use super::Engine;
use super::photometric::ground;
use super::sizes::{read_all_at_sizes, read_at_sizes};
use crate::error::Result;
use crate::picture::Picture;
use smooth_ground::SmoothGround;
pub use static_background::StaticBackground;

/// Noise from which on a picture is restored, as a standard deviation: one step of 8 bits.
const NOISE: f32 = 1.0 / 255.0;
/// Side of the median's window, of the shorter side of a picture: 7 of 800 pixels, where it costs clean pictures nothing.
const WINDOW: f32 = 7.0 / 800.0;
/// Bounds of that side.
const RADIUS: [usize; 2] = [1, 7];

/// Logits of a picture that somebody gave, restored where the extractor reads exact colours.
///
/// # Errors
/// A picture without pixels, a failing device, or [`Error::Stopped`](crate::Error::Stopped).
pub fn read_given(engine: &Engine, picture: &Picture) -> Result<Vec<f32>> {
    read_restored(engine, &Restored::of(engine, picture).picture)
}

/// Logits of a picture that was restored, as it was given.
///
/// # Errors
/// Those of [`read_given`].
pub(super) fn read_restored(engine: &Engine, restored: &Picture) -> Result<Vec<f32>> {
    let on_white = match engine.extractor.reads_exact_colours() {
        true => ground::without_plain(restored),
        false => None,
    };
    let picture = on_white.as_ref().unwrap_or(restored);
    read_at_sizes(engine, picture)
}

/// Logits of each of some views that the engine rendered: as [`read_given`], but for noise. A render has none, and what is taken
/// for it would be the texture of the scene.
///
/// # Errors
/// Those of [`read_given`].
pub fn read_rendered(engine: &Engine, pictures: &[Picture]) -> Result<Vec<Vec<f32>>> {
    let pictures: Vec<Cow<'_, Picture>> = pictures.iter().map(Cow::Borrowed).collect();
    let restored = engine.each(&pictures, |picture| {
        Ok(match engine.extractor.reads_exact_colours() {
            true => without_plain_areas(picture.clone()),
            false => picture.clone(),
        })
    })?;
    read_all_at_sizes(engine, &restored)
}

/// A picture as it is read.
pub(super) struct Restored<'a> {
    /// As it is where there is nothing to take out, or the extractor does not read exact colours.
    pub picture: Cow<'a, Picture>,
    /// Without its backdrop, where what was taken for uneven light may be one.
    pub without_backdrop: Option<Picture>,
}

impl<'a> Restored<'a> {
    /// That of a picture that somebody gave.
    pub fn of(engine: &Engine, picture: &'a Picture) -> Self {
        if !engine.extractor.reads_exact_colours() {
            return Self::without_alternative(Cow::Borrowed(picture));
        }
        let Some(ground) = SmoothGround::seen(picture) else {
            return Self::without_alternative(cleared(Cow::Borrowed(picture)));
        };
        let without_backdrop = cleared(Cow::Owned(backdrop::taken_out(picture, &ground)));
        match uneven::evened(picture, &ground) {
            Some(even) => Self {
                picture: cleared(Cow::Owned(even)),
                without_backdrop: Some(without_backdrop.into_owned()),
            },
            None => Self::without_alternative(without_backdrop),
        }
    }

    fn without_alternative(picture: Cow<'a, Picture>) -> Self {
        Self {
            picture,
            without_backdrop: None,
        }
    }
}

/// Without noise and plain areas.
fn cleared(picture: Cow<'_, Picture>) -> Cow<'_, Picture> {
    let clear = match noise::deviation(&picture) >= NOISE {
        true => Cow::Owned(without_noise(&picture)),
        false => picture,
    };
    without_plain_areas(clear)
}

fn without_plain_areas(picture: Cow<'_, Picture>) -> Cow<'_, Picture> {
    plain::without_plain_areas(&picture).map_or(picture, Cow::Owned)
}

/// The picture after a median filter, its ground in the one colour that it had.
fn without_noise(picture: &Picture) -> Picture {
    let side = WINDOW * picture.width.min(picture.height) as f32;
    let radius = (side / 2.0).round() as usize;
    let smooth = median::filtered(picture, radius.clamp(RADIUS[0], RADIUS[1]));
    let before = ground::before_noise(picture);
    // Noise that was cut at white or black tells a ground by itself; what is left of it may be far from one colour.
    let seen = match ground::is_clean(before) {
        true => ground::of_border(&smooth),
        false => ground::seen(&smooth),
    };
    match seen {
        Some(seen) => ground::replaced(&smooth, seen, before),
        None => smooth,
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// A disc with a gradient on white.
    fn disc(side: u32) -> Picture {
        let pixels = (0..side * side).flat_map(|i| {
            let (x, y) = ((i % side) as f32 / side as f32, (i / side) as f32 / side as f32);
            match (x - 0.5).hypot(y - 0.5) < 0.3 {
                true => [0.5 * x, 0.4, 0.2 + 0.3 * y],
                false => [1.0; 3],
            }
        });
        Picture {
            width: side,
            height: side,
            pixels: pixels.collect(),
        }
    }

    /// Normal noise of this deviation, in 8 bits.
    fn noisy(picture: &Picture, deviation: f32) -> Picture {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let normal = rand_distr::Normal::new(0.0, deviation).unwrap();
        let pixels = picture.pixels.iter().map(|v| v + rng.sample(normal)).collect();
        Picture { pixels, ..*picture }.to_8_bit()
    }

    fn mean_difference(a: &Picture, b: &Picture) -> f32 {
        let sum: f32 = a.pixels.iter().zip(&b.pixels).map(|(a, b)| (a - b).abs()).sum();
        sum / a.pixels.len() as f32
    }

    #[test]
    fn noise_goes_and_the_ground_is_what_it_was() {
        let clean = disc(400);
        for deviation in [0.02, 0.05, 0.1] {
            let before = noisy(&clean, deviation);
            let after = without_noise(&before);
            assert_eq!(after.pixels[..3], [1.0; 3], "{deviation}");
            let [before, after] = [&before, &after].map(|picture| mean_difference(picture, &clean));
            assert!(after < 0.25 * before, "{deviation}: {before} {after}");
        }
    }

    #[test]
    fn clean_and_compressed_pictures_have_no_noise_and_little_noise_is_seen() {
        let clean = disc(400).to_8_bit();
        assert!(noise::deviation(&clean) < NOISE);
        for deviation in [0.015, 0.05, 0.1] {
            let found = noise::deviation(&noisy(&clean, deviation));
            assert!(found >= NOISE && found <= deviation, "{deviation}: {found}");
        }
        let none = Picture {
            width: 0,
            height: 0,
            pixels: vec![],
        };
        assert_eq!(noise::deviation(&none), 0.0);
    }
}
