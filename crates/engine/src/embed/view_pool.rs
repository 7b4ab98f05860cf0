//! The views of each step: some never used before, the others drawn from those kept from earlier steps.
//!
//! The first ones are as many as show every Gaussian that can be seen; which these are is known from then on.
//! Fixed sets of views are memorised instead of generalised from; always preparing all views anew wastes what a view
//! keeps. So every step adds fresh views to the pool, and the oldest leave it.
use std::collections::VecDeque;
use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::pooled_view::{PooledView, TrainingView};
use super::scene_augmentation::SceneAugmentation;
use super::settings::Settings;
use crate::error::Result;
use crate::extract::Engine;
use crate::splat::Geometry;
use crate::view::{Camera, Split, ViewSampler};

/// How much of each side a window has.
const KEPT: std::ops::Range<f32> = 0.35..0.9;
/// What is cut out of an unbounded scene, in radii of its focus.
const CUT_OUT: std::ops::Range<f32> = 1.0..1.5;
/// Views enough have been looked at when as many as a step's show no more than this share of new Gaussians.
const NEWLY_SEEN: f64 = 1e-3;
/// Most views that are looked at to find the Gaussians that can be seen.
const MOST_COVERING: usize = 128;

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
            let camera = self.camera(number);
            let how = self.chosen(number, geometry.sh().degree);
            PooledView::prepared(engine, geometry, &camera, &how)
        };
        numbers.par_iter().map(prepare).collect()
    }

    /// Where a training view is taken from; of a forward-facing capture it may show a window of that, seeded.
    fn camera(&self, index: u64) -> Camera {
        let s = &self.settings;
        let camera = self.sampler.camera(Split::Training, index, s.size);
        if !self.sampler.faces_one_side() {
            return camera;
        }
        let mut rng = ChaCha8Rng::seed_from_u64(s.seed.wrapping_add(3));
        rng.set_stream(index);
        match rng.random::<f32>() < s.windows {
            true => camera.window(rng.random_range(KEPT), [rng.random(), rng.random()]),
            false => camera,
        }
    }

    /// How a training view is drawn, seeded: over white, or black for a share of the views; for pictures of up to
    /// [`Settings::enlarged`] times its size; and what happened to the scene, of what the mark is to stand, or that all but the
    /// focus of an unbounded scene was cut off.
    fn chosen(&self, index: u64, degree: usize) -> TrainingView {
        let s = &self.settings;
        let mut rng = ChaCha8Rng::seed_from_u64(s.seed.wrapping_add(1));
        rng.set_stream(index);
        let black = rng.random::<f32>() < s.black_backgrounds;
        let times = 1.0 + (s.enlarged - 1.0) * rng.random::<f32>();
        let cut_out = self.sampler.focus().filter(|_| rng.random::<f32>() < s.cut_out);
        let augmentation = match cut_out {
            Some(focus) => SceneAugmentation::CutOut {
                centre: focus.centre,
                radius: focus.radius * rng.random_range(CUT_OUT),
            },
            None => SceneAugmentation::draw(s.robust_to, degree, s.seed, index),
        };
        TrainingView {
            times,
            half: s.half_weights,
            background: if black { [0.0; 3] } else { [1.0; 3] },
            augmentation,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::embed::Preset;
    use crate::sample::sample_of;
    use crate::view::SceneKind;

    #[test]
    fn some_views_of_a_forward_facing_capture_show_a_part_of_it() {
        let parts = |kind, settings: Settings| {
            let scene = sample_of(kind, 4000, 0, 1).unwrap().gaussians;
            let sampler = ViewSampler::new(&scene, 1).unwrap();
            assert_eq!(sampler.kind(), kind);
            let maker = ViewMaker { sampler, settings };
            let whole = |index| maker.sampler.camera(Split::Training, index, settings.size);
            let is_part = |index: &u64| maker.camera(*index) != whole(*index);
            (0..200).filter(is_part).count()
        };
        let standard = Preset::Standard.settings();
        assert!((35..65).contains(&parts(SceneKind::Forward, standard)));
        assert_eq!(parts(SceneKind::Object, standard), 0);
        assert_eq!(parts(SceneKind::Forward, Preset::Paper.settings()), 0);
    }

    #[test]
    fn some_views_of_an_unbounded_scene_show_its_focus_alone() {
        let alone = |kind, settings: Settings| {
            let scene = sample_of(kind, 4000, 0, 1).unwrap().gaussians;
            let geometry = Geometry::new(&scene);
            let sampler = ViewSampler::new(&scene, 1).unwrap();
            let maker = ViewMaker { sampler, settings };
            let shown = |index| -> Option<Vec<[f32; 3]>> {
                let how = maker.chosen(index, 0);
                let SceneAugmentation::CutOut { .. } = how.augmentation else {
                    return None;
                };
                let left = how.augmentation.pruned(&geometry)?;
                let view = left
                    .prepare(&maker.camera(index), crate::splat::WeightCache::None)
                    .unwrap();
                Some(view.visible.iter().map(|row| scene.positions[*row as usize]).collect())
            };
            (0..200).filter_map(shown).collect::<Vec<_>>()
        };
        let standard = Preset::Standard.settings();
        let views = alone(SceneKind::Unbounded, standard);
        assert!((35..65).contains(&views.len()), "{}", views.len());
        // The disc and what stands on it, and nothing of the houses, the walls and the sky.
        for view in &views {
            let farthest = view.iter().map(|p| p[0].hypot(p[2])).fold(0.0, f32::max);
            assert!(view.len() > 100 && (1.0..4.5).contains(&farthest), "{farthest}");
        }
        assert_eq!(alone(SceneKind::Object, standard).len(), 0);
        assert_eq!(alone(SceneKind::Unbounded, Preset::Paper.settings()).len(), 0);
    }
}
