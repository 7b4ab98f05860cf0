//! What the steps of an embedding look at and find: for a program that computes the same in another way, and is compared.
use std::collections::HashMap;

use super::pooled_view::PooledView;
use super::progress::Step;
use super::run::Run;
use super::scene_augmentation::SceneAugmentation;
use super::settings::Settings;
use super::step_timer::StepTimer;
use super::view_pool::ViewPool;
use crate::error::{Error, Result};
use crate::extract::Engine;
use crate::message::Message;
use crate::scene::Scene;
use crate::splat::{Geometry, Learnable};
use crate::view::{Camera, ViewSampler};

/// All that the steps depend on besides scene, key and settings, and what they came to.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// The settings, as they are for the scene.
    pub settings: Settings,
    /// Rows of the Gaussians that are learned, ascending.
    pub rows: Vec<u32>,
    /// Of each of these the mean over views of the sum over pixels of its weight times the cover of the pixel.
    pub energies: Vec<f32>,
    /// The bits of the word: 0 or 1.
    pub targets: Vec<f32>,
    /// The views of all steps.
    pub views: Vec<TracedView>,
    /// The steps, in order.
    pub steps: Vec<TracedStep>,
}

/// A view as steps draw it.
#[derive(Clone, Debug, PartialEq)]
pub struct TracedView {
    /// The camera.
    pub camera: Camera,
    /// How many times as large the picture is that it stands for.
    pub times: f32,
    /// Bands of spherical harmonics above this degree are not shown.
    pub degree: usize,
    /// What is behind the scene.
    pub background: [f32; 3],
}

/// A step.
#[derive(Clone, Debug, PartialEq)]
pub struct TracedStep {
    /// Its views, places in [`Trace::views`].
    pub views: Vec<usize>,
    /// What terms that compare pictures are multiplied by, and SSIM among them besides.
    pub factors: [f32; 2],
    /// What the length of the step is multiplied by.
    pub rate: f32,
    /// What it found.
    pub found: Step,
}

/// The first `steps` steps of [`optimise`](super::optimise) without looks at held-out views.
///
/// # Errors
/// Those of [`optimise`](super::optimise); settings by which Gaussians are left out or have noise.
pub fn trace(engine: &Engine, scene: &Scene, message: &Message, settings: &Settings, steps: usize) -> Result<Trace> {
    settings.check()?;
    let settings = settings.for_scene(&scene.gaussians, &[])?;
    let sampler = ViewSampler::seen_from(&scene.gaussians, settings.seed, settings.viewpoints(&[]))?;
    let (geometry, of_parts) = (Geometry::new(&scene.gaussians), sampler.shows_parts());
    let mut pool = ViewPool::new(sampler, &settings);
    let coverage = pool.cover(engine, &geometry)?;
    let mut run = Run::new(engine, scene, message, &settings, &coverage, of_parts)?;
    let learnable = Learnable::new(&coverage.seen, scene.learnable_degree());
    let energy = |row: &u32| coverage.energies[*row as usize];
    let (mut views, mut traced) = (Vec::new(), Vec::new());
    let (mut places, mut timing) = (HashMap::new(), StepTimer::new());
    for step in 1..=steps.min(run.steps()) {
        engine.stop.check()?;
        let shown = pool.batch(engine, &geometry)?;
        let mut of_step = Vec::with_capacity(shown.len());
        for view in &shown {
            let place = *places.entry(view.view.id.0).or_insert(views.len());
            if place == views.len() {
                views.push(TracedView::of(view)?);
            }
            of_step.push(place);
        }
        let factors = run.factors();
        traced.push(TracedStep {
            views: of_step,
            factors: [factors.reconstruction, factors.ssim],
            rate: run.rate(step),
            found: run.step(step, &shown, &mut timing, || Ok(()))?,
        });
    }
    Ok(Trace {
        energies: learnable.rows().iter().map(energy).collect(),
        rows: learnable.rows().to_vec(),
        targets: engine.message_code.word(message)?.targets().collect(),
        views,
        steps: traced,
        settings,
    })
}

impl TracedView {
    fn of(view: &PooledView) -> Result<Self> {
        let how = &view.how;
        match how.augmentation {
            SceneAugmentation::None | SceneAugmentation::TruncateSh(_) => Ok(Self {
                camera: view.view.camera.clone(),
                times: how.times,
                degree: view.view.degree,
                background: how.background,
            }),
            _ => Err(Error::BadOption {
                field: "robust_to, cut_out",
                reason: "only what drops bands of spherical harmonics can be traced".into(),
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::embed::run::tests::engine;
    use crate::embed::{Preset, Progress, optimise};
    use crate::sample::sample;

    #[test]
    fn a_trace_is_of_the_steps_that_an_embedding_takes() {
        let (engine, scene) = (engine(), sample(500, 1, 3).unwrap());
        let message = Message::parse("6", 4).unwrap();
        let settings = Settings {
            steps: 4,
            early_stop: None,
            extension: None,
            ..Preset::Draft.settings()
        };
        let traced = trace(&engine, &scene, &message, &settings, 3).unwrap();
        let mut steps = Vec::new();
        optimise(&engine, &scene, &message, &settings, &[], &mut |progress| {
            if let Progress::Step(step) = progress {
                steps.push(step);
            }
        })
        .unwrap();
        let found: Vec<Step> = traced.steps.iter().map(|step| step.found).collect();
        assert_eq!(found, steps[..3]);
        assert_eq!(traced.rows.len(), traced.energies.len());
        // Half of a step's views are fresh, the others from those before.
        let shown: Vec<usize> = traced.steps.iter().flat_map(|step| step.views.clone()).collect();
        assert_eq!(shown.len(), 3 * settings.views_per_step);
        assert!(traced.views.len() < shown.len() && traced.views.len() >= 3 * settings.fresh_per_step);
    }
}
