//! The original as a camera sees it: colours, and how much of each pixel is the scene.
use crate::error::Result;
use crate::extract::Engine;
use crate::resize::resized;
use crate::splat::{Geometry, WeightCache, sh};
use crate::view::Camera;

/// How many times as large small views are drawn before they are made small as pictures are: drawn small they have an edge
/// that a picture made small has not, and fits stop before they are right (0.4 to 4.7 instead of 0.1 to 0.8 pixels of 800
/// for three pictures of `pod.ply`).
const FINER: u32 = 2;

/// A view of the original, a value a pixel.
pub(super) struct Drawn {
    /// Over black: colours times coverage.
    pub colours: Vec<[f32; 3]>,
    /// Share of each pixel that the scene covers.
    pub coverage: Vec<f32>,
}

impl Drawn {
    /// Draws a view that stands for a picture `times` as large, made small.
    ///
    /// # Errors
    /// A camera out of range, a failing device, or [`Error::Stopped`](crate::Error::Stopped).
    pub fn of(engine: &Engine, geometry: &Geometry<'_>, camera: &Camera, times: f32) -> Result<Self> {
        engine.stop.check()?;
        let finer = if times >= FINER as f32 { FINER } else { 1 };
        let view = geometry.prepare_averaged(&camera.enlarged(finer), times / finer as f32, WeightCache::None)?;
        let colours = sh::colours(geometry.sh(), None, &view);
        let over = |background: [f32; 3]| {
            let picture = engine.rasterizer()?.render(&view, &colours, background)?;
            match finer {
                1 => Ok(picture),
                _ => resized(&picture, camera.height as usize, camera.width as usize),
            }
        };
        let (black, white) = (over([0.0; 3])?, over([1.0; 3])?);
        let (black, white) = (black.pixels.as_chunks::<3>().0, white.pixels.as_chunks::<3>().0);
        let covered = |(black, white): (&[f32; 3], &[f32; 3])| (1.0 - (white[1] - black[1])).clamp(0.0, 1.0);
        Ok(Self {
            coverage: black.iter().zip(white).map(covered).collect(),
            colours: black.to_vec(),
        })
    }
}
