//! The optimisers with their state on the device.
use cubecl::prelude::*;

use super::kernels::{STATE, SUMS, accelerate, adam_step, advance, scale_of_step, sums_of_offsets};
use crate::embed::adam::{Adam, AdamOptions, Correction, Penalty};
use crate::embed::preconditioned_sgd::{PreconditionedSgd, PreconditionedSgdOptions};
use crate::embed::run::OptimizerState;
use crate::launch::{Buffer, CUBE, cubes, grid};
use crate::splat::{Chunk, GpuRasterizer, SceneOnDevice};

/// Steps of Adam that corrections are worked out for at a time.
const CORRECTIONS: usize = 1024;

/// What moves the offsets, and tells how large they and their gradients are.
pub(super) struct OptimizerOnDevice {
    rule: Rule,
    /// Of each cube, `[cubes][SUMS]`.
    sums: Buffer,
}

enum Rule {
    PreconditionedSgd(SgdOnDevice),
    Adam(AdamOnDevice),
}

/// Preconditioned SGD, by chunks of the scene.
struct SgdOnDevice {
    options: PreconditionedSgdOptions,
    inverse: Vec<Buffer>,
    velocity: Vec<Buffer>,
    energies: Buffer,
    state: Buffer,
}

/// Adam, by chunks of the scene.
struct AdamOnDevice {
    options: AdamOptions,
    gaussians: usize,
    corrections: Buffer,
    taken: usize,
    mean: Vec<Buffer>,
    square: Vec<Buffer>,
    steps: Vec<Buffer>,
}

/// Cubes of the chunks before each, and of all.
fn first_cubes(scene: &SceneOnDevice) -> Vec<usize> {
    let mut first = vec![0];
    for chunk in scene.chunks() {
        first.push(first[first.len() - 1] + cubes(chunk.slots.len()));
    }
    first
}

/// Chunks of which something is learned, with their numbers.
fn learned(scene: &SceneOnDevice) -> impl Iterator<Item = (usize, &Chunk)> {
    scene
        .chunks()
        .iter()
        .enumerate()
        .filter(|(_, chunk)| !chunk.slots.is_empty())
}

/// Zeros for each offset of each chunk.
fn zeros(rasterizer: &GpuRasterizer, scene: &SceneOnDevice) -> Vec<Buffer> {
    let of_chunk = |len: usize| Buffer::zeros(rasterizer.client(), len);
    scene.chunks().iter().map(|chunk| of_chunk(chunk.offsets.len)).collect()
}

impl SgdOnDevice {
    /// As `host`, which has taken no step.
    fn new(rasterizer: &GpuRasterizer, scene: &SceneOnDevice, host: &PreconditionedSgd) -> Self {
        let client = rasterizer.client();
        let all = first_cubes(scene).pop().unwrap_or(0);
        Self {
            options: host.options,
            inverse: scene
                .chunks()
                .iter()
                .map(|chunk| Buffer::of(client, &host.inverse[chunk.slots.clone()]))
                .collect(),
            velocity: zeros(rasterizer, scene),
            energies: Buffer::zeros(client, all),
            state: Buffer::zeros(client, STATE),
        }
    }

    /// One step along the scene's gradient; see [`PreconditionedSgd::step`].
    fn step(&mut self, rasterizer: &GpuRasterizer, scene: &SceneOnDevice, rate: f32, pixels: f32) {
        let (client, o) = (rasterizer.client(), self.options);
        let first = first_cubes(scene);
        for (i, chunk) in learned(scene) {
            let (count, dim) = grid(chunk.slots.len(), 1);
            accelerate::launch(
                client,
                count,
                dim,
                self.inverse[i].argument(),
                chunk.gradient.argument(),
                self.velocity[i].argument(),
                self.energies.argument(),
                first[i] as u32,
                o.dc,
                o.rest,
                o.momentum,
                scene.columns(),
            );
        }
        scale_of_step::launch(
            client,
            CubeCount::Static(1, 1, 1),
            CubeDim::new_1d(CUBE),
            self.energies.argument(),
            self.state.argument(),
            rate * o.length,
            pixels,
        );
        for (i, chunk) in learned(scene) {
            let (count, dim) = grid(chunk.offsets.len, 1);
            let (velocity, state) = (self.velocity[i].argument(), self.state.argument());
            advance::launch(client, count, dim, velocity, state, chunk.offsets.argument());
        }
    }
}

impl AdamOnDevice {
    /// As `host`, which has taken no step.
    fn new(rasterizer: &GpuRasterizer, scene: &SceneOnDevice, host: &Adam) -> Self {
        let client = rasterizer.client();
        Self {
            options: host.options,
            gaussians: host.gaussians,
            corrections: Buffer::zeros(client, 0),
            taken: 0,
            mean: zeros(rasterizer, scene),
            square: zeros(rasterizer, scene),
            steps: scene
                .chunks()
                .iter()
                .map(|chunk| Buffer::zeros(client, chunk.slots.len()))
                .collect(),
        }
    }

    /// One step along the scene's gradient; see [`Adam::step`].
    fn step(&mut self, rasterizer: &GpuRasterizer, scene: &SceneOnDevice, rate: f32, penalty: Penalty) {
        let (client, o, columns) = (rasterizer.client(), self.options, scene.columns());
        if 2 * self.taken >= self.corrections.len {
            let steps = 1..=(self.taken + CORRECTIONS) as i32;
            let corrections = steps.map(|step| Correction::new(o, step));
            let numbers: Vec<f32> = corrections.flat_map(|c| [c.scale, c.root]).collect();
            self.corrections = Buffer::of(client, &numbers);
        }
        self.taken += 1;
        let [dc, rest] = penalty.scales(self.gaussians, columns).map(|s| 2.0 * s as f32);
        for (i, chunk) in learned(scene) {
            let (count, dim) = grid(chunk.slots.len(), 1);
            adam_step::launch(
                client,
                count,
                dim,
                self.corrections.argument(),
                chunk.gradient.argument(),
                chunk.offsets.argument(),
                self.mean[i].argument(),
                self.square[i].argument(),
                self.steps[i].argument(),
                o.rate_dc * rate,
                o.rate_rest * rate,
                dc,
                rest,
                o.beta1,
                o.beta2,
                o.epsilon,
                columns,
                o.sparse,
            );
        }
    }
}

impl OptimizerOnDevice {
    /// As `host`, which has taken no step.
    pub fn new(rasterizer: &GpuRasterizer, scene: &SceneOnDevice, host: &OptimizerState) -> Self {
        let all = first_cubes(scene).pop().unwrap_or(0);
        Self {
            sums: Buffer::zeros(rasterizer.client(), SUMS * all),
            rule: match host {
                OptimizerState::Adam(adam) => Rule::Adam(AdamOnDevice::new(rasterizer, scene, adam)),
                OptimizerState::PreconditionedSgd(sgd) => {
                    Rule::PreconditionedSgd(SgdOnDevice::new(rasterizer, scene, sgd))
                }
            },
        }
    }

    /// One step of all offsets along the scene's gradient. `rate` multiplies rates; `pixels` are the numbers of a picture.
    /// Returns sums of before it, for [`totals`].
    pub fn step(
        &mut self,
        rasterizer: &GpuRasterizer,
        scene: &SceneOnDevice,
        rate: f32,
        pixels: f32,
        penalty: Penalty,
    ) -> Buffer {
        let first = first_cubes(scene);
        for (i, chunk) in learned(scene) {
            let (count, dim) = grid(chunk.slots.len(), 1);
            sums_of_offsets::launch(
                rasterizer.client(),
                count,
                dim,
                chunk.offsets.argument(),
                chunk.gradient.argument(),
                self.sums.argument(),
                first[i] as u32,
                chunk.slots.len() as u32,
                scene.columns(),
            );
        }
        match &mut self.rule {
            Rule::PreconditionedSgd(sgd) => sgd.step(rasterizer, scene, rate, pixels),
            Rule::Adam(adam) => adam.step(rasterizer, scene, rate, penalty),
        }
        self.sums.clone()
    }
}

/// The penalty's value in a scene of `gaussians`, and the sum of the sizes of gradients, from the sums of cubes.
pub(super) fn totals(sums: &[f32], penalty: Penalty, gaussians: usize, columns: usize) -> [f32; 2] {
    let mut all = [0.0_f64; SUMS];
    for cube in sums.chunks_exact(SUMS) {
        all.iter_mut().zip(cube).for_each(|(sum, n)| *sum += f64::from(*n));
    }
    let [dc, rest] = penalty.scales(gaussians, columns);
    [(all[0] * dc + all[1] * rest) as f32, all[2] as f32]
}

#[cfg(test)]
mod tests;
