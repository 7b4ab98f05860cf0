//! Random scenes of legal numbers, the strangest among them: no panic, nothing that is not finite, no corruption.
use guardsplat_engine::scene::{Gaussians, Sh};
use guardsplat_engine::splat::{Learnable, prepare, reference, sh};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestCaseResult, TestRng, TestRunner};

use super::machine::Machine;
use super::scenes::{BACKGROUND, camera, none};

const SIDE: u32 = 48;
/// Most Gaussians of a scene.
const MOST: usize = 12;

/// The same scenes at every run, more of them where they are cheap.
fn runner(machine: &Machine) -> TestRunner {
    let config = Config {
        cases: if machine.compute.name == "cpu" { 300 } else { 40 },
        failure_persistence: None,
        ..Config::default()
    };
    TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha))
}

fn position() -> impl Strategy<Value = [f32; 3]> {
    let in_view = (-0.6f32..0.6, -0.6f32..0.6, 0.15f32..6.0).prop_map(|(x, y, z)| [x * z, y * z, z]);
    prop_oneof![
        8 => in_view,
        1 => Just([0.0; 3]),
        1 => Just([0.1, 0.1, 0.200_001]),
        1 => Just([0.3, 0.2, -4.0]),
        1 => Just([1e30, -1e30, 1e30]),
    ]
}

fn rotation() -> impl Strategy<Value = [f32; 4]> {
    prop_oneof![
        6 => prop::array::uniform4(-1.0f32..1.0),
        1 => Just([0.0; 4]),
        1 => Just([1e-30, 0.0, 0.0, 1e-30]),
        1 => Just([1e30, 1e30, 0.0, 0.0]),
    ]
}

/// `vast` scales are beyond what the reference, with its subtracted products, can be asked for.
fn log_scale(vast: bool) -> BoxedStrategy<f32> {
    let usual = prop_oneof![
        12 => -6.0f32..0.0,
        2 => Just(f32::NEG_INFINITY),
        1 => Just(-80.0f32),
    ];
    let beyond = prop_oneof![Just(20.0f32), Just(88.0f32), Just(3e38f32), 0.0f32..20.0];
    if vast {
        prop_oneof![5 => usual, 1 => beyond].boxed()
    } else {
        usual.boxed()
    }
}

fn opacity() -> impl Strategy<Value = f32> {
    prop_oneof![
        6 => -6.0f32..8.0,
        1 => Just(f32::INFINITY),
        1 => Just(f32::NEG_INFINITY),
        1 => prop_oneof![Just(3e38f32), Just(-3e38f32), Just(0.0f32)],
    ]
}

fn coefficient() -> impl Strategy<Value = f32> {
    prop_oneof![
        20 => -2.0f32..2.0,
        1 => Just(1e6f32),
        1 => Just(-1e6f32),
    ]
}

fn scene(vast: bool) -> impl Strategy<Value = Gaussians> {
    (0usize..=4, 0usize..=MOST).prop_flat_map(move |(degree, n)| {
        let geometry = vec(
            (
                position(),
                rotation(),
                prop::array::uniform3(log_scale(vast)),
                opacity(),
            ),
            n,
        );
        let empty = none(degree);
        (geometry, vec(coefficient(), n * empty.sh.per_gaussian())).prop_map(move |(rows, coefficients)| Gaussians {
            positions: rows.iter().map(|row| row.0).collect(),
            rotations: rows.iter().map(|row| row.1).collect(),
            log_scales: rows.iter().map(|row| row.2).collect(),
            opacity_logits: rows.iter().map(|row| row.3).collect(),
            sh: Sh { degree, coefficients },
        })
    })
}

/// Every pixel lies between black and the brightest of the colours and the background, because weights and what is left
/// add up to 1; every gradient is finite.
pub fn nothing_is_corrupted(machine: &Machine) {
    runner(machine).run(&scene(true), |g| in_range(machine, &g)).unwrap();
}

fn in_range(machine: &Machine, g: &Gaussians) -> TestCaseResult {
    for cache in machine.caches {
        let view = prepare(g, &camera(SIDE), *cache).unwrap();
        let colours = sh::colours(&g.sh, None, &view);
        let most = colours.iter().chain(&BACKGROUND).fold(0.0f32, |most, v| most.max(*v));
        let picture = machine.rasterizer.render(&view, &colours, BACKGROUND).unwrap();
        for value in &picture.pixels {
            prop_assert!((0.0..=1.00001 * most).contains(value), "{value} beyond {most}");
        }
        let ones = vec![1.0; picture.pixels.len()];
        let of_colours = machine.rasterizer.backward(&view, &ones).unwrap();
        let mut gradient = vec![0.0; g.sh.coefficients.len()];
        sh::backward(
            &Learnable::all(g),
            sh::ColourGradient {
                view: &view,
                colours: &colours,
                gradient: &of_colours,
            },
            &mut gradient,
        );
        prop_assert!(gradient.iter().all(|v| v.is_finite()));
    }
    Ok(())
}

/// All but vast scenes look as the reference draws them, relative to the largest coefficient: sums of millions that
/// nearly cancel are as exact as the millions are.
pub fn the_reference_agrees(machine: &Machine) {
    runner(machine).run(&scene(false), |g| near(machine, &g)).unwrap();
}

fn near(machine: &Machine, g: &Gaussians) -> TestCaseResult {
    let want = reference::render(g, &camera(SIDE), BACKGROUND.map(f64::from));
    let largest = g.sh.coefficients.iter().fold(1.0f32, |most, v| most.max(v.abs()));
    for cache in machine.caches {
        let view = prepare(g, &camera(SIDE), *cache).unwrap();
        let colours = sh::colours(&g.sh, None, &view);
        let picture = machine.rasterizer.render(&view, &colours, BACKGROUND).unwrap();
        for (i, (got, want_value)) in picture.pixels.iter().zip(&want.pixels).enumerate() {
            let error = (f64::from(*got) - want_value).abs() / f64::from(largest);
            let limit = if want.uncertain[i / 3] { 0.02 } else { 1e-4 };
            prop_assert!(error <= limit, "value {i}: {got} instead of {want_value}");
        }
    }
    Ok(())
}
