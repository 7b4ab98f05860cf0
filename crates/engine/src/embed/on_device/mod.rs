//! A step on a graphics card. Pictures, the loss, gradients and offsets stay there; the host sends fresh views, and waits once
//! for a few numbers.
mod kernels;
mod optimizer;

use std::borrow::Borrow;
use std::sync::Arc;

use rand_chacha::ChaCha8Rng;

use self::optimizer::{OptimizerOnDevice, totals};
use super::adam::Penalty;
use super::loss::{Evaluated, Loss, finite};
use super::loss_weight_controller::LossWeightFactors;
use super::pooled_view::PooledView;
use super::run::OptimizerState;
use crate::error::Result;
use crate::launch::Buffer;
use crate::picture::Picture;
use crate::quality::unbatch;
use crate::scene::Scene;
use crate::splat::{GpuRasterizer, Learnable, SceneOnDevice, Shown};

/// A scene on a card, and what moves its colours there.
pub(super) struct OnDevice {
    scene: SceneOnDevice,
    /// None where a file keeps colours in steps: these are rounded on the host.
    optimizer: Option<OptimizerOnDevice>,
    gaussians: usize,
}

/// What a step needs besides views.
pub(super) struct StepOptions {
    /// Counts from 1.
    pub step: usize,
    pub factors: LossWeightFactors,
    /// Factor on the optimiser's rates.
    pub rate: f32,
    pub penalty: Penalty,
}

/// A step that a device computes.
pub(super) struct Launched {
    /// Numbers of the loss that are read.
    numbers: Vec<Buffer>,
    /// Sums over what is learned, where it is moved.
    sums: Option<Buffer>,
    views: usize,
    options: StepOptions,
}

impl OnDevice {
    /// A scene of which nothing has changed yet. `optimizer` has taken no step.
    pub fn new(rasterizer: &GpuRasterizer, scene: &Scene, learnable: &Learnable, optimizer: &OptimizerState) -> Self {
        let on_device = SceneOnDevice::new(rasterizer, &scene.gaussians, learnable);
        Self {
            optimizer: scene
                .exact()
                .then(|| OptimizerOnDevice::new(rasterizer, &on_device, optimizer)),
            scene: on_device,
            gaussians: scene.gaussians.len(),
        }
    }

    /// Whether offsets are moved here, and not on the host.
    pub fn moves(&self) -> bool {
        self.optimizer.is_some()
    }

    /// Launches a step: the loss of `views` with the offsets as they are, and the offsets moved, or their gradient found.
    /// Nothing is waited for.
    ///
    /// # Errors
    /// A view that the device cannot hold; a failing device.
    pub fn launch(
        &mut self,
        rasterizer: &GpuRasterizer,
        loss: &Loss<'_>,
        views: &[Arc<PooledView>],
        options: StepOptions,
        rng: &mut ChaCha8Rng,
    ) -> Result<Launched> {
        let shown: Vec<Shown<'_>> = views.iter().map(|view| view.shown()).collect();
        let noise: Vec<&[f32]> = views.iter().map(|view| view.noise()).collect();
        let batch = rasterizer.batch(&shown)?;
        // To draw what is unmarked anew costs less than to keep it, or to bring it here.
        let [colours, originals] = self.scene.colours(rasterizer, &batch, &noise);
        let drawn = rasterizer.composite_both(&batch, &colours, &originals)?;
        let (pictures, originals) = (drawn.pictures, drawn.originals);
        let (gradient, numbers) = loss.evaluate_on_device(options.step, pictures, originals, options.factors, rng)?;
        let slots = rasterizer.slot_gradients(&batch, &drawn.lights, gradient)?;
        self.scene.differentiate(rasterizer, &batch, &colours, &slots);
        let numbers = numbers.into_iter().map(|numbers| rasterizer.buffer_of(numbers));
        let numbers = numbers.collect::<Result<_>>()?;
        let pixels = (3 * batch.width * batch.height) as f32;
        let sums = self
            .optimizer
            .as_mut()
            .map(|optimizer| optimizer.step(rasterizer, &self.scene, options.rate, pixels, options.penalty));
        Ok(Launched {
            numbers,
            sums,
            views: views.len(),
            options,
        })
    }

    /// Pictures of views of one size with the offsets as they are. Waits for them.
    ///
    /// # Errors
    /// Those of [`OnDevice::launch`].
    pub fn pictures<V: Borrow<PooledView>>(&self, rasterizer: &GpuRasterizer, views: &[V]) -> Result<Vec<Picture>> {
        let shown: Vec<Shown<'_>> = views.iter().map(|view| view.borrow().shown()).collect();
        let noise: Vec<&[f32]> = views.iter().map(|view| view.borrow().noise()).collect();
        let batch = rasterizer.batch(&shown)?;
        let [colours, _] = self.scene.colours(rasterizer, &batch, &noise);
        unbatch(rasterizer.composite(&batch, &colours)?)
    }

    /// Waits for a step: its loss, with the offset penalty where offsets are moved here.
    ///
    /// # Errors
    /// [`Error::NotFinite`](crate::Error::NotFinite) with the term; a failing device.
    pub fn wait(&self, rasterizer: &GpuRasterizer, loss: &Loss<'_>, launched: Launched) -> Result<Evaluated> {
        let StepOptions { step, penalty, .. } = launched.options;
        let buffers: Vec<Buffer> = launched.numbers.iter().chain(&launched.sums).cloned().collect();
        let told = rasterizer.read(&buffers)?;
        let (numbers, sums) = told.split_at(launched.numbers.len());
        let mut evaluated = loss.evaluated_on_device(step, &numbers.concat(), launched.views)?;
        if let Some(sums) = sums.first() {
            let [offset, gradient] = totals(sums, penalty, self.gaussians, self.scene.columns());
            finite(step, "gradient", gradient)?;
            finite(step, "offset", offset)?;
            evaluated.terms.offset = offset;
        }
        Ok(evaluated)
    }

    /// The offsets as they are here, `[slots][columns]`.
    ///
    /// # Errors
    /// A failing device.
    pub fn read_offsets(&self, rasterizer: &GpuRasterizer, out: &mut Vec<f32>) -> Result<()> {
        self.scene.read(rasterizer, |chunk| &chunk.offsets, out)
    }

    /// The gradient of the last step to them.
    ///
    /// # Errors
    /// A failing device.
    pub fn read_gradient(&self, rasterizer: &GpuRasterizer, out: &mut Vec<f32>) -> Result<()> {
        self.scene.read(rasterizer, |chunk| &chunk.gradient, out)
    }

    /// Takes the changes that pictures are to show.
    pub fn set_offsets(&mut self, rasterizer: &GpuRasterizer, offsets: &[f32]) {
        self.scene.set_offsets(rasterizer, offsets);
    }
}
