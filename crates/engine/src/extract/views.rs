//! Looks at many views of a scene: some at a time, side by side.
use rayon::prelude::*;

use super::Engine;
use crate::error::Result;
use crate::picture::Picture;
use crate::splat::{Drawing, Geometry, PreparedView, sh};

/// Memory for views that are prepared at a time; one view at least.
const AT_ONCE_BYTES: usize = 256 << 20;
/// Bytes of a Gaussian in a view while it is prepared and drawn.
const GAUSSIAN_BYTES: usize = 200;

impl Engine {
    /// Prepares views by their numbers, 0 to `count`, and looks at them; `done` is told in order. Views of a scene of
    /// `gaussians` are prepared side by side, as many as memory is meant for. On the CPU each is looked at by itself, side by
    /// side; a GPU has one queue, and is shown all of them at once.
    ///
    /// # Errors
    /// The first of `prepare`, `look` and `done`; [`Error::Stopped`](crate::Error::Stopped), which is looked at before each.
    pub(crate) fn each_view<V: Send, O: Send>(
        &self,
        gaussians: usize,
        count: usize,
        prepare: impl Fn(usize) -> Result<V> + Send + Sync,
        look: impl Fn(&[V]) -> Result<Vec<O>> + Send + Sync,
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
                let alone = |index| look(&[prepare(index)?]);
                indices
                    .map(alone)
                    .collect::<Result<Vec<_>>>()?
                    .into_iter()
                    .flatten()
                    .collect()
            } else {
                let views: Vec<V> = indices.map(prepare).collect::<Result<_>>()?;
                look(&views)?
            };
            for (index, seen) in (first..).zip(seen) {
                // Who was told of a view may have asked for the end.
                self.stop.check()?;
                done(index, seen)?;
            }
        }
        Ok(())
    }

    /// The 8-bit pictures of prepared views of a scene with its colours, over one ground.
    ///
    /// # Errors
    /// Those of the renderer.
    pub(crate) fn drawn(
        &self,
        geometry: &Geometry<'_>,
        views: &[&PreparedView],
        background: [f32; 3],
    ) -> Result<Vec<Picture>> {
        let colours = sh::colours_of_views(geometry.sh(), None, views);
        let pairs = views.iter().zip(&colours);
        let drawings: Vec<Drawing<'_>> = pairs
            .map(|(view, colours)| Drawing {
                view,
                colours,
                background,
            })
            .collect();
        let pictures = self.rasterizer()?.render_all(&drawings)?;
        Ok(pictures.iter().map(Picture::to_8_bit).collect())
    }
}
