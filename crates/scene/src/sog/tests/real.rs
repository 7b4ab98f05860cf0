//! Real scenes, packed here by the published formulas and read again, are what they were but for rounding.
use super::*;
use crate::Gaussians;

/// The byte or 16 bits nearest to a share of `steps`.
fn quantise(share: f64, steps: f64) -> u16 {
    (share * steps).round().clamp(0.0, steps) as u16
}

fn min_max(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::MAX, f64::MIN), |(min, max), v| (min.min(v), max.max(v)))
}

/// Packs the scene with tables of equal steps, and a palette of the first 512 Gaussians' higher bands that all share.
fn pack(g: &Gaussians) -> (File, f64) {
    let mut file = File::new(2, g.sh.degree, g.len());
    let log = |v: f32| f64::from(v.signum()) * f64::from(v.abs()).ln_1p();
    for axis in 0..3 {
        let (min, max) = min_max(g.positions.iter().map(|p| log(p[axis])));
        file = file
            .with(&format!("/means/mins/{axis}"), min.into())
            .with(&format!("/means/maxs/{axis}"), max.into());
        for (row, position) in g.positions.iter().enumerate() {
            let [low, high] = quantise((log(position[axis]) - min) / (max - min), 65535.0).to_le_bytes();
            file.pixels("means_l")[row][axis] = low;
            file.pixels("means_u")[row][axis] = high;
        }
    }
    for (row, q) in g.rotations.iter().enumerate() {
        let norm = q.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>().sqrt();
        let largest = (0..4).max_by(|a, b| q[*a].abs().total_cmp(&q[*b].abs())).unwrap();
        let mut rest = q.to_vec();
        let sign = f64::from(rest.remove(largest).signum());
        let byte = |v: f32| quantise(0.5 + sign * f64::from(v) / norm * 0.5f64.sqrt(), 255.0) as u8;
        file.pixels("quats")[row] = [byte(rest[0]), byte(rest[1]), byte(rest[2]), 252 + largest as u8];
    }
    let (min, max) = min_max(g.log_scales.iter().flatten().map(|v| f64::from(*v)));
    let table = |min: f64, max: f64| {
        (0..256)
            .map(|i| min + (max - min) * f64::from(i) / 255.0)
            .collect::<Vec<_>>()
    };
    file = file.with("/scales/codebook", json!(table(min, max)));
    for (row, s) in g.log_scales.iter().enumerate() {
        let index = s.map(|v| quantise((f64::from(v) - min) / (max - min), 255.0) as u8);
        file.pixels("scales")[row][..3].copy_from_slice(&index);
    }
    let per_gaussian = g.sh.per_gaussian();
    let colours = || g.sh.coefficients.chunks_exact(per_gaussian);
    let (low, high) = min_max(colours().flat_map(|c| &c[..3]).map(|v| f64::from(*v)));
    file = file.with("/sh0/codebook", json!(table(low, high)));
    for (row, c) in colours().enumerate() {
        let index = |v: f32| quantise((f64::from(v) - low) / (high - low), 255.0) as u8;
        let alpha = quantise(1.0 / (1.0 + (-f64::from(g.opacity_logits[row])).exp()), 255.0) as u8;
        file.pixels("sh0")[row] = [index(c[0]), index(c[1]), index(c[2]), alpha];
    }
    let mut step = 0.0;
    if g.sh.degree > 0 {
        let (low, high) = min_max(colours().flat_map(|c| &c[3..]).map(|v| f64::from(*v)));
        step = (high - low) / 255.0;
        let mut codebook = table(low, high);
        let zero = quantise(-low / (high - low), 255.0);
        codebook[usize::from(zero)] = 0.0;
        file = file
            .with("/shN/codebook", json!(codebook))
            .with("/shN/count", 512.into());
        let centroids = file.pixels("shN_centroids");
        centroids.clear();
        for c in colours().take(512) {
            let index = |v: f32| quantise((f64::from(v) - low) / (high - low), 255.0) as u8;
            centroids.extend(c[3..].chunks(3).map(|c| [index(c[0]), index(c[1]), index(c[2]), 255]));
        }
        for (row, label) in file.pixels("shN_labels").iter_mut().enumerate() {
            let [low, high] = (row as u16 % 512).to_le_bytes();
            *label = [low, high, 0, 255];
        }
    }
    (file, step)
}

#[test]
fn real_scenes_survive_but_for_rounding() {
    for name in ["donut.ply", "playbot_8k.ply"] {
        let Some(path) = crate::testing::scene_path(name) else {
            return;
        };
        let scene = Scene::read(&path).unwrap();
        let old = &scene.gaussians;
        let (file, step) = pack(old);
        let bytes = file.bytes();
        let packed = read(&bytes).unwrap();
        let new = &packed.gaussians;
        assert_eq!((new.len(), new.sh.degree), (old.len(), old.sh.degree));
        let codebook = |name: &str| file.meta[name]["codebook"].as_array().unwrap()[..2].to_vec();
        let gap = |name| (codebook(name)[1].as_f64().unwrap() - codebook(name)[0].as_f64().unwrap()) as f32;
        let (scale, colour) = (0.501 * gap("scales"), 0.501 * gap("sh0"));
        let per_gaussian = old.sh.per_gaussian();
        for row in 0..old.len() {
            for axis in 0..3 {
                // Half a step of the logarithm, whose range is at most 3, times exp of it.
                let (a, b) = (old.positions[row][axis], new.positions[row][axis]);
                assert!((a - b).abs() < 3e-5 * (1.0 + a.abs()), "{name} {row}: {a} {b}");
                assert!((old.log_scales[row][axis] - new.log_scales[row][axis]).abs() < scale);
                let i = row * per_gaussian + axis;
                assert!((old.sh.coefficients[i] - new.sh.coefficients[i]).abs() < colour);
            }
            assert!((old.opacity(row) - new.opacity(row)).abs() < 0.002);
            let norm = old.rotations[row].iter().map(|v| v * v).sum::<f32>().sqrt();
            let cosine: f32 = (0..4)
                .map(|i| old.rotations[row][i] / norm * new.rotations[row][i])
                .sum();
            assert!(cosine.abs() > 0.9999, "{name} {row}: {cosine}");
            for i in 3..per_gaussian {
                let shared = old.sh.coefficients[row % 512 * per_gaussian + i];
                let found = new.sh.coefficients[row * per_gaussian + i];
                assert!(
                    f64::from((shared - found).abs()) < 1.01 * step,
                    "{name} {row}: {shared} {found}"
                );
            }
        }
        // A change of colour comes back, and changes nothing else.
        let sh = changed(&packed, |i, value| value + 0.2 * (i as f32).sin());
        let out = written(&packed, &sh);
        let again = read(&out).unwrap().gaussians;
        assert_eq!(bits(&again.sh.coefficients), bits(&sh.coefficients));
        assert_ne!(again.sh, new.sh);
        assert_eq!((&again.positions, &again.rotations), (&new.positions, &new.rotations));
        assert_eq!(
            (&again.log_scales, &again.opacity_logits),
            (&new.log_scales, &new.opacity_logits)
        );
    }
}
