//! Registration: from where a picture of a scene was taken is found with the unmarked original at hand, and the picture is
//! read as it differs from the original there.
//!
//! ```text
//! picture ── guesses: 320 views of the original, ── refined: 24 cameras at 48 px … 1 at its own size ── camera
//!            laid over it at 7 sizes                  (least squares, tones fitted along)                  │
//!                                                                                                        ▼
//!            logits ◄── tower ◄── original on white + (picture − original), where the original covers it
//! ```
//!
//! So whatever is behind the scene, and whatever else is in the picture, is gone, and what was done to its tones is seen
//! from two pictures of one view instead of being guessed. Besides, it is read without the tower, by a matched
//! filter (`matched_filter.rs`). Picture, original and key decide all of it: a message that is claimed has no part, so a p-value
//! pays for the two ways in which tones are taken and for the filter, and for nothing else.
//!
//! A camera has nine numbers: where it is, how it is turned, its focal length, and its principal point, since a picture may
//! be cropped. No gradient to them exists in the rasteriser, so slopes are differences of small views.
mod bit_changes;
mod coarse;
mod common_colours;
mod drawn;
mod fit;
mod least_squares;
mod matched_filter;
mod observed;
mod overlay;
mod pose;
mod reading;
mod refine;
#[cfg(test)]
mod tests;
mod tone;

use crate::error::Result;
use crate::extract::Engine;
use crate::picture::Picture;
use crate::scene::Gaussians;
use crate::splat::Geometry;
use crate::view::{Camera, ViewSampler};
pub use bit_changes::MATCHED_FILTER_BYTES;
use coarse::guesses;
use fit::Fit;
pub use matched_filter::RegisteredPicture;
use observed::Observed;
use pose::dollied;
use refine::{Freedoms, refined};

/// Share of a picture's variance, where the original is seen, that a registration explains at least. Wrong ones explained up
/// to 0.82, right ones from 0.93 on (`docs/verify.md`, "With the original").
const EXPLAINED: f64 = 0.85;

/// Share of a picture that the original covers at least: the colours of fewer pixels are met by chance.
const COVERED: f64 = 0.03;

/// A size at which cameras are refined.
struct Stage {
    /// Longer side of the picture, pixels.
    side: u32,
    /// How many of the best cameras so far are refined.
    cameras: usize,
    /// The best is refined from so many times as far with as much longer a lens, too: a valley in which fits get stuck.
    dollies: &'static [f32],
    /// How often, at most.
    rounds: usize,
    freedoms: Freedoms,
}

/// From many cameras at a small size to one at the size of screenshots. The principal point is hardly told from a turn, and
/// left alone until the rest is right.
const STAGES: [Stage; 8] = {
    const fn stage(side: u32, cameras: usize, dollies: &'static [f32], rounds: usize, freedoms: Freedoms) -> Stage {
        Stage {
            side,
            cameras,
            dollies,
            rounds,
            freedoms,
        }
    }
    [
        stage(48, 24, &[], 2, Freedoms::Centred),
        stage(48, 8, &[], 4, Freedoms::Centred),
        stage(48, 2, &[0.5, 0.64, 0.8, 1.25, 1.56, 2.0], 5, Freedoms::Centred),
        stage(48, 2, &[0.87, 0.93, 1.07, 1.15], 6, Freedoms::Centred),
        stage(96, 3, &[], 8, Freedoms::Centred),
        stage(192, 2, &[], 6, Freedoms::Centred),
        stage(384, 1, &[], 6, Freedoms::All),
        stage(800, 1, &[], 3, Freedoms::All),
    ]
};

/// The unmarked scene, with which pictures are registered.
pub struct Original<'a> {
    engine: &'a Engine,
    geometry: Geometry<'a>,
    sampler: ViewSampler,
}

/// Where a picture was taken from.
#[derive(Clone, Debug, PartialEq)]
pub struct Registration {
    /// The camera, of the picture's size or of 800 pixels along its longer side.
    pub camera: Camera,
    /// Share of the picture's variance that the original explains where it is seen, its tones fitted.
    pub explained: f64,
    /// Share of the picture that the original covers.
    pub covered: f64,
}

impl<'a> Original<'a> {
    /// Of a scene whose viewers are where `sampler` has them.
    pub fn new(engine: &'a Engine, gaussians: &'a Gaussians, sampler: ViewSampler) -> Self {
        Self {
            engine,
            geometry: Geometry::new(gaussians),
            sampler,
        }
    }

    /// Where a picture was taken from; `None` where no camera explains it.
    ///
    /// # Errors
    /// A picture without pixels, a failing device, or [`Error::Stopped`](crate::Error::Stopped).
    pub fn register(&self, picture: &Picture) -> Result<Option<Registration>> {
        let mut cameras = guesses(self, picture, STAGES[0].cameras)?;
        let mut best: Option<Fit> = None;
        for stage in STAGES {
            let observed = Observed::of(picture, stage.side)?;
            cameras.truncate(stage.cameras);
            if let Some(best) = cameras.first().map(|best| observed.camera(best)) {
                let depth = self.depth(&best);
                cameras.extend(stage.dollies.iter().map(|times| dollied(&best, depth, *times)));
            }
            let mut fits = self.engine.each(&cameras, |camera| {
                refined(self, &observed, camera, stage.freedoms, stage.rounds)
            })?;
            fits.sort_by(|a, b| b.score().total_cmp(&a.score()));
            cameras = fits.iter().map(|fit| fit.camera.clone()).collect();
            best = fits.into_iter().next();
        }
        let registration = best.map(|fit| Registration {
            camera: fit.camera,
            explained: fit.explained,
            covered: fit.covered,
        });
        Ok(registration.filter(|found| found.explained >= EXPLAINED && found.covered >= COVERED))
    }

    /// How far in front of a camera the scene is.
    fn depth(&self, camera: &Camera) -> f64 {
        let extent = self.sampler.extent();
        let ahead = camera.to_camera(extent.centre)[2];
        f64::from(ahead.max(0.3 * extent.radius))
    }
}
