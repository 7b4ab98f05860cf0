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
use rayon::prelude::*;

use super::scene_augmentation::SceneAugmentation;
use super::settings::Settings;
use crate::error::Result;
use crate::extract::Engine;
use crate::picture::Picture;
use crate::quality::cover::{COVERED, share};
use crate::scene::Sh;
use crate::splat::{Changes, Drawing, Geometry, PackedView, PreparedView, Shown, sh};
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
    fn with_references(engine: &Engine, geometry: &Geometry<'_>, mut views: Vec<Self>) -> Result<Vec<Self>> {
        Self::send(engine, &mut views)?;
        let colours = Self::colours(&views, geometry.sh(), None);
        let references = Self::draw_all(engine, &views, &colours)?;
        for (view, reference) in views.iter_mut().zip(references) {
            view.reference = reference;
        }
        Ok(views)
    }

    /// A view without its unmarked picture, of a scene to which something happened.
    fn prepared(engine: &Engine, geometry: &Geometry<'_>, camera: &Camera, how: &TrainingView) -> Result<Self> {
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
            background: how.background,
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
            background: self.background,
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
            background: self.background,
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
    fn energies<V: Borrow<Self>>(engine: &Engine, views: &[V]) -> Result<Vec<(Vec<f32>, f64)>> {
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

    fn bytes(&self) -> usize {
        self.view.bytes() + size_of_val(&self.reference.pixels[..]) + size_of_val(&self.noise[..])
    }
}

/// How a training view is rendered and augmented.
#[derive(Clone, Copy)]
struct TrainingView {
    times: f32,
    half: bool,
    background: [f32; 3],
    augmentation: SceneAugmentation,
}

/// Makes training views: each follows from its number alone.
struct ViewMaker {
    sampler: ViewSampler,
    settings: Settings,
}

/// Training views, kept within a number and a budget of bytes.
pub(super) struct ViewPool {
    maker: Arc<ViewMaker>,
    settings: Settings,
    next: u64,
    /// The next views, where they were prepared before their step.
    ahead: Option<Ahead>,
    kept: VecDeque<Arc<PooledView>>,
    picks: ChaCha8Rng,
}

/// Views that were prepared before their step.
pub(super) struct Ahead {
    numbers: Vec<u64>,
    views: Vec<PooledView>,
}

/// The views of a step to come, to be prepared while one before is computed.
pub(super) struct Upcoming {
    maker: Arc<ViewMaker>,
    numbers: Vec<u64>,
}

impl ViewMaker {
    /// Views by their numbers, without their unmarked pictures, side by side.
    fn prepare(&self, engine: &Engine, geometry: &Geometry<'_>, numbers: &[u64]) -> Result<Vec<PooledView>> {
        let prepare = |&number: &u64| {
            let camera = self.sampler.camera(Split::Training, number, self.settings.size);
            let how = self.chosen(number, geometry.sh().degree);
            PooledView::prepared(engine, geometry, &camera, &how)
        };
        numbers.par_iter().map(prepare).collect()
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

impl Upcoming {
    /// Prepares them; [`ViewPool::prepared`] takes them.
    ///
    /// # Errors
    /// Those of [`Geometry::prepare`]; [`Error::Stopped`](crate::Error::Stopped).
    pub fn prepare(self, engine: &Engine, geometry: &Geometry<'_>) -> Result<Ahead> {
        Ok(Ahead {
            views: self.maker.prepare(engine, geometry, &self.numbers)?,
            numbers: self.numbers,
        })
    }
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
            maker: Arc::new(ViewMaker {
                sampler,
                settings: *settings,
            }),
            settings: *settings,
            next: 0,
            ahead: None,
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
            for (view, (energy, share)) in made.iter().zip(PooledView::energies(engine, &made)?) {
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

    /// How many views of the next step are fresh: more than the settings say while the pool does not hold enough others, and
    /// none once there were as many as the settings allow.
    fn fresh(&self) -> usize {
        let s = &self.settings;
        let enough = s.views.is_some_and(|views| self.kept.len() >= views);
        let wanted = if enough { 0 } else { s.fresh_per_step };
        s.views_per_step - (s.views_per_step - wanted).min(self.kept.len())
    }

    /// What can be prepared of the step `after` so many more than the one whose views were last taken, if those before take
    /// as many fresh views as the next.
    pub fn upcoming(&self, after: usize) -> Upcoming {
        let fresh = self.fresh();
        Upcoming {
            maker: self.maker.clone(),
            numbers: self.numbers(self.next + (after * fresh) as u64, fresh),
        }
    }

    /// Takes views that [`ViewPool::upcoming`] told of, and sends them to the card that they will be drawn on.
    ///
    /// # Errors
    /// Those of the renderer.
    pub fn prepared(&mut self, engine: &Engine, ahead: Option<Ahead>) -> Result<()> {
        self.ahead = ahead;
        match &mut self.ahead {
            Some(ahead) => PooledView::send(engine, &mut ahead.views),
            None => Ok(()),
        }
    }

    /// The views of the next step.
    pub fn batch(&mut self, engine: &Engine, geometry: &Geometry<'_>) -> Result<Vec<Arc<PooledView>>> {
        let fresh = self.fresh();
        let old = self.settings.views_per_step - fresh;
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

    /// Numbers of views from one on; beyond the number that the settings allow they begin again with those that did not fit
    /// in memory.
    fn numbers(&self, first: u64, count: usize) -> Vec<u64> {
        let all = self.settings.views.map_or(u64::MAX, |views| views as u64);
        (first..first + count as u64).map(|i| i % all).collect()
    }

    /// The next views, with what they look like unmarked where that is needed.
    fn make(&mut self, engine: &Engine, geometry: &Geometry<'_>, count: usize) -> Result<Vec<Arc<PooledView>>> {
        let numbers = self.numbers(self.next, count);
        let mut views = match self.ahead.take().filter(|ahead| ahead.numbers == numbers) {
            Some(ahead) => ahead.views,
            None => self.maker.prepare(engine, geometry, &numbers)?,
        };
        self.next += count as u64;
        PooledView::send(engine, &mut views)?;
        if engine.rasterizer()?.on_device().is_none() {
            views = PooledView::with_references(engine, geometry, views)?;
        }
        Ok(views.into_iter().map(Arc::new).collect())
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
}
