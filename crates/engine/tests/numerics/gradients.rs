//! Gradients: of both renderers against the reference's, and the reference's against central differences.
use guardsplat_engine::scene::Gaussians;
use guardsplat_engine::splat::compare::Agreement;
use guardsplat_engine::splat::reference;

use super::machine::Machine;
use super::scenes::{BACKGROUND, Kind, camera, clamped, needles, ordinary, saturated, small};

fn agree(machine: &Machine, kind: Kind) {
    for degree in 0..=4 {
        for cache in machine.caches {
            let g = kind(150, degree);
            let rasterizer = machine.rasterizer.as_ref();
            let found = Agreement::of(rasterizer, *cache, &g, &camera(48), BACKGROUND).unwrap();
            println!("{} {cache:?}, degree {degree}: {found}", rasterizer.name());
            assert!(found.holds(), "degree {degree}: {found}");
        }
    }
}

pub fn of_ordinary(machine: &Machine) {
    agree(machine, ordinary);
}

pub fn of_clamped(machine: &Machine) {
    agree(machine, clamped);
}

pub fn of_saturated(machine: &Machine) {
    agree(machine, saturated);
}

pub fn of_needles(machine: &Machine) {
    agree(machine, needles);
}

pub fn of_small(machine: &Machine) {
    agree(machine, small);
}

/// The picture is linear in every coefficient but for the clamp, so differences are as exact as doubles are.
pub fn of_the_reference() {
    for kind in [ordinary as Kind, clamped, saturated, needles, small] {
        for degree in 0..=4 {
            differences(kind(8, degree));
        }
    }
}

fn differences(mut g: Gaussians) {
    let camera = camera(16);
    let weights: Vec<f64> = (0..16 * 16 * 3).map(|i| (f64::from(i) * 0.7).sin()).collect();
    let loss = |g: &Gaussians| -> f64 {
        let picture = reference::render(g, &camera, BACKGROUND.map(f64::from));
        picture.pixels.iter().zip(&weights).map(|(p, w)| p * w).sum()
    };
    let gradient = reference::gradient(&g, &camera, &weights);
    assert!(gradient.iter().any(|v| v.abs() > 1e-3));
    // So small that no colour crosses the clamp on the way.
    let step = 2f32.powi(-14);
    for (i, want) in gradient.iter().enumerate() {
        let value = g.sh.coefficients[i];
        // Sums are rounded: what counts is how far apart the two are.
        let (up, down) = (value + step, value - step);
        let mut at = |value: f32| {
            g.sh.coefficients[i] = value;
            loss(&g)
        };
        let difference = (at(up) - at(down)) / (f64::from(up) - f64::from(down));
        at(value);
        assert!((difference - want).abs() < 1e-7, "{i}: {difference} {want}");
    }
}
