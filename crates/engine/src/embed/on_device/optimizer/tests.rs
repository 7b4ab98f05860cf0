use super::*;
use crate::scene::{Gaussians, Sh};
use crate::splat::Learnable;
use crate::testing::wgpu;

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
    let Some(compute) = wgpu() else { return };
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
