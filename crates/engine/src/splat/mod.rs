//! Splatting: pictures of a scene, and the gradient of a picture to the colours of its Gaussians.
//!
//! Geometry is frozen, so a pixel is `sum_i w_i max(0, SH_i(d) + 0.5) + T background` with weights that do not depend on
//! what is learned. [`Geometry::prepare`] computes per view what stays fixed; a [`Rasterizer`] applies it and its transpose.
#[cfg(test)]
mod checks;
pub mod compare;
mod composite;
mod cpu;
mod geometry;
mod gpu;
mod learnable;
mod prepare;
mod project;
pub mod reference;
pub mod sh;
mod tiles;
mod weights;

use rayon::prelude::*;

use crate::error::Result;
use crate::picture::Picture;

pub use cpu::CpuRasterizer;
pub use geometry::Geometry;
pub use gpu::GpuRasterizer;
pub(crate) use gpu::{Chunk, PackedView, SceneOnDevice, Shown};
pub use learnable::{Changes, Learnable};
pub use prepare::{PrepareTimes, PreparedView, WeightCache, prepare};
pub use project::Splat2d;
pub use tiles::{MAX_PAIRS, TILE, TileLists};

/// A view, and what it is drawn with.
#[derive(Clone, Copy, Debug)]
pub struct Drawing<'a> {
    /// What stays fixed.
    pub view: &'a PreparedView,
    /// `[visible][3]`, as [`sh::colours`] returns them.
    pub colours: &'a [f32],
    /// Colour of the ground.
    pub background: [f32; 3],
}

/// Draws prepared views; both implementations are deterministic and agree with [`reference`].
pub trait Rasterizer: Send + Sync {
    /// Where it runs, for people.
    fn name(&self) -> &str;

    /// The same rasteriser, where pictures can stay on its device.
    fn on_device(&self) -> Option<&GpuRasterizer> {
        None
    }

    /// The picture of `view` with `colours` (`[visible][3]`, as [`sh::colours`] returns them) over `background`.
    ///
    /// # Errors
    /// When `colours` has another length, or the device fails.
    fn render(&self, view: &PreparedView, colours: &[f32], background: [f32; 3]) -> Result<Picture>;

    /// Gradient to the colours (`[visible][3]`) from the gradient to the picture (`[height][width][3]`).
    ///
    /// # Errors
    /// When `picture_gradient` has another length, or the device fails.
    fn backward(&self, view: &PreparedView, picture_gradient: &[f32]) -> Result<Vec<f32>>;

    /// The pictures of many views, side by side.
    ///
    /// # Errors
    /// Those of [`Rasterizer::render`].
    fn render_all(&self, drawings: &[Drawing<'_>]) -> Result<Vec<Picture>> {
        let render = |drawing: &Drawing<'_>| self.render(drawing.view, drawing.colours, drawing.background);
        drawings.par_iter().map(render).collect()
    }

    /// Gradients to the colours of many views, side by side.
    ///
    /// # Errors
    /// Those of [`Rasterizer::backward`].
    fn backward_all(&self, views: &[&PreparedView], gradients: &[Picture]) -> Result<Vec<Vec<f32>>> {
        let pairs = views.par_iter().zip(gradients);
        pairs
            .map(|(view, gradient)| self.backward(view, &gradient.pixels))
            .collect()
    }
}
