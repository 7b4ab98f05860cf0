//! The run of one message: one step after the other, on the host or on a card, with views that it is given.
use std::borrow::Borrow;
use std::sync::Arc;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::adam::{Adam, Penalty};
use super::learned_offsets::LearnedOffsets;
use super::loss::{Evaluated, Loss, finite};
use super::loss_weight_controller::{LossWeightController, LossWeightFactors};
use super::on_device::{OnDevice, StepOptions};
use super::optimizer::Optimizer;
use super::pooled_view::PooledView;
use super::preconditioned_sgd::PreconditionedSgd;
use super::progress::{Check, Step};
use super::settings::{Extension, Settings};
use super::step_timer::{Stage, StepTimer};
use super::view_pool::Coverage;
use crate::error::Result;
use crate::extract::Engine;
use crate::message::Message;
use crate::picture::Picture;
use crate::scene::Scene;
use crate::splat::{Learnable, PreparedView, sh};

/// dB that held-out views may lack of the target without more steps: to hold them takes bits.
const SHORT_DB: f64 = 1.5;

/// What moves the offsets.
pub(super) enum OptimizerState {
    Adam(Adam),
    PreconditionedSgd(PreconditionedSgd),
}

/// The state of a run.
pub(super) struct Run<'a> {
    engine: &'a Engine,
    scene: &'a Scene,
    settings: &'a Settings,
    /// Most steps, by the settings or as they were extended.
    steps: usize,
    /// What is done at the next look, where bits are wrong.
    extension: Option<Extension>,
    loss: Loss<'a>,
    optimiser: OptimizerState,
    controller: LossWeightController,
    augmentation: ChaCha8Rng,
    learned: LearnedOffsets,
    gradient: Vec<f32>,
    /// Where the engine computes on a card.
    on_device: Option<OnDevice>,
}

impl<'a> Run<'a> {
    /// Stands before the first step. `coverage` is what views show, `of_parts` whether each shows another part of the scene.
    ///
    /// # Errors
    /// A message that is not of the key's length; a failing device.
    pub fn new(
        engine: &'a Engine,
        scene: &'a Scene,
        message: &Message,
        settings: &'a Settings,
        coverage: &Coverage,
        of_parts: bool,
    ) -> Result<Self> {
        let learnable = Learnable::new(&coverage.seen, scene.learnable_degree());
        let mut augmentation = ChaCha8Rng::seed_from_u64(settings.seed);
        augmentation.set_stream(u64::MAX - 1);
        let (rows, columns) = (learnable.rows().len(), learnable.columns());
        let optimiser = match settings.optimizer {
            Optimizer::PreconditionedSgd(options) => {
                let energies: Vec<f32> = learnable
                    .rows()
                    .iter()
                    .map(|r| coverage.energies[*r as usize])
                    .collect();
                OptimizerState::PreconditionedSgd(PreconditionedSgd::new(options, columns, &energies, of_parts))
            }
            Optimizer::Adam(options) => OptimizerState::Adam(Adam::new(options, rows, columns, scene.gaussians.len())),
        };
        let rasterizer = engine.rasterizer()?.on_device();
        let on_device = rasterizer.map(|rasterizer| OnDevice::new(rasterizer, scene, &learnable, &optimiser));
        Ok(Self {
            engine,
            on_device,
            scene,
            settings,
            steps: settings.steps,
            extension: settings.extension,
            loss: Loss::new(engine, settings, message)?,
            optimiser,
            controller: LossWeightController::new(settings.balance, coverage.covered),
            augmentation,
            gradient: vec![0.0; learnable.len()],
            learned: LearnedOffsets::new(scene, learnable),
        })
    }

    /// One step with these views; `step` counts from 1. `meanwhile` is done while a card computes, or after that.
    ///
    /// # Errors
    /// [`Error::NotFinite`](crate::Error::NotFinite) with the term, [`Error::Stopped`](crate::Error::Stopped), a failing device;
    /// those of `meanwhile`.
    pub fn step(
        &mut self,
        step: usize,
        views: &[Arc<PooledView>],
        timing: &mut StepTimer,
        meanwhile: impl FnOnce() -> Result<()>,
    ) -> Result<Step> {
        let mut figures = self.differentiate(step, views, timing, meanwhile)?;
        if !self.moves_on_device() {
            figures.terms.offset = self.advance(step)?;
        }
        let ssim = 1.0 - f64::from(figures.terms.ssim);
        self.controller.update(figures.psnr_db, figures.bit_accuracy, ssim);
        timing.lap(Stage::Adam);
        Ok(figures)
    }

    /// Most steps, by the settings or as they were extended.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Pictures of views of one size as the written file will show them.
    ///
    /// # Errors
    /// Those of the renderer; [`Error::Stopped`](crate::Error::Stopped).
    pub fn pictures<V: Borrow<PooledView>>(&self, views: &[V]) -> Result<Vec<Picture>> {
        if let (Some(on_device), Some(rasterizer)) = (&self.on_device, self.engine.rasterizer()?.on_device()) {
            self.engine.stop.check()?;
            return on_device.pictures(rasterizer, views);
        }
        let colours = PooledView::colours(views, &self.scene.gaussians.sh, Some(self.learned.changes()));
        PooledView::draw_all(self.engine, views, &colours)
    }

    /// What was learned.
    pub fn into_learned(self) -> LearnedOffsets {
        self.learned
    }

    fn moves_on_device(&self) -> bool {
        self.on_device.as_ref().is_some_and(OnDevice::moves)
    }

    /// Brings the offsets from where they are moved.
    pub fn fetch(&mut self) -> Result<()> {
        match (&self.on_device, self.engine.rasterizer()?.on_device()) {
            (Some(on_device), Some(rasterizer)) if on_device.moves() => {
                on_device.read_offsets(rasterizer, &mut self.learned.values)
            }
            _ => Ok(()),
        }
    }

    fn penalty(&self) -> Penalty {
        Penalty {
            dc: self.settings.lambda.offset_dc,
            rest: self.settings.lambda.offset_rest,
        }
    }

    /// Moves the offsets along `self.gradient`, which is all zero afterwards; returns the penalty of where they were.
    fn advance(&mut self, step: usize) -> Result<f32> {
        let (penalty, rate) = (self.penalty(), self.rate(step));
        let (columns, gaussians) = (self.learned.learnable.columns(), self.scene.gaussians.len());
        let offset = penalty.value(&self.learned.values, columns, gaussians) as f32;
        finite(step, "offset", offset)?;
        let (offsets, gradient) = (&mut self.learned.values, &mut self.gradient);
        match &mut self.optimiser {
            OptimizerState::Adam(adam) => adam.step(rate, penalty, offsets, gradient),
            OptimizerState::PreconditionedSgd(sgd) => {
                let pixels = 3.0 * (self.settings.size as f32).powi(2);
                sgd.step(rate, pixels, offsets, gradient);
            }
        }
        self.learned.quantize(self.scene);
        if let (Some(on_device), Some(rasterizer)) = (&mut self.on_device, self.engine.rasterizer()?.on_device()) {
            on_device.set_offsets(rasterizer, self.learned.changes().values);
        }
        Ok(offset)
    }

    /// Draws `views` with the offsets as they are, and adds the gradient of the loss, without the offset penalty, to
    /// `self.gradient`. On a card the offsets are moved as well, if they are moved there; `meanwhile` is done while it computes.
    fn differentiate(
        &mut self,
        step: usize,
        views: &[Arc<PooledView>],
        timing: &mut StepTimer,
        meanwhile: impl FnOnce() -> Result<()>,
    ) -> Result<Step> {
        let factors = self.factors();
        let options = StepOptions {
            step,
            factors,
            rate: self.rate(step),
            penalty: self.penalty(),
        };
        let found = match (self.engine.rasterizer()?.on_device(), &mut self.on_device) {
            (Some(rasterizer), Some(on_device)) => {
                let launched = on_device.launch(rasterizer, &self.loss, views, options, &mut self.augmentation)?;
                timing.lap(Stage::Loss);
                meanwhile()?;
                timing.lap(Stage::Prepare);
                let found = on_device.wait(rasterizer, &self.loss, launched)?;
                if !on_device.moves() {
                    on_device.read_gradient(rasterizer, &mut self.gradient)?;
                }
                timing.lap(Stage::Backward);
                found
            }
            _ => {
                let found = self.differentiate_on_host(step, views, factors, timing)?;
                meanwhile()?;
                timing.lap(Stage::Prepare);
                found
            }
        };
        Ok(Step {
            step,
            total: self.steps,
            bit_accuracy: found.bit_accuracy,
            psnr_db: found.psnr_db,
            terms: found.terms,
            balance: factors.reconstruction,
        })
    }

    fn differentiate_on_host(
        &mut self,
        step: usize,
        views: &[Arc<PooledView>],
        factors: LossWeightFactors,
        timing: &mut StepTimer,
    ) -> Result<Evaluated> {
        let engine = self.engine;
        let changes = self.learned.changes();
        let colours = PooledView::colours(views, &self.scene.gaussians.sh, Some(changes));
        timing.lap(Stage::Colours);
        let references: Vec<&Picture> = views.iter().map(|v| &v.reference).collect();
        let pictures = PooledView::draw_all(engine, views, &colours)?;
        timing.lap(Stage::Render);
        let pictures: Vec<&Picture> = pictures.iter().collect();
        let rng = &mut self.augmentation;
        let (found, gradients) = self.loss.evaluate(step, &pictures, &references, factors, rng)?;
        timing.lap(Stage::Loss);
        let prepared: Vec<&PreparedView> = views.iter().map(|v| &v.view).collect();
        let gradients = engine.rasterizer()?.backward_all(&prepared, &gradients)?;
        timing.lap(Stage::Backward);
        let of_views = views.iter().zip(&colours).zip(&gradients);
        let of_views: Vec<sh::ColourGradient<'_>> = of_views
            .map(|((v, colours), gradient)| sh::ColourGradient {
                view: &v.view,
                colours,
                gradient,
            })
            .collect();
        sh::backward_of_views(&self.learned.learnable, &of_views, &mut self.gradient);
        timing.lap(Stage::ShBackward);
        Ok(found)
    }

    /// Heeds what held-out views showed. Where they show the mark more than they may, its PSNR is held higher. Where they
    /// still do at the first look that decides, or have wrong bits, the run takes more steps, in which weak bits weigh more;
    /// the rate then follows the longer curve.
    pub fn heed(&mut self, check: &Check) {
        let lacking = self.settings.target.psnr_db - check.psnr_db;
        self.controller.held_out(lacking);
        if let Some(extension) = self.extension.filter(|extension| check.step >= extension.after) {
            self.extension = None;
            if check.bit_accuracy < extension.below || lacking > SHORT_DB {
                self.steps = self.steps.saturating_mul(extension.times as usize);
                self.loss.set_temperature(extension.temperature);
                self.extension = extension.next();
            }
        }
    }

    /// What terms of the loss are multiplied by at the next step.
    pub fn factors(&self) -> LossWeightFactors {
        self.controller.factors()
    }

    /// Factor on the learning rates: a half cosine from 1 to the final rate.
    pub fn rate(&self, step: usize) -> f32 {
        let s = self.settings;
        let last = s.optimizer.final_rate();
        let turn = std::f32::consts::PI * (step - 1) as f32 / self.steps as f32;
        last + (1.0 - last) * 0.5 * (1.0 + turn.cos())
    }
}

#[cfg(test)]
pub(super) mod tests;
