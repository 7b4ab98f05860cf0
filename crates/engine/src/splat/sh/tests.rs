//! The basis, and what is computed side by side.
use super::*;
use crate::sample::sample;
use crate::scene::Gaussians;
use crate::splat::{Changes, Learnable, PreparedView, WeightCache, prepare};
use crate::view::{Split, ViewSampler};

/// Directions spread evenly over the sphere (Fibonacci lattice).
fn sphere(n: usize) -> impl Iterator<Item = [f32; 3]> {
    (0..n).map(move |i| {
        let z = 1.0 - (2.0 * i as f64 + 1.0) / n as f64;
        let r = (1.0 - z * z).sqrt();
        let a = i as f64 * std::f64::consts::PI * (3.0 - 5f64.sqrt());
        [(r * a.cos()) as f32, (r * a.sin()) as f32, z as f32]
    })
}

#[test]
fn the_basis_is_orthonormal() {
    let n = 20_000;
    let mut gram = [[0.0f64; MAX_COEFFICIENTS]; MAX_COEFFICIENTS];
    for dir in sphere(n) {
        let b = basis(4, dir);
        for i in 0..MAX_COEFFICIENTS {
            for j in 0..MAX_COEFFICIENTS {
                gram[i][j] += f64::from(b[i] * b[j]) * 4.0 * std::f64::consts::PI / n as f64;
            }
        }
    }
    for i in 0..MAX_COEFFICIENTS {
        for j in 0..MAX_COEFFICIENTS {
            let want = f64::from(i == j);
            assert!((gram[i][j] - want).abs() < 2e-3, "<{i},{j}> = {}", gram[i][j]);
        }
    }
}

#[test]
fn lower_degrees_are_prefixes() {
    let dir = [0.48, -0.6, 0.64];
    let full = basis(4, dir);
    for degree in 0..4 {
        let count = (degree + 1) * (degree + 1);
        let b = basis(degree, dir);
        assert_eq!(b[..count], full[..count]);
        assert!(b[count..].iter().all(|v| *v == 0.0));
    }
}

/// A scene from three sides; of the last side less is shown, and every twentieth Gaussian only.
fn views(scene: &Gaussians) -> [PreparedView; 3] {
    let sampler = ViewSampler::new(scene, 1).unwrap();
    let mut views = [0, 1, 2].map(|index| {
        let camera = sampler.camera(Split::Training, index, 64);
        prepare(scene, &camera, WeightCache::None).unwrap()
    });
    let last = &mut views[2];
    last.degree = 1;
    let kept = |i: &usize| last.visible[*i].is_multiple_of(20);
    let kept: Vec<usize> = (0..last.visible.len()).filter(kept).collect();
    last.directions = kept.iter().map(|i| last.directions[*i]).collect();
    last.visible = kept.iter().map(|i| last.visible[*i]).collect();
    views
}

#[test]
fn gaussians_side_by_side_have_the_bytes_of_those_one_by_one() {
    let scene = sample(2500, 3, 1).unwrap().gaussians;
    let prepared = views(&scene);
    // Not all are learned, and not in all bands.
    let seen: Vec<bool> = (0..scene.len()).map(|row| row % 3 != 0).collect();
    let learnable = Learnable::new(&seen, 2);
    let values: Vec<f32> = (0..learnable.len()).map(|i| (i % 17) as f32 * 0.01 - 0.08).collect();
    let changes = Changes {
        learnable: &learnable,
        values: &values,
    };
    for together in [&[&prepared[0], &prepared[1], &prepared[2]][..], &[&prepared[2]]] {
        let all = colours_of_views(&scene.sh, Some(changes), together);
        let mut expected = vec![0.0f32; learnable.len()];
        for (view, colours) in together.iter().zip(&all) {
            for (i, row) in view.visible.iter().enumerate() {
                let b = basis(3.min(view.degree), view.directions[i]);
                let changed = changes.of(*row).unwrap_or_default();
                let plain = &scene.sh.coefficients[*row as usize * 48..][..48];
                for j in 0..3 {
                    let coefficient = |k: usize| plain[3 * k + j] + changed.get(3 * k + j).unwrap_or(&0.0);
                    let colour = (0..16).fold(0.5f32, |sum, k| sum + b[k] * coefficient(k)).max(0.0);
                    assert_eq!(colours[3 * i + j], colour, "row {row}");
                    let Some(slot) = learnable.slot(*row).filter(|_| colour > 0.0) else {
                        continue;
                    };
                    for k in 0..9 {
                        let b = if k < terms(view.degree) { b[k] } else { 0.0 };
                        expected[27 * slot + 3 * k + j] += b * ((i + j) % 7) as f32;
                    }
                }
            }
        }
        let gradients: Vec<Vec<f32>> = together
            .iter()
            .map(|view| {
                (0..3 * view.visible.len())
                    .map(|n| ((n / 3 + n % 3) % 7) as f32)
                    .collect()
            })
            .collect();
        let of_views = together.iter().zip(&all).zip(&gradients);
        let of_views = of_views.map(|((view, colours), gradient)| ColourGradient {
            view,
            colours,
            gradient,
        });
        let mut out = vec![0.0f32; learnable.len()];
        backward_of_views(&learnable, &of_views.collect::<Vec<_>>(), &mut out);
        assert!(out == expected && out.iter().any(|v| *v != 0.0));
    }
}
