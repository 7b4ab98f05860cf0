//! What every view of a scene computes with and no view changes: geometry is frozen.
use super::prepare::{PrepareTimes, PreparedView, WeightCache, prepare_with};
use crate::error::Result;
use crate::scene::{Gaussians, Sh};
use crate::view::Camera;
use rayon::prelude::*;
use std::sync::Arc;

/// Log scales are clamped to this: far beyond any scene, and its fourth power is still finite.
const LOG_SCALE_LIMIT: f32 = 30.0;
/// Rows that are computed by one thread at a time.
const CHUNK: usize = 4096;

/// A scene's geometry as views are prepared from it: scales and opacities are worked out once, 28 bytes a Gaussian.
#[derive(Clone, Debug)]
pub struct Geometry<'a> {
    pub(super) gaussians: &'a Gaussians,
    /// Standard deviations along the three axes.
    pub(super) scales: Arc<Vec<[f64; 3]>>,
    /// In (0, 1), or 0 for Gaussians that are left out.
    pub(super) opacities: Vec<f32>,
}

impl<'a> Geometry<'a> {
    /// Of all Gaussians.
    pub fn new(gaussians: &'a Gaussians) -> Self {
        // A NaN passes the clamp, and is caught when it is projected.
        let scale = |s: &f32| f64::from(s.clamp(-LOG_SCALE_LIMIT, LOG_SCALE_LIMIT)).exp();
        let scales = gaussians.log_scales.par_iter().with_min_len(CHUNK);
        let opacities = (0..gaussians.len()).into_par_iter().with_min_len(CHUNK);
        Self {
            gaussians,
            scales: Arc::new(scales.map(|log_scale| log_scale.each_ref().map(scale)).collect()),
            opacities: opacities.map(|row| gaussians.opacity(row)).collect(),
        }
    }

    /// Gaussians of the scene.
    pub fn len(&self) -> usize {
        self.gaussians.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.gaussians.is_empty()
    }

    /// The scene's colours.
    pub fn sh(&self) -> &'a Sh {
        &self.gaussians.sh
    }

    /// Without the Gaussians for which `left_out` says so, which is asked for their positions in the order of rows. Rows stay
    /// what they were.
    pub fn without(&self, mut left_out: impl FnMut([f32; 3]) -> bool) -> Self {
        let keep = |(opacity, position): (&f32, &[f32; 3])| if left_out(*position) { 0.0 } else { *opacity };
        Self {
            gaussians: self.gaussians,
            scales: self.scales.clone(),
            opacities: self.opacities.iter().zip(&self.gaussians.positions).map(keep).collect(),
        }
    }

    /// Projects, culls and sorts the Gaussians for `camera`; the result does not depend on the number of threads.
    ///
    /// # Errors
    /// [`Error::BadOption`](crate::Error::BadOption) when the camera's size or focal length is out of range, or the view
    /// has too many (Gaussian, tile) pairs for 32-bit lists.
    pub fn prepare(&self, camera: &Camera, cache: WeightCache) -> Result<PreparedView> {
        self.prepare_timed(camera, cache).map(|(view, _)| view)
    }

    /// [`Geometry::prepare`] for a view that stands for a picture `times` as large, at least 1, averaged down to the
    /// camera's size, at the cost of the small one. Splats have no finer detail than their width in both, so this is
    /// near, not exact.
    ///
    /// # Errors
    /// Those of [`Geometry::prepare`].
    pub fn prepare_averaged(&self, camera: &Camera, times: f32, cache: WeightCache) -> Result<PreparedView> {
        prepare_with(self, camera, f64::from(times.max(1.0)), cache).map(|(view, _)| view)
    }

    /// [`Geometry::prepare`], and where its time went.
    ///
    /// # Errors
    /// Those of [`Geometry::prepare`].
    pub fn prepare_timed(&self, camera: &Camera, cache: WeightCache) -> Result<(PreparedView, PrepareTimes)> {
        prepare_with(self, camera, 1.0, cache)
    }
}
