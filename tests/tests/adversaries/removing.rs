//! Whoever has the program, and not the key, marks scenes of their own and learns to undo what that does.
use std::collections::BTreeMap;

use guardsplat_engine::scene::Gaussians;

use crate::attacked::{Attacked, mark, scene};

/// What a remover sees of a Gaussian: its colour, the mean of those around it, how they differ, and products of these.
const FEATURES: usize = 3 + 3 + 3 + 6 + 1;
/// Gaussians around one that are looked at.
const AROUND: usize = 8;
/// Of ridge regression.
const RIDGE: f64 = 1e-3;

fn dc(scene: &Gaussians, row: usize) -> [f32; 3] {
    let at = row * scene.sh.per_gaussian();
    std::array::from_fn(|i| scene.sh.coefficients[at + i])
}

/// Means of the constant colours around each Gaussian: of those in the same and neighbouring cells of a grid.
fn surroundings(scene: &Gaussians) -> Vec<[f32; 3]> {
    let extent: f32 = (0..3)
        .map(|i| {
            let axis = scene.positions.iter().map(|p| p[i]);
            axis.clone().fold(f32::MIN, f32::max) - axis.fold(f32::MAX, f32::min)
        })
        .fold(0.0, f32::max);
    let cell = (extent / (scene.len() as f32 / AROUND as f32).sqrt()).max(1e-6);
    let place = |p: &[f32; 3]| p.map(|v| (v / cell).floor() as i64);
    let mut cells: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    for (row, position) in scene.positions.iter().enumerate() {
        cells.entry(place(position)).or_default().push(row);
    }
    (0..scene.len())
        .map(|row| {
            let own = place(&scene.positions[row]);
            let (mut sum, mut count) = ([0.0_f32; 3], 0.0);
            for other in cells[&own].iter().filter(|other| **other != row).take(4 * AROUND) {
                let colour = dc(scene, *other);
                for i in 0..3 {
                    sum[i] += colour[i];
                }
                count += 1.0;
            }
            match count {
                0.0 => dc(scene, row),
                _ => sum.map(|v| v / count),
            }
        })
        .collect()
}

fn features(scene: &Gaussians, around: &[[f32; 3]], row: usize) -> [f64; FEATURES] {
    let (own, near) = (dc(scene, row), around[row]);
    let mut out = [1.0; FEATURES];
    for i in 0..3 {
        out[i] = own[i].into();
        out[3 + i] = near[i].into();
        out[6 + i] = (own[i] - near[i]).tanh().into();
    }
    for (k, (i, j)) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].into_iter().enumerate() {
        out[9 + k] = (own[i] * own[j]).into();
    }
    out
}

/// Weights of a linear remover: least squares of what a mark took from colours, over pairs of marked and original scenes.
fn learn(pairs: &[(Gaussians, Gaussians)]) -> [[f64; FEATURES]; 3] {
    let mut square = [[0.0; FEATURES]; FEATURES];
    let mut product = [[0.0; FEATURES]; 3];
    for (marked, original) in pairs {
        let around = surroundings(marked);
        for row in 0..marked.len() {
            let x = features(marked, &around, row);
            let (before, after) = (dc(original, row), dc(marked, row));
            for i in 0..FEATURES {
                for j in 0..FEATURES {
                    square[i][j] += x[i] * x[j];
                }
                for channel in 0..3 {
                    product[channel][i] += x[i] * f64::from(before[channel] - after[channel]);
                }
            }
        }
    }
    let scale = square[FEATURES - 1][FEATURES - 1];
    for (i, row) in square.iter_mut().enumerate() {
        row[i] += RIDGE * scale;
    }
    product.map(|b| solve(square, b))
}

/// Gaussian elimination with pivots.
fn solve(mut a: [[f64; FEATURES]; FEATURES], mut b: [f64; FEATURES]) -> [f64; FEATURES] {
    for i in 0..FEATURES {
        let pivot = (i..FEATURES)
            .max_by(|&x, &y| a[x][i].abs().total_cmp(&a[y][i].abs()))
            .unwrap();
        a.swap(i, pivot);
        b.swap(i, pivot);
        for j in i + 1..FEATURES {
            let factor = a[j][i] / a[i][i];
            for k in i..FEATURES {
                a[j][k] -= factor * a[i][k];
            }
            b[j] -= factor * b[i];
        }
    }
    for i in (0..FEATURES).rev() {
        let rest: f64 = (i + 1..FEATURES).map(|k| a[i][k] * b[k]).sum();
        b[i] = (b[i] - rest) / a[i][i];
    }
    b
}

/// Takes from a scene what the remover says, so many times over.
fn removed(scene: &Gaussians, weights: &[[f64; FEATURES]; 3], times: f64) -> Gaussians {
    let around = surroundings(scene);
    let mut out = scene.clone();
    let stride = scene.sh.per_gaussian();
    for row in 0..scene.len() {
        let x = features(scene, &around, row);
        for (channel, weights) in weights.iter().enumerate() {
            let change: f64 = weights.iter().zip(x).map(|(w, x)| w * x).sum();
            out.sh.coefficients[row * stride + channel] += (times * change) as f32;
        }
    }
    out
}

/// Takes from a scene a share of how each colour differs from those around it.
fn smoothed(scene: &Gaussians, share: f32) -> Gaussians {
    let around = surroundings(scene);
    let mut out = scene.clone();
    let stride = scene.sh.per_gaussian();
    for (row, near) in around.iter().enumerate() {
        for (channel, near) in near.iter().enumerate() {
            let own = &mut out.sh.coefficients[row * stride + channel];
            *own += share * (near - *own);
        }
    }
    out
}

#[test]
#[ignore = "minutes; run by people: docs/security.md"]
fn a_remover_that_was_trained_on_other_keys() {
    let Some(it) = Attacked::new() else { return };
    let environment = &it.environment;
    println!("figure: marked: {}", it.left(&it.marked));
    let mut pairs = Vec::new();
    for seed in [21, 22, 23] {
        let name = format!("s{seed}.ply");
        environment.exits(
            &format!("sample {name} --gaussians 20000 --sh-degree 3 --seed {seed}"),
            0,
        );
        let word = format!("{:016x}", 0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(seed));
        let marked = mark(environment, &name, seed, &word);
        pairs.push((scene(environment, &marked), scene(environment, &name)));
    }
    // And of the very scene, with keys of their own, which is more than an attacker has.
    let own = mark(environment, "in.ply", 24, "0123456789abcdef");
    let known = vec![(scene(environment, &own), it.original.clone())];
    for (what, pairs) in [("other scenes", &pairs), ("the same scene", &known)] {
        let weights = learn(pairs);
        for times in [1.0, 3.0] {
            let left = it.left(&removed(&it.marked, &weights, times));
            println!("figure: remover of {what}, {times} times: {left}");
        }
    }
    for share in [0.02, 0.05, 0.1, 0.2] {
        println!("figure: smoothed by {share}: {}", it.left(&smoothed(&it.marked, share)));
    }
}
