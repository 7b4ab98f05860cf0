//! A training view with what it looks like unmarked, and what is drawn of it.
use std::borrow::Borrow;

use rayon::prelude::*;

use super::scene_augmentation::SceneAugmentation;
use crate::error::Result;
use crate::extract::Engine;
use crate::picture::Picture;
use crate::quality::cover::{COVERED, share};
use crate::scene::Sh;
use crate::splat::{Changes, Drawing, Geometry, PackedView, PreparedView, Shown, sh};
use crate::view::Camera;

/// A view with what it looks like unmarked.
pub(super) struct PooledView {
    pub view: PreparedView,
    pub how: TrainingView,
    /// Added to the colours of the visible Gaussians; empty for nothing.
    noise: Vec<f32>,
    /// What a card is to have of the view, until it has it.
    packed: Option<PackedView>,
    /// The unmarked picture; of none that a step draws on a card, which does it there.
    pub reference: Picture,
}

impl PooledView {
    /// The views of `cameras`, each of which has the size of the picture and stands for one `times` as large, averaged down;
    /// `half` keeps what is drawn with in half precision.
    ///
    /// # Errors
    /// Those of [`Geometry::prepare`] and of the renderer; [`Error::Stopped`](crate::Error::Stopped).
    pub fn of_cameras(
        engine: &Engine,
        geometry: &Geometry<'_>,
        cameras: &[Camera],
        times: f32,
        half: bool,
        background: [f32; 3],
    ) -> Result<Vec<Self>> {
        let how = TrainingView {
            times,
            half,
            background,
            augmentation: SceneAugmentation::None,
        };
        let prepare = |camera| Self::prepared(engine, geometry, camera, &how);
        let views = cameras.par_iter().map(prepare).collect::<Result<_>>()?;
        Self::with_references(engine, geometry, views)
    }

    /// Draws what views look like unmarked.
    pub fn with_references(engine: &Engine, geometry: &Geometry<'_>, mut views: Vec<Self>) -> Result<Vec<Self>> {
        Self::send(engine, &mut views)?;
        let colours = Self::colours(&views, geometry.sh(), None);
        let references = Self::draw_all(engine, &views, &colours)?;
        for (view, reference) in views.iter_mut().zip(references) {
            view.reference = reference;
        }
        Ok(views)
    }

    /// A view without its unmarked picture, of a scene to which something happened.
    pub fn prepared(engine: &Engine, geometry: &Geometry<'_>, camera: &Camera, how: &TrainingView) -> Result<Self> {
        engine.stop.check()?;
        let pruned = how.augmentation.pruned(geometry);
        let shown = pruned.as_ref().unwrap_or(geometry);
        let cache = engine.weight_cache(camera.width, how.half);
        let mut view = shown.prepare_averaged(camera, how.times, cache)?;
        if let SceneAugmentation::TruncateSh(degree) = how.augmentation {
            view.degree = view.degree.min(degree);
        }
        let noise = how.augmentation.noise(&view, geometry.sh().degree);
        let packed = (!engine.on_cpu()).then(|| PackedView::new(&view));
        Ok(Self {
            view,
            packed,
            how: *how,
            noise,
            reference: Picture {
                width: 0,
                height: 0,
                pixels: Vec::new(),
            },
        })
    }

    /// Colours of the visible Gaussians of each view, with changes to the scene's.
    pub fn colours<V: Borrow<Self>>(views: &[V], sh: &Sh, changes: Option<Changes<'_>>) -> Vec<Vec<f32>> {
        let prepared: Vec<&PreparedView> = views.iter().map(|v| &v.borrow().view).collect();
        let mut all = sh::colours_of_views(sh, changes, &prepared);
        for (view, colours) in views.iter().zip(&mut all) {
            for (colour, noise) in colours.iter_mut().zip(&view.borrow().noise) {
                *colour = (*colour + noise).max(0.0);
            }
        }
        all
    }

    /// Sends views to the card that they will be drawn on. Nothing is waited for.
    ///
    /// # Errors
    /// Those of the renderer.
    pub fn send(engine: &Engine, views: &mut [Self]) -> Result<()> {
        if let Some(rasterizer) = engine.rasterizer()?.on_device() {
            for view in views {
                if let Some(packed) = view.packed.take() {
                    rasterizer.send(&view.view, packed);
                }
            }
        }
        Ok(())
    }

    /// What is drawn on a card, where colours are.
    pub fn shown(&self) -> Shown<'_> {
        Shown {
            view: &self.view,
            background: self.how.background,
        }
    }

    /// What is added to the colours of the visible Gaussians, `[visible][3]`; empty for nothing.
    pub fn noise(&self) -> &[f32] {
        &self.noise
    }

    /// What there is to draw with these colours of the visible Gaussians.
    pub fn drawing<'a>(&'a self, colours: &'a [f32]) -> Drawing<'a> {
        Drawing {
            view: &self.view,
            colours,
            background: self.how.background,
        }
    }

    /// The pictures of views with these colours.
    ///
    /// # Errors
    /// Those of the renderer; [`Error::Stopped`](crate::Error::Stopped).
    pub fn draw_all<V: Borrow<Self>>(engine: &Engine, views: &[V], colours: &[Vec<f32>]) -> Result<Vec<Picture>> {
        engine.stop.check()?;
        let pairs = views.iter().zip(colours);
        let drawings: Vec<Drawing<'_>> = pairs.map(|(view, colours)| view.borrow().drawing(colours)).collect();
        engine.rasterizer()?.render_all(&drawings)
    }

    /// Of each visible Gaussian of each view three times the sum over pixels of its weight times the cover of the pixel; and
    /// the share of pixels that are covered.
    pub fn energies<V: Borrow<Self>>(engine: &Engine, views: &[V]) -> Result<Vec<(Vec<f32>, f64)>> {
        let rasterizer = engine.rasterizer()?;
        let views: Vec<&PreparedView> = views.iter().map(|view| &view.borrow().view).collect();
        let ones: Vec<Vec<f32>> = views.iter().map(|view| vec![1.0; 3 * view.visible.len()]).collect();
        let pairs = views.iter().zip(&ones);
        let drawings: Vec<Drawing<'_>> = pairs
            .map(|(view, colours)| Drawing {
                view,
                colours,
                background: [0.0; 3],
            })
            .collect();
        let covers = rasterizer.render_all(&drawings)?;
        let share = |cover: &Picture| {
            let mask: Vec<bool> = cover.pixels.chunks_exact(3).map(|p| p[0] >= COVERED).collect();
            share(&mask)
        };
        let energies = rasterizer.backward_all(&views, &covers)?;
        Ok(energies.into_iter().zip(covers.iter().map(share)).collect())
    }

    /// Memory that it holds.
    pub fn bytes(&self) -> usize {
        self.view.bytes() + size_of_val(&self.reference.pixels[..]) + size_of_val(&self.noise[..])
    }
}

/// How a training view is rendered and augmented.
#[derive(Clone, Copy)]
pub(super) struct TrainingView {
    pub times: f32,
    pub half: bool,
    pub background: [f32; 3],
    pub augmentation: SceneAugmentation,
}
