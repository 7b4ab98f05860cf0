//! The optimisers with their state on the device.
use cubecl::prelude::*;

use super::kernels::{STATE, SUMS, accelerate, adam_step, advance, scale_of_step, sums_of_offsets};
use crate::embed::adam::{Adam, AdamOptions, Correction, Penalty};
use crate::embed::optimise::OptimizerState;
use crate::embed::preconditioned_sgd::{PreconditionedSgd, PreconditionedSgdOptions};
use crate::splat::{Buffer, CUBE, Chunk, GpuRasterizer, SceneOnDevice, cubes, grid};

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
mod tests {
    use super::*;
    use crate::device::{DeviceChoice, open};
    use crate::scene::{Gaussians, Sh};
    use crate::splat::Learnable;

    const GAUSSIANS: usize = 700;
    const PENALTY: Penalty = Penalty { dc: 10.0, rest: 5.0 };

    /// The host's optimisers over `learnable`.
    fn optimizers(learnable: &Learnable) -> Vec<OptimizerState> {
        let (rows, columns) = (learnable.rows().len(), learnable.columns());
        let energies: Vec<f32> = (0..rows).map(|i| 0.5 + (i % 11) as f32).collect();
        let sgd = PreconditionedSgd::new(PreconditionedSgdOptions::default(), columns, &energies, false);
        let adam = |sparse| {
            let options = AdamOptions {
                sparse,
                ..AdamOptions::default()
            };
            OptimizerState::Adam(Adam::new(options, rows, columns, GAUSSIANS))
        };
        vec![OptimizerState::PreconditionedSgd(sgd), adam(false), adam(true)]
    }

    #[test]
    fn optimisers_move_offsets_as_on_the_host() {
        let compute = match open(DeviceChoice::Wgpu) {
            Ok(compute) => compute,
            Err(error) => {
                assert!(std::env::var_os("CI").is_none(), "{error}");
                eprintln!("skipped: {error}");
                return;
            }
        };
        let rasterizer = GpuRasterizer::new(&compute.device).unwrap();
        let learnable = Learnable::new(&(0..GAUSSIANS).map(|row| row % 5 != 2).collect::<Vec<_>>(), 1);
        let scene = Gaussians {
            positions: vec![[0.0; 3]; GAUSSIANS],
            sh: Sh {
                degree: 1,
                coefficients: vec![0.0; 12 * GAUSSIANS],
            },
            ..Gaussians::default()
        };
        // Every second slot has no gradient at some steps.
        let gradient_at = |step: usize| -> Vec<f32> {
            let of = |i: usize| (((i * 29 + step * 7) % 23) as f32 - 11.0) * 1e-3;
            (0..learnable.len())
                .map(|i| if i / 12 % 2 == 1 && step == 2 { 0.0 } else { of(i) })
                .collect()
        };
        for mut host in optimizers(&learnable) {
            let mut on_card = SceneOnDevice::new(&rasterizer, &scene, &learnable);
            let mut on_device = OptimizerOnDevice::new(&rasterizer, &on_card, &host);
            let mut offsets = vec![0.0; learnable.len()];
            for step in 1..=4 {
                let (mut gradient, rate) = (gradient_at(step), 1.0 / step as f32);
                let value = PENALTY.value(&offsets, learnable.columns(), GAUSSIANS) as f32;
                let sizes = gradient.iter().map(|g| g.abs()).sum::<f32>();
                on_card.set_gradient(&rasterizer, &gradient);
                let sums = on_device.step(&rasterizer, &on_card, rate, 4800.0, PENALTY);
                let sums = rasterizer.read(&[sums]).unwrap().concat();
                let found = totals(&sums, PENALTY, GAUSSIANS, learnable.columns());
                for (found, want) in found.into_iter().zip([value, sizes]) {
                    assert!((found - want).abs() <= 1e-4 * want, "{found} {want}");
                }
                match &mut host {
                    OptimizerState::Adam(adam) => adam.step(rate, PENALTY, &mut offsets, &mut gradient),
                    OptimizerState::PreconditionedSgd(sgd) => sgd.step(rate, 4800.0, &mut offsets, &mut gradient),
                }
                let mut found = Vec::new();
                on_card.read(&rasterizer, |chunk| &chunk.offsets, &mut found).unwrap();
                let largest = offsets.iter().fold(0.0_f32, |m, v| m.max(v.abs()));
                let off = found
                    .iter()
                    .zip(&offsets)
                    .map(|(a, b)| (a - b).abs())
                    .fold(0.0, f32::max);
                assert!(largest > 0.0 && off < 1e-4 * largest, "step {step}: {off} of {largest}");
            }
        }
    }
}
