//! The views of each step: some never used before, the others drawn from those kept from earlier steps.
//!
//! The first ones are as many as show every Gaussian that can be seen; which these are is known from then on.
//! Fixed sets of views are memorised instead of generalised from; always preparing all views anew wastes what a view
//! keeps. So every step adds fresh views to the pool, and the oldest leave it.
use std::borrow::Borrow;
use std::collections::VecDeque;
use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::scene_augmentation::SceneAugmentation;
use super::settings::Settings;
use crate::error::Result;
use crate::extract::Engine;
use crate::picture::Picture;
use crate::quality::cover::{COVERED, share};
use crate::scene::Sh;
use crate::splat::{Changes, Geometry, PreparedView, sh};
use crate::view::{Camera, Split, ViewSampler};

/// Views enough have been looked at when as many as a step's show no more than this share of new Gaussians.
const NEWLY_SEEN: f64 = 1e-3;
/// Most views that are looked at to find the Gaussians that can be seen.
const MOST_COVERING: usize = 128;

/// A view with what it looks like unmarked.
pub(super) struct PooledView {
    pub view: PreparedView,
    background: [f32; 3],
    /// Added to the colours of the visible Gaussians; empty for nothing.
    noise: Vec<f32>,
    /// The unmarked picture.
    pub reference: Picture,
}

impl PooledView {
    /// `camera` has the size of the picture, which stands for one `times` as large, averaged down; `half` keeps what is
    /// drawn with in half precision.
    pub fn new(
        engine: &Engine,
        geometry: &Geometry<'_>,
        camera: &Camera,
        times: f32,
        half: bool,
        background: [f32; 3],
    ) -> Result<Self> {
        let how = TrainingView {
            times,
            half,
            background,
            augmentation: SceneAugmentation::None,
        };
        Self::altered(engine, geometry, camera, how)
    }

    /// As [`PooledView::new`], of a scene to which something happened.
    fn altered(engine: &Engine, geometry: &Geometry<'_>, camera: &Camera, how: TrainingView) -> Result<Self> {
        let pruned = how.augmentation.pruned(geometry);
        let shown = pruned.as_ref().unwrap_or(geometry);
        let cache = engine.weight_cache(camera.width, how.half);
        let mut view = shown.prepare_averaged(camera, how.times, cache)?;
        if let SceneAugmentation::TruncateSh(degree) = how.augmentation {
            view.degree = view.degree.min(degree);
        }
        let noise = how.augmentation.noise(&view, geometry.sh().degree);
        let empty = Picture {
            width: 0,
            height: 0,
            pixels: Vec::new(),
        };
        let mut pooled = Self {
            view,
            background: how.background,
            noise,
            reference: empty,
        };
        let colours = Self::colours(&[&pooled], geometry.sh(), None);
        pooled.reference = pooled.draw(engine, &colours[0])?;
        Ok(pooled)
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

    /// The picture with these colours of the visible Gaussians.
    pub fn draw(&self, engine: &Engine, colours: &[f32]) -> Result<Picture> {
        engine.rasterizer()?.render(&self.view, colours, self.background)
    }

    /// Takes a gradient to the picture back to these colours.
    pub fn backward(&self, engine: &Engine, gradient: &Picture) -> Result<Vec<f32>> {
        engine.rasterizer()?.backward(&self.view, &gradient.pixels)
    }

    /// Of each visible Gaussian three times the sum over pixels of its weight times the cover of the pixel; and the share
    /// of pixels that are covered.
    fn energies(&self, engine: &Engine) -> Result<(Vec<f32>, f64)> {
        let rasterizer = engine.rasterizer()?;
        let ones = vec![1.0; 3 * self.view.visible.len()];
        let cover = rasterizer.render(&self.view, &ones, [0.0; 3])?;
        let mask: Vec<bool> = cover.pixels.chunks_exact(3).map(|p| p[0] >= COVERED).collect();
        Ok((rasterizer.backward(&self.view, &cover.pixels)?, share(&mask)))
    }

    fn bytes(&self) -> usize {
        self.view.bytes() + size_of_val(&self.reference.pixels[..]) + size_of_val(&self.noise[..])
    }
}

/// How a training view is rendered and augmented.
struct TrainingView {
    times: f32,
    half: bool,
    background: [f32; 3],
    augmentation: SceneAugmentation,
}

/// Training views, kept within a number and a budget of bytes.
pub(super) struct ViewPool {
    sampler: ViewSampler,
    settings: Settings,
    next: u64,
    kept: VecDeque<Arc<PooledView>>,
    picks: ChaCha8Rng,
}

/// Which Gaussians training views show.
#[derive(Clone, Debug, PartialEq)]
pub struct Coverage {
    /// Views that were looked at.
    pub views: usize,
    /// Whether any of them shows a Gaussian.
    pub seen: Vec<bool>,
    /// Mean over them of the sum over pixels of a Gaussian's weight times the cover of the pixel: what a change of its
    /// colour, together with that of its neighbours, costs in squares.
    pub energies: Vec<f32>,
    /// Mean share of a view that the scene covers, 0 to 1.
    pub covered: f64,
}

impl Coverage {
    /// Gaussians that some view shows.
    pub fn count(&self) -> usize {
        self.seen.iter().filter(|seen| **seen).count()
    }
}

impl ViewPool {
    pub fn new(sampler: ViewSampler, settings: &Settings) -> Self {
        let mut picks = ChaCha8Rng::seed_from_u64(settings.seed);
        picks.set_stream(u64::MAX);
        Self {
            sampler,
            settings: *settings,
            next: 0,
            kept: VecDeque::new(),
            picks,
        }
    }

    /// Fills the pool with the first views, as many as show every Gaussian that can be seen.
    pub fn cover(&mut self, engine: &Engine, geometry: &Geometry<'_>) -> Result<Coverage> {
        let mut seen = vec![false; geometry.len()];
        let mut energies = vec![0.0; geometry.len()];
        let (mut views, mut count, mut covered) = (0, 0, 0.0);
        loop {
            let made = self.make(engine, geometry, self.settings.views_per_step)?;
            views += made.len();
            let mut new = 0;
            for row in made.iter().flat_map(|view| &view.view.visible) {
                let seen = &mut seen[*row as usize];
                new += usize::from(!*seen);
                *seen = true;
            }
            count += new;
            for (view, (energy, share)) in made.iter().zip(engine.each(&made, |view| view.energies(engine))?) {
                covered += share;
                for (row, energy) in view.view.visible.iter().zip(energy.chunks_exact(3)) {
                    energies[*row as usize] += energy[0];
                }
            }
            self.keep(made);
            if new as f64 <= NEWLY_SEEN * count as f64 || views >= MOST_COVERING {
                energies.iter_mut().for_each(|e| *e /= views as f32);
                covered /= views as f64;
                return Ok(Coverage {
                    views,
                    seen,
                    energies,
                    covered,
                });
            }
        }
    }

    /// The views of the next step. There are more fresh ones than the settings say while the pool does not hold enough
    /// others, and none once there were as many as the settings allow.
    pub fn batch(&mut self, engine: &Engine, geometry: &Geometry<'_>) -> Result<Vec<Arc<PooledView>>> {
        let s = &self.settings;
        let enough = s.views.is_some_and(|views| self.kept.len() >= views);
        let wanted = if enough { 0 } else { s.fresh_per_step };
        let old = (s.views_per_step - wanted).min(self.kept.len());
        let fresh = s.views_per_step - old;
        let made = self.make(engine, geometry, fresh)?;
        let mut batch = made.clone();
        // A partial shuffle of the numbers of the kept views: all are distinct.
        let mut numbers: Vec<usize> = (0..self.kept.len()).collect();
        for i in 0..old {
            let j = self.picks.random_range(i..numbers.len());
            numbers.swap(i, j);
            batch.push(self.kept[numbers[i]].clone());
        }
        self.keep(made);
        Ok(batch)
    }

    /// The next views; beyond the number that the settings allow it begins again with those that did not fit in memory.
    fn make(&mut self, engine: &Engine, geometry: &Geometry<'_>, count: usize) -> Result<Vec<Arc<PooledView>>> {
        let all = self.settings.views.map_or(u64::MAX, |views| views as u64);
        let wanted: Vec<u64> = (self.next..self.next + count as u64).map(|i| i % all).collect();
        let made = engine.each(&wanted, |&index| {
            let camera = self.sampler.camera(Split::Training, index, self.settings.size);
            let how = self.chosen(index, geometry.sh().degree);
            Ok(Arc::new(PooledView::altered(engine, geometry, &camera, how)?))
        })?;
        self.next += count as u64;
        Ok(made)
    }

    /// Keeps views, and lets the oldest go that are too many or too large.
    fn keep(&mut self, made: Vec<Arc<PooledView>>) {
        self.kept.extend(made);
        let s = &self.settings;
        let budget = s.pool_mebibytes << 20;
        let mut bytes: usize = self.kept.iter().map(|view| view.bytes()).sum();
        while self.kept.len() > s.pool_views || bytes > budget {
            let Some(oldest) = self.kept.pop_front() else {
                break;
            };
            bytes -= oldest.bytes();
        }
    }

    /// How a training view is drawn, seeded: over white, or black for a share of the views; for pictures of up to
    /// [`Settings::enlarged`] times its size; and what happened to the scene, of what the mark is to stand.
    fn chosen(&self, index: u64, degree: usize) -> TrainingView {
        let s = &self.settings;
        let mut rng = ChaCha8Rng::seed_from_u64(s.seed.wrapping_add(1));
        rng.set_stream(index);
        let black = rng.random::<f32>() < s.black_backgrounds;
        let times = 1.0 + (s.enlarged - 1.0) * rng.random::<f32>();
        TrainingView {
            times,
            half: s.half_weights,
            background: if black { [0.0; 3] } else { [1.0; 3] },
            augmentation: SceneAugmentation::draw(s.robust_to, degree, s.seed, index),
        }
    }
}
