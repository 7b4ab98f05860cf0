//! Real files: the same scene as SPZ and as PLY.
use super::*;
use crate::testing::scene_path;
use crate::{Format, Gaussians};

fn scene(name: &str) -> Option<(Scene, Vec<u8>)> {
    let path = scene_path(name)?;
    Some((Scene::read(&path).unwrap(), std::fs::read(path).unwrap()))
}

/// Largest difference of two arrays.
fn apart<'a>(a: impl IntoIterator<Item = &'a f32>, b: impl IntoIterator<Item = &'a f32>) -> f32 {
    a.into_iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// Largest distance between unit quaternions, of which two mean each rotation.
fn rotations_apart(a: &Gaussians, b: &Gaussians) -> f32 {
    let unit = |q: &[f32; 4]| {
        let length = q.iter().map(|v| v * v).sum::<f32>().sqrt();
        q.map(|v| v / length)
    };
    let pairs = a.rotations.iter().zip(&b.rotations);
    let distances = pairs.map(|(a, b)| {
        let (a, b) = (unit(a), unit(b));
        apart(&a, &b).min(apart(&a, &b.map(|v| -v)))
    });
    distances.fold(0.0, f32::max)
}

/// `pod.ply` was made of `pod.spz` (version 2) by another program: the same numbers, without flips.
#[test]
fn a_real_spz_is_the_ply_of_it() {
    let (Some((spz, _)), Some((ply, _))) = (scene("pod.spz"), scene("pod.ply")) else {
        return;
    };
    assert_eq!((spz.format(), spz.exact()), (Format::Spz, false));
    let (a, b) = (&spz.gaussians, &ply.gaussians);
    assert_eq!((a.len(), a.sh.degree), (b.len(), b.sh.degree));
    assert_eq!((a.positions == b.positions, a.log_scales == b.log_scales), (true, true));
    // Of a w near 0 a root leaves but few digits; a step is 8e-3.
    assert!(rotations_apart(a, b) < 1e-5, "{}", rotations_apart(a, b));
    for row in 0..a.len() {
        let (a, b) = (a.opacity(row), b.opacity(row));
        // The PLY has nothing above 511/512, where the bytes have 1.
        assert!((a - b).abs() < 1e-6 || (a > 0.999 && b > 0.998), "{row}: {a} and {b}");
    }
    let colours = apart(&a.sh.coefficients, &b.sh.coefficients);
    assert!(colours < 1e-6, "{colours}");
    // All 101,407 Gaussians have colours, and harmonics that are not all alike.
    assert!(a.sh.coefficients.chunks_exact(48).any(|row| row[47] != 0.0));
}

#[test]
fn real_files_come_back() {
    for name in ["pod.spz", "biker.spz"] {
        let Some((scene, bytes)) = scene(name) else {
            return;
        };
        let again = written(&scene, &scene.gaussians.sh);
        assert!(plain(&again) == plain(&bytes), "{name}");
        // Sections that are as they were keep their streams.
        assert!(name == "pod.spz" || again == bytes, "{name}");
        assert!(again.len() < bytes.len() + bytes.len() / 20, "{name}: {}", again.len());
    }
}

/// Version 4, of an object that stands on the floor: up is y, as the format has it, to 3.18 units.
#[test]
fn a_real_file_of_version_4() {
    let Some((biker, _)) = scene("biker.spz") else {
        return;
    };
    let g = &biker.gaussians;
    assert_eq!((g.len(), g.sh.degree), (152_746, 0));
    let height = |i: usize| g.positions.iter().map(move |p| p[i]);
    assert_eq!(height(1).fold(f32::INFINITY, f32::min), 0.0);
    assert_eq!(height(1).fold(f32::NEG_INFINITY, f32::max), 13_026.0 / 4096.0);
}
