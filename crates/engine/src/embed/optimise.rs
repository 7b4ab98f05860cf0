//! The loop: offsets on the colours of frozen Gaussians, until the message is read from views never used.
use std::sync::Arc;
use std::thread;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::adam::{Adam, Penalty};
use super::early_stopping::EarlyStopping;
use super::learned_offsets::LearnedOffsets;
use super::loss::{Evaluated, Loss, finite};
use super::loss_weight_controller::{LossWeightController, LossWeightFactors};
use super::on_device::{OnDevice, StepOptions};
use super::optimizer::Optimizer;
use super::preconditioned_sgd::PreconditionedSgd;
use super::preparing::Preparing;
use super::progress::{Check, Progress, Step};
use super::settings::{Extension, Settings};
use super::step_timer::{Stage, StepTimer};
use super::view_pool::{Coverage, PooledView, ViewPool};
use crate::error::{Error, Result};
use crate::extract::Engine;
use crate::message::Message;
use crate::picture::Picture;
use crate::scene::Scene;
use crate::splat::{Geometry, Learnable, PreparedView, sh};
use crate::view::{Camera, ViewSampler};

/// Steps between two reports of the timing.
const TIMED_STEPS: usize = 20;

/// dB that held-out views may lack of the target without more steps: to hold them takes bits.
const SHORT_DB: f64 = 0.5;

/// The outcome of the loop.
#[derive(Clone, Debug, PartialEq)]
pub struct Optimised {
    /// The learned changes.
    pub learned: LearnedOffsets,
    /// Views that it took to find the Gaussians that can be seen.
    pub covering_views: usize,
    /// Steps taken.
    pub steps: usize,
    /// Views drawn in all steps.
    pub view_steps: usize,
}

/// Optimises offsets that make views of the scene read as `message`: views around and between `cameras`, or, without any,
/// where viewers of such a scene are. The same arguments on the same device give the same offsets, bit by bit.
///
/// # Errors
/// Settings out of range, a message of another length than the key's, a scene without Gaussians,
/// [`Error::NotFinite`] when a term stops being a number, [`Error::Stopped`], or a failing device.
pub fn optimise(
    engine: &Engine,
    scene: &Scene,
    message: &Message,
    settings: &Settings,
    cameras: &[Camera],
    progress: &mut dyn FnMut(Progress),
) -> Result<Optimised> {
    settings.check()?;
    let settings = &settings.for_scene(&scene.gaussians, cameras)?;
    if message.len() != engine.bits {
        return Err(Error::BadOption {
            field: "message",
            reason: format!("{} bits, but the key has {}", message.len(), engine.bits),
        });
    }
    let gaussians = &scene.gaussians;
    let geometry = Geometry::new(gaussians);
    let mut sampler = ViewSampler::seen_from(gaussians, settings.seed, settings.viewpoints(cameras))?;
    if let Some(ring) = settings.ring {
        sampler.train_on_ring(ring.elevation.to_radians())?;
    }
    let mut held_out = settings
        .early_stop
        .map(|stop| EarlyStopping::new(engine, &geometry, &sampler, settings, stop))
        .transpose()?;
    let (mut run, coverage) = Run::new(engine, scene, geometry, message, settings, sampler)?;
    progress(Progress::Covered {
        views: coverage.views,
        seen: coverage.count(),
        gaussians: gaussians.len(),
    });
    let mut steps = 0;
    thread::scope(|scope| {
        let (mut timing, mut preparing) = (StepTimer::new(), Preparing::new(scope));
        while steps < run.steps {
            engine.stop.check()?;
            timing.start();
            steps += 1;
            progress(Progress::Step(run.step(steps, &mut preparing, &mut timing)?));
            let mut enough = false;
            if let Some(held_out) = held_out.as_mut().filter(|h| h.due(steps)) {
                let check;
                run.fetch()?;
                (check, enough) = held_out.check(engine, gaussians, run.learned.changes(), message, steps)?;
                run.heed(&check);
                progress(Progress::Check(check));
            }
            timing.lap(Stage::Check);
            progress(Progress::Timed(timing.end_step(steps, TIMED_STEPS)));
            if enough {
                progress(Progress::Stopped { step: steps });
                break;
            }
        }
        Ok::<_, Error>(())
    })?;
    run.fetch()?;
    Ok(Optimised {
        learned: run.learned,
        covering_views: coverage.views,
        view_steps: steps * settings.views_per_step,
        steps,
    })
}

/// What moves the offsets.
pub(super) enum OptimizerState {
    Adam(Adam),
    PreconditionedSgd(PreconditionedSgd),
}

/// The state of a run.
struct Run<'a> {
    engine: &'a Engine,
    scene: &'a Scene,
    geometry: Arc<Geometry<'a>>,
    settings: &'a Settings,
    /// Most steps, by the settings or as they were extended.
    steps: usize,
    /// What is done at the next look, where bits are wrong.
    extension: Option<Extension>,
    loss: Loss<'a>,
    pool: ViewPool,
    optimiser: OptimizerState,
    controller: LossWeightController,
    augmentation: ChaCha8Rng,
    learned: LearnedOffsets,
    gradient: Vec<f32>,
    /// Where the engine computes on a card.
    on_device: Option<OnDevice>,
}

impl<'a> Run<'a> {
    fn new(
        engine: &'a Engine,
        scene: &'a Scene,
        geometry: Geometry<'a>,
        message: &Message,
        settings: &'a Settings,
        sampler: ViewSampler,
    ) -> Result<(Self, Coverage)> {
        let of_parts = sampler.shows_parts();
        let mut pool = ViewPool::new(sampler, settings);
        let coverage = pool.cover(engine, &geometry)?;
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
        let run = Self {
            engine,
            on_device,
            scene,
            geometry: Arc::new(geometry),
            settings,
            steps: settings.steps,
            extension: settings.extension,
            loss: Loss::new(engine, settings, message),
            pool,
            optimiser,
            controller: LossWeightController::new(settings.balance, coverage.covered),
            augmentation,
            gradient: vec![0.0; learnable.len()],
            learned: LearnedOffsets::new(scene, learnable),
        };
        Ok((run, coverage))
    }

    /// One step; `step` counts from 1.
    fn step<'scope>(
        &mut self,
        step: usize,
        preparing: &mut Preparing<'scope, 'a>,
        timing: &mut StepTimer,
    ) -> Result<Step>
    where
        'a: 'scope,
    {
        let engine = self.engine;
        let views = self.pool.batch(engine, &self.geometry)?;
        preparing.begin(engine, &self.geometry, self.steps - step, |after| {
            self.pool.upcoming(after)
        });
        timing.lap(Stage::Prepare);
        let mut figures = self.differentiate(step, &views, timing, |pool| pool.prepared(engine, preparing.next()?))?;
        if !self.moves_on_device() {
            figures.terms.offset = self.advance(step)?;
        }
        let ssim = 1.0 - f64::from(figures.terms.ssim);
        self.controller.update(figures.psnr_db, figures.bit_accuracy, ssim);
        timing.lap(Stage::Adam);
        Ok(figures)
    }

    fn moves_on_device(&self) -> bool {
        self.on_device.as_ref().is_some_and(OnDevice::moves)
    }

    /// Brings the offsets from where they are moved.
    fn fetch(&mut self) -> Result<()> {
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
        meanwhile: impl FnOnce(&mut ViewPool) -> Result<()>,
    ) -> Result<Step> {
        let factors = self.controller.factors();
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
                meanwhile(&mut self.pool)?;
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
                meanwhile(&mut self.pool)?;
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
    fn heed(&mut self, check: &Check) {
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

    /// Factor on the learning rates: a half cosine from 1 to the final rate.
    fn rate(&self, step: usize) -> f32 {
        let s = self.settings;
        let last = s.optimizer.final_rate();
        let turn = std::f32::consts::PI * (step - 1) as f32 / self.steps as f32;
        last + (1.0 - last) * 0.5 * (1.0 + turn.cos())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clip::{Clip, ClipConfig, ClipModel, Parts};
    use crate::device::{DeviceChoice, open};
    use crate::embed::{Augmentation, Preset};
    use crate::message::key::Secret;
    use crate::message::{ClipIdentity, DecoderWeights, Decoding, Key, Projection};
    use crate::sample::sample;
    use rand::RngExt;

    const TINY: &str = r#"{"embed_dim": 16,
        "vision_cfg": {"image_size": 32, "layers": [1, 1, 1, 1], "width": 8},
        "text_cfg": {"context_length": 5, "vocab_size": 9, "width": 8, "heads": 1, "layers": 1}}"#;

    /// A tiny random CLIP and an untrained decoder.
    fn engine() -> Engine {
        let compute = open(DeviceChoice::Cpu).unwrap();
        let config = ClipConfig::parse("tiny", TINY).unwrap();
        let model = ClipModel::init(&config, Parts::Image, &compute.device, 5);
        let clip = Clip::from_model(config, String::new(), model);
        let mut projection = Projection::identity(16);
        projection.matrix_image.iter_mut().for_each(|v| *v *= 8.0);
        let key = Key {
            secret: Secret::from_seed(1),
            bits_per_token: 1,
            seed: None,
            clip: ClipIdentity {
                name: String::new(),
                hash: String::new(),
            },
            decoding: Decoding::Clip {
                projection,
                decoder: DecoderWeights::seeded(16, 4, 1),
            },
            accuracy_unseen: None,
            accuracy_unseen_noisy: None,
        };
        Engine::new(compute, clip, &key, None).unwrap()
    }

    /// Along its own direction the gradient must be as steep as its length, from pictures back to coefficients.
    #[test]
    fn the_gradient_is_that_of_the_loss() {
        let engine = engine();
        let scene = sample(300, 2, 3).unwrap();
        let message = Message::parse("6", 4).unwrap();
        let mut settings = Preset::Draft.settings();
        (settings.views_per_step, settings.size, settings.enlarged) = (2, 40, 1.0);
        let l = &mut settings.lambda;
        (l.l1, l.l2, l.ssim) = (0.8, 0.0, 0.2);
        settings.augmentation = Augmentation {
            brightness: 0.0,
            ..settings.augmentation
        };
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let start: Vec<f32> = (0..scene.gaussians.sh.coefficients.len())
            .map(|_| 0.2 * (rng.random::<f32>() - 0.5))
            .collect();
        for (message_weight, weight) in [(1.0, 0.0), (0.0, 1.0), (0.5, 2.0)] {
            (settings.lambda.message, settings.lambda.reconstruction) = (message_weight, weight);
            let geometry = Geometry::new(&scene.gaussians);
            let sampler = ViewSampler::new(&scene.gaussians, 1).unwrap();
            let (mut run, coverage) = Run::new(&engine, &scene, geometry, &message, &settings, sampler).unwrap();
            let views = run.pool.batch(&engine, &run.geometry).unwrap();
            // Offsets of Gaussians that no view shows have no slot.
            let columns = run.learned.learnable.columns();
            let start = start[..coverage.count() * columns].to_vec();
            let mut at = |offsets: Vec<f32>| {
                run.learned.values = offsets;
                run.gradient.fill(0.0);
                // The same augmentation every time.
                run.augmentation = ChaCha8Rng::seed_from_u64(4);
                let t = run
                    .differentiate(1, &views, &mut StepTimer::new(), |_| Ok(()))
                    .unwrap()
                    .terms;
                let l = &settings.lambda;
                let reconstruction = l.l1 * t.l1 + l.ssim * t.ssim;
                let loss = l.message * t.message + l.reconstruction * reconstruction;
                (f64::from(loss), run.gradient.clone())
            };
            let (_, gradient) = at(start.clone());
            let length = gradient.iter().map(|g| g * g).sum::<f32>().sqrt();
            assert!(length > 0.0);
            let mut moved = |step: f32| {
                let pairs = start.iter().zip(&gradient);
                at(pairs.map(|(o, g)| o + step * g / length).collect()).0
            };
            // A large step crosses kinks of the tower, a small one drowns in rounding: some step in between agrees.
            let ratio = |step: f32| {
                let slope = (moved(step) - moved(-step)) / (2.0 * f64::from(step));
                slope / f64::from(length)
            };
            let ratios = [0.02, 0.01, 0.005, 0.0025].map(ratio);
            let off = ratios.iter().map(|r| (r - 1.0).abs()).fold(f64::INFINITY, f64::min);
            assert!(off < 0.02, "{message_weight} {weight}: {ratios:?}");
        }
    }
}
