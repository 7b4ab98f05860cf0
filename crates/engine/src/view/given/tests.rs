//! Views around cameras that were given.
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;

/// A box of Gaussians around the origin, 2 to a side, and cameras on a circle inside that look outwards.
fn room(cameras: usize) -> (Gaussians, Vec<Camera>) {
    let mut positions = Vec::new();
    for i in 0..20 {
        for j in 0..20 {
            let [u, v] = [i, j].map(|k| k as f32 / 10.0 - 0.95);
            for side in [-1.0, 1.0] {
                positions.extend([[side, u, v], [u, side, v], [u, v, side]]);
            }
        }
    }
    let count = positions.len();
    let scene = Gaussians {
        positions,
        rotations: vec![[1.0, 0.0, 0.0, 0.0]; count],
        log_scales: vec![[-3.0; 3]; count],
        opacity_logits: vec![3.0; count],
        ..Gaussians::default()
    };
    let camera = |i: usize| {
        let angle = i as f32 / cameras as f32 * std::f32::consts::TAU;
        let eye = [0.4 * angle.cos(), 0.4 * angle.sin(), 0.0];
        let target = [2.0 * angle.cos(), 2.0 * angle.sin(), 0.1];
        Camera::look_at(eye, target, [0.0, 0.0, 1.0], 1.0, 300, 200)
    };
    (scene, (0..cameras).map(camera).collect())
}

fn views(given: &GivenViews, count: u64) -> Vec<Camera> {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    (0..count).map(|index| given.training(index, 64, &mut random)).collect()
}

#[test]
fn training_views_are_where_cameras_are_and_not_in_walls() {
    let (scene, cameras) = room(24);
    let given = GivenViews::new(&scene, &cameras).unwrap();
    assert_eq!((given.training.len(), given.held_out.len()), (21, 3));
    for view in views(&given, 400) {
        let [x, y, z] = view.centre();
        assert!((x * x + y * y).sqrt() < 0.6 && z.abs() < 0.2, "{x} {y} {z}");
        assert!(given.distance_to_solid([x, y, z]) >= given.clearance);
        // Outwards, about as the nearest camera does.
        let outwards = unit([x, y, 0.0]).unwrap();
        assert!(dot(view.rotation[2], outwards) > 0.8);
        let r = view.rotation;
        assert!((dot(r[0], r[1]).abs() + dot(r[1], r[2]).abs()) < 1e-4, "{r:?}");
        let turned = sub(cross(r[0], r[1]), r[2]);
        assert!(dot(turned, turned) < 1e-6, "{r:?}");
    }
}

#[test]
fn held_out_cameras_are_kept_apart() {
    let (scene, cameras) = room(24);
    let given = GivenViews::new(&scene, &cameras).unwrap();
    let held: Vec<Camera> = (0..6).map(|index| given.held_out(index, 64)).collect();
    assert_eq!(held[0], held[3]);
    assert_eq!(held[1].centre(), cameras[8].centre());
    assert!(views(&given, 400).iter().all(|view| given.is_apart(view)));
    // Few cameras, one of which is held out.
    let (scene, cameras) = room(3);
    let given = GivenViews::new(&scene, &cameras).unwrap();
    assert_eq!((given.training.len(), given.held_out.len()), (2, 1));
    assert!(GivenViews::new(&scene, &cameras[..1]).is_err());
}

#[test]
fn a_square_is_the_middle_of_a_picture() {
    let (_, cameras) = room(2);
    let view = square(&cameras[0], 100, 1.0);
    // 200 pixels of height become 100.
    assert_eq!((view.width, view.height, view.fx), (100, 100, cameras[0].fx / 2.0));
    assert_eq!((view.cx, view.cy), (50.0, 50.0));
    assert!(square(&cameras[0], 100, 1.2).fx < view.fx);
}

/// Cameras that were all taken at one place have nothing between them.
#[test]
fn a_panorama_is_seen_from_its_place() {
    let (scene, mut cameras) = room(16);
    for camera in &mut cameras {
        camera.translation = [0.0; 3];
    }
    let given = GivenViews::new(&scene, &cameras).unwrap();
    for view in views(&given, 50) {
        assert_eq!(view.centre().map(f32::abs), [0.0; 3]);
        let ahead = |held: &Camera| dot(view.rotation[2], held.rotation[2]);
        assert!(given.held_out.iter().all(|held| ahead(held) <= TURNED.cos()));
        assert!(view.rotation.iter().flatten().all(|x| x.is_finite()));
    }
}
