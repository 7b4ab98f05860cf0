//! Looks at many views of a scene: some at a time, side by side.
use rayon::prelude::*;

use super::Engine;
use crate::error::Result;
use crate::picture::Picture;
use crate::splat::{Geometry, PreparedView, sh};

/// Memory for views that are prepared at a time; one view at least.
const AT_ONCE_BYTES: usize = 256 << 20;
/// Bytes of a Gaussian in a view while it is prepared and drawn.
const GAUSSIAN_BYTES: usize = 200;

impl Engine {
    /// Prepares views by their numbers, 0 to `count`, and looks at each; `done` is told in order. Views of a scene of
    /// `gaussians` are prepared side by side, as many as memory is meant for. On the CPU they are drawn side by side as well;
    /// a GPU has one queue, and waiting for it on the threads of a pool could block them all.
    ///
    /// # Errors
    /// The first of `prepare`, `look` and `done`; [`Error::Stopped`](crate::Error::Stopped), which is looked at before each.
    pub(crate) fn each_view<V: Send, O: Send>(
        &self,
        gaussians: usize,
        count: usize,
        prepare: impl Fn(usize) -> Result<V> + Send + Sync,
        look: impl Fn(V) -> Result<O> + Send + Sync,
        mut done: impl FnMut(usize, O) -> Result<()>,
    ) -> Result<()> {
        let at_once = (AT_ONCE_BYTES / (GAUSSIAN_BYTES * gaussians.max(1))).clamp(1, 2 * rayon::current_num_threads());
        let prepare = |index: usize| {
            self.stop.check()?;
            prepare(index)
        };
        for first in (0..count).step_by(at_once) {
            let indices = (first..count.min(first + at_once)).into_par_iter();
            let seen: Vec<O> = if self.on_cpu() {
                indices.map(|index| look(prepare(index)?)).collect::<Result<_>>()?
            } else {
                let views: Vec<V> = indices.map(prepare).collect::<Result<_>>()?;
                views.into_iter().map(&look).collect::<Result<_>>()?
            };
            for (index, seen) in (first..).zip(seen) {
                // Who was told of a view may have asked for the end.
                self.stop.check()?;
                done(index, seen)?;
            }
        }
        Ok(())
    }

    /// The 8-bit picture of a prepared view with its scene's colours.
    ///
    /// # Errors
    /// Those of the renderer.
    pub(crate) fn drawn(&self, geometry: &Geometry<'_>, view: &PreparedView, background: [f32; 3]) -> Result<Picture> {
        let colours = sh::colours(geometry.sh(), None, view);
        Ok(self.rasterizer()?.render(view, &colours, background)?.to_8_bit())
    }
}
