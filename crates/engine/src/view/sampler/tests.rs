//! Where views are taken from, by kinds of scenes.
use std::f32::consts::TAU;

use super::super::lattice::lattice;
use super::super::placing::NEAR;
use super::*;
use crate::view::vector::{dot, frame, sub};

fn ball(scale: f32) -> Gaussians {
    let positions: Vec<[f32; 3]> = lattice(500).map(|p| p.map(|x| x * scale)).collect();
    Gaussians {
        rotations: vec![[0.0; 4]; positions.len()],
        log_scales: vec![[(0.05 * scale).ln(); 3]; positions.len()],
        opacity_logits: vec![2.0; positions.len()],
        positions,
        ..Gaussians::default()
    }
}

/// From which a camera looks: aim jitter moves eye and target together.
fn direction(camera: &Camera) -> [f32; 3] {
    camera.rotation[2].map(|x| -x)
}

#[test]
fn splits_never_meet_whatever_the_seeds() {
    let scene = ball(1.0);
    let (a, b) = (
        ViewSampler::around(&scene, 1).unwrap(),
        ViewSampler::around(&scene, 99).unwrap(),
    );
    let training: Vec<_> = (0..2000)
        .map(|i| direction(&a.camera(Split::Training, i, 32)))
        .collect();
    let mut closest = -1.0f32;
    for sampler in [&a, &b] {
        for i in 0..200 {
            let held_out = direction(&sampler.camera(Split::HeldOut, i, 32));
            closest = training.iter().map(|d| dot(*d, held_out)).fold(closest, f32::max);
        }
    }
    assert!(
        closest < 2.4f32.to_radians().cos(),
        "{} degrees",
        closest.acos().to_degrees()
    );
    // The gap costs little: most of the sphere stays in use.
    assert!(closest > 6f32.to_radians().cos());
}

#[test]
fn a_ring_is_a_circle_that_keeps_away_from_held_out_views() {
    let scene = ball(1.0);
    let sphere = ViewSampler::around(&scene, 4).unwrap();
    let mut ring = sphere.clone();
    ring.train_on_ring(30f32.to_radians()).unwrap();
    let Extent { centre, up, .. } = *ring.extent();
    let cameras: Vec<Camera> = (0..400).map(|i| ring.camera(Split::Training, i, 32)).collect();
    let held_out: Vec<Camera> = (0..200).map(|i| ring.camera(Split::HeldOut, i, 32)).collect();
    let distance = |camera: &Camera| {
        let [x, y, z] = sub(camera.centre(), centre);
        (x * x + y * y + z * z).sqrt()
    };
    let mut azimuths = [false; 12];
    let [east, north, _] = frame(up);
    for camera in &cameras {
        let from = direction(camera);
        assert!((dot(from, up) - 0.5).abs() < 1e-4, "{from:?}");
        assert!((distance(camera) - distance(&cameras[0])).abs() < 1e-3 * distance(camera));
        let turn = dot(from, north).atan2(dot(from, east)) / TAU + 0.5;
        azimuths[((turn * 12.0) as usize).min(11)] = true;
        assert!(
            held_out
                .iter()
                .all(|h| dot(direction(h), from) < 2.4f32.to_radians().cos())
        );
    }
    assert_eq!(azimuths, [true; 12]);
    for (i, camera) in held_out.iter().enumerate() {
        assert_eq!(*camera, sphere.camera(Split::HeldOut, i as u64, 32));
    }
}

#[test]
fn both_splits_look_from_all_around() {
    let sampler = ViewSampler::around(&ball(1.0), 3).unwrap();
    for (split, count) in [(Split::Training, 64), (Split::HeldOut, 24)] {
        for start in [0, 1 << 40] {
            let views: Vec<_> = (start..start + count)
                .map(|i| direction(&sampler.camera(split, i, 32)))
                .collect();
            for probe in lattice(40) {
                let nearest = views.iter().map(|d| dot(*d, probe)).fold(-1.0, f32::max);
                assert!(nearest > 0.6, "{split:?} leaves a hole at {probe:?}: {nearest}");
            }
        }
    }
}

#[test]
fn the_same_arguments_give_the_same_camera_and_others_another() {
    let scene = ball(1.0);
    let sampler = ViewSampler::around(&scene, 5).unwrap();
    let again = ViewSampler::around(&scene, 5).unwrap();
    let other = ViewSampler::around(&scene, 6).unwrap();
    for split in [Split::Training, Split::HeldOut] {
        for index in [0, 7, u64::MAX] {
            let camera = sampler.camera(split, index, 64);
            assert_eq!(camera, again.camera(split, index, 64));
            assert_ne!(camera, other.camera(split, index, 64));
            assert_ne!(camera, sampler.camera(split, index ^ 1, 64));
        }
    }
}

#[test]
fn the_scene_fills_the_picture_beyond_the_near_plane() {
    for scale in [1e-4, 0.1, 1.0, 1e6] {
        let scene = ball(scale);
        let sampler = ViewSampler::around(&scene, 5).unwrap();
        for index in 0..50 {
            let camera = sampler.camera(Split::Training, index, 100);
            let (mut least, mut most) = (f32::INFINITY, f32::NEG_INFINITY);
            for p in &scene.positions {
                let [x, _, z] = camera.to_camera(*p);
                assert!(z > NEAR, "scale {scale}: depth {z}");
                let pixel = camera.fx * x / z + camera.cx;
                (least, most) = (least.min(pixel), most.max(pixel));
            }
            assert!((-10.0..40.0).contains(&least), "scale {scale}: {least}..{most}");
            assert!((60.0..110.0).contains(&most), "scale {scale}: {least}..{most}");
        }
    }
}

#[test]
fn degenerate_scenes_give_finite_cameras() {
    let one = |log_scale: f32, position: [f32; 3]| Gaussians {
        positions: vec![position; 2],
        rotations: vec![[0.0; 4]; 2],
        log_scales: vec![[log_scale; 3]; 2],
        opacity_logits: vec![f32::NEG_INFINITY; 2],
        ..Gaussians::default()
    };
    for log_scale in [f32::NEG_INFINITY, -30.0, 0.0, 20.0] {
        for position in [[0.0; 3], [1e6, -3.0, 2.0]] {
            for kind in [SceneKind::Object, SceneKind::Unbounded] {
                let said = Viewpoints {
                    kind: Some(kind),
                    cameras: &[],
                };
                let sampler = ViewSampler::seen_from(&one(log_scale, position), 1, said).unwrap();
                let camera = sampler.camera(Split::HeldOut, 0, 64);
                let numbers = camera.rotation.into_iter().flatten().chain(camera.translation);
                assert!(numbers.chain([camera.fx, camera.fy]).all(f32::is_finite), "{camera:?}");
                assert!(dot(sub(camera.centre(), position), [1.0; 3]).is_finite());
            }
        }
    }
    assert!(ViewSampler::around(&Gaussians::default(), 1).is_err());
    assert!(ViewSampler::around(&one(0.0, [1e30, 0.0, 0.0]), 1).is_err());
    assert!(ViewSampler::around(&one(80.0, [0.0; 3]), 1).is_err());
}
