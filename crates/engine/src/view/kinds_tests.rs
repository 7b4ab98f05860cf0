//! Tests of kinds of scenes: which is found, and where its views are.
use super::lattice::lattice;
use super::vector::{along, cross, dot, sub};
use super::{Camera, Extent, SceneKind, Split, ViewSampler, Viewpoints};
use crate::sample::sample_of;
use crate::scene::Gaussians;
use crate::testing::scene_path;

fn scene(kind: SceneKind, seed: u64) -> Gaussians {
    sample_of(kind, 4000, 0, seed).unwrap().gaussians
}

fn views(sampler: &ViewSampler, split: Split) -> Vec<Camera> {
    (0..60).map(|index| sampler.camera(split, index, 32)).collect()
}

#[test]
fn samples_are_of_the_kind_that_they_were_made_as() {
    for kind in SceneKind::ALL {
        for seed in 0..6 {
            let (found, openness) = SceneKind::of(&scene(kind, seed)).unwrap();
            assert_eq!(found, kind, "seed {seed}: {openness:?}");
        }
    }
}

#[test]
fn colours_do_not_count() {
    for kind in SceneKind::ALL {
        let mut marked = scene(kind, 3);
        let before = SceneKind::of(&marked).unwrap();
        marked.sh.coefficients.iter_mut().for_each(|c| *c += 0.1);
        assert_eq!(SceneKind::of(&marked).unwrap(), before);
    }
}

/// Marks of before kinds were there are read from the same cameras.
#[test]
fn real_scenes_are_objects_and_keep_their_cameras() {
    for name in [
        "pod.ply",
        "donut.ply",
        "playbot_8k.ply",
        "guitar.compressed.ply",
        "plant.splat",
    ] {
        let Some(path) = scene_path(name) else { return };
        let gaussians = crate::scene::Scene::read(&path).unwrap().gaussians;
        let found = ViewSampler::new(&gaussians, 2).unwrap();
        let object = ViewSampler::around(&gaussians, 2).unwrap();
        assert_eq!(found.kind(), SceneKind::Object, "{name}");
        assert_eq!(
            found.camera(Split::HeldOut, 5, 64),
            object.camera(Split::HeldOut, 5, 64)
        );
    }
}

#[test]
fn splits_of_every_kind_are_apart_whatever_the_seeds() {
    for (kind, least) in [
        (SceneKind::Room, 2.4f32),
        (SceneKind::Terrain, 1.7),
        (SceneKind::Forward, 1.2),
        (SceneKind::Unbounded, 1.7),
    ] {
        let scene = scene(kind, 1);
        let [a, b] = [4, 5].map(|seed| ViewSampler::new(&scene, seed).unwrap());
        assert_eq!(a.kind(), kind);
        let held_out = views(&b, Split::HeldOut);
        for view in views(&a, Split::Training) {
            let nearest = held_out.iter().map(|held| dot(held.rotation[2], view.rotation[2]));
            let nearest = nearest.fold(-1.0, f32::max).acos().to_degrees();
            assert!(nearest > least, "{kind}: {nearest} degrees");
        }
        assert_ne!(a.camera(Split::HeldOut, 0, 32), b.camera(Split::HeldOut, 0, 32));
        let again = ViewSampler::new(&scene, 4).unwrap();
        assert_eq!(a.camera(Split::Training, 7, 32), again.camera(Split::Training, 7, 32));
    }
}

#[test]
fn viewers_of_a_room_stand_in_free_space_and_look_about() {
    for seed in 0..3 {
        let scene = scene(SceneKind::Room, seed);
        let sampler = ViewSampler::new(&scene, seed).unwrap();
        let clearance = sampler.inside().unwrap().clearance();
        assert!(clearance > 0.1, "{clearance}");
        let up = sampler.extent().up;
        let mut sides = [false; 8];
        for view in views(&sampler, Split::Training)
            .into_iter()
            .chain(views(&sampler, Split::HeldOut))
        {
            let eye = view.centre();
            assert!(
                eye[0].abs() < 2.0 && eye[2].abs() < 1.6 && (-1.7..0.0).contains(&eye[1]),
                "{eye:?}"
            );
            let way = |p: &[f32; 3]| dot(sub(*p, eye), sub(*p, eye));
            let nearest = scene.positions.iter().map(way).fold(f32::INFINITY, f32::min).sqrt();
            // The grid knows places to half a cell each way.
            assert!(nearest > 0.5 * clearance, "seed {seed}: {nearest}, {clearance}");
            let forward = view.rotation[2];
            assert!((-0.51..0.43).contains(&dot(forward, up)), "{forward:?}");
            let turn = forward[0].atan2(forward[2]) / std::f32::consts::TAU + 0.5;
            sides[((turn * 8.0) as usize).min(7)] = true;
            // Upright, and a rotation.
            assert!(dot(view.rotation[1], up) < 0.0);
            let right_handed = sub(cross(view.rotation[0], view.rotation[1]), forward);
            assert!(dot(right_handed, right_handed) < 1e-6);
        }
        assert_eq!(sides, [true; 8]);
    }
}

#[test]
fn a_stage_is_seen_from_its_front_and_terrain_from_above() {
    for seed in 0..3 {
        let stage = ViewSampler::new(&scene(SceneKind::Forward, seed), seed).unwrap();
        for view in views(&stage, Split::Training) {
            assert!(
                view.rotation[2][2] > 0.6 && view.centre()[2] < -1.5,
                "{:?}",
                view.centre()
            );
        }
        let terrain = ViewSampler::new(&scene(SceneKind::Terrain, seed), seed).unwrap();
        for view in views(&terrain, Split::Training) {
            // y points down.
            assert!(
                view.rotation[2][1] > 0.57 && view.centre()[1] < -1.0,
                "{:?}",
                view.centre()
            );
        }
    }
}

/// Marks of forward-facing captures are not read from behind, so nothing may be taken for one because nothing hides behind it.
#[test]
fn glass_and_floaters_leave_an_object_an_object() {
    for seed in 0..4 {
        let mut glass = scene(SceneKind::Object, seed);
        glass.opacity_logits.fill(-2.0);
        assert_eq!(SceneKind::of(&glass).unwrap().0, SceneKind::Object, "glass {seed}");
        let mut floaters = scene(SceneKind::Object, seed);
        for i in 0..200 {
            let (sine, cosine) = (i as f32 * 2.4).sin_cos();
            let reach = 2.0 + 0.02 * i as f32;
            floaters.positions[20 * i] = [reach * cosine, 3.0 * (i as f32 * 0.77).sin() - 1.0, reach * sine];
            floaters.log_scales[20 * i] = [-2.5; 3];
        }
        let (kind, openness) = SceneKind::of(&floaters).unwrap();
        assert_eq!(kind, SceneKind::Object, "floaters {seed}: {openness:?}");
    }
}

/// Adds splats of that size on a shell around the scene, where `keeps` says.
fn with_floaters(scene: &Gaussians, count: usize, log_scale: f32, keeps: impl Fn([f32; 3]) -> bool) -> Gaussians {
    let extent = Extent::of(scene).unwrap();
    let mut out = scene.clone();
    let per_gaussian = scene.sh.coefficients.len() / scene.len();
    for (number, direction) in lattice(count).enumerate() {
        if keeps(direction) {
            let reach = extent.radius * (1.2 + 0.6 * (0.618 * number as f32).fract());
            out.positions.push(along(extent.centre, reach, direction));
            out.log_scales.push([log_scale; 3]);
            out.rotations.push([1.0, 0.0, 0.0, 0.0]);
            out.opacity_logits.push(1.0);
            out.sh.coefficients.extend(vec![0.0; per_gaussian]);
        }
    }
    out
}

#[test]
fn captures_from_one_side_amid_floaters_are_seen_from_there() {
    for seed in 0..4 {
        let stage = scene(SceneKind::Forward, seed);
        // Captors stood before it, at low z, and saw no floaters there but a few.
        let amid = with_floaters(&stage, 900, -1.2, |direction| direction[2] > -0.8);
        let (kind, openness) = SceneKind::of(&amid).unwrap();
        assert_eq!(kind, SceneKind::Forward, "seed {seed}: {openness:?}");
        assert!(openness.vantage.is_some() && openness.front[2] < -0.5, "{openness:?}");
    }
}

#[test]
fn rooms_amid_floaters_are_seen_from_inside() {
    for seed in 0..4 {
        let amid = with_floaters(&scene(SceneKind::Room, seed), 900, -0.9, |_| true);
        let (kind, openness) = SceneKind::of(&amid).unwrap();
        assert_eq!(kind, SceneKind::Room, "seed {seed}: {openness:?}");
        // The grid says so too: what views see must be enough by itself.
        assert_eq!(
            openness.vantage.unwrap().kind(),
            SceneKind::Room,
            "seed {seed}: {openness:?}"
        );
    }
}

/// Among a few large splats one can stand, and sees more from there.
#[test]
fn objects_of_few_splats_are_no_rooms() {
    for (count, seed) in [(200, 0), (200, 3), (300, 5), (500, 2)] {
        let few = sample_of(SceneKind::Object, count, 0, seed).unwrap().gaussians;
        let (kind, openness) = SceneKind::of(&few).unwrap();
        assert_eq!(kind, SceneKind::Object, "{count}, seed {seed}: {openness:?}");
        assert!(openness.vantage.is_some());
    }
}

#[test]
fn viewers_of_an_unbounded_scene_stand_around_what_it_was_captured_for() {
    for seed in 0..3 {
        let scene = scene(SceneKind::Unbounded, seed);
        let sampler = ViewSampler::new(&scene, seed).unwrap();
        assert_eq!(sampler.kind(), SceneKind::Unbounded);
        let mut sides = [false; 8];
        for split in [Split::Training, Split::HeldOut] {
            for view in views(&sampler, split) {
                let [x, y, z] = view.centre();
                let reach = x.hypot(z);
                // Above the ground (y points down), beyond the disc's things and before the nearest house.
                assert!((1.0..9.0).contains(&reach) && y < -0.1, "seed {seed}: {reach}, {y}");
                // The middle of the disc is in the picture.
                let ahead = dot(view.rotation[2], sub([0.0, -0.3, 0.0], [x, y, z]));
                let aside = dot(view.rotation[0], sub([0.0, -0.3, 0.0], [x, y, z]));
                assert!(
                    ahead > 0.0 && (aside / ahead).abs() < 0.4,
                    "seed {seed}: {aside} of {ahead}"
                );
                let turn = z.atan2(x) / std::f32::consts::TAU + 0.5;
                sides[((turn * 8.0) as usize).min(7)] = true;
            }
        }
        assert_eq!(sides, [true; 8]);
    }
}

#[test]
fn training_views_of_an_unbounded_scene_go_beyond_those_that_are_verified() {
    let scene = scene(SceneKind::Unbounded, 1);
    let sampler = ViewSampler::new(&scene, 1).unwrap();
    let focus = sampler.focus().unwrap();
    let ends = |split| {
        let numbers = (0..200).map(|index| sampler.camera(split, index, 100)).map(|view| {
            let way = sub(focus.centre, view.centre());
            [dot(way, way).sqrt() / focus.radius, view.fy]
        });
        let start = [[f32::INFINITY, f32::NEG_INFINITY]; 2];
        numbers.fold(start, |ends, numbers| {
            std::array::from_fn(|k| [ends[k][0].min(numbers[k]), ends[k][1].max(numbers[k])])
        })
    };
    let [training, held_out] = [Split::Training, Split::HeldOut].map(ends);
    for (training, held_out) in training.iter().zip(held_out) {
        assert!(
            training[0] < held_out[0] && held_out[1] < training[1],
            "{training:?} {held_out:?}"
        );
    }
}

#[test]
fn a_kind_can_be_said_and_is_refused_where_there_is_no_place() {
    let object = scene(SceneKind::Object, 1);
    for kind in [SceneKind::Terrain, SceneKind::Forward, SceneKind::Unbounded] {
        let said = Viewpoints {
            kind: Some(kind),
            cameras: &[],
        };
        assert_eq!(ViewSampler::seen_from(&object, 1, said).unwrap().kind(), kind);
    }
    let mut flat = scene(SceneKind::Terrain, 1);
    flat.positions.iter_mut().for_each(|position| position[1] = 0.0);
    let room = Viewpoints {
        kind: Some(SceneKind::Room),
        cameras: &[],
    };
    let reason = ViewSampler::seen_from(&flat, 1, room)
        .map(|_| ())
        .unwrap_err()
        .to_string();
    assert!(reason.contains("no free place"), "{reason}");
    let mut inside = ViewSampler::new(&scene(SceneKind::Room, 1), 1).unwrap();
    assert!(
        inside
            .train_on_ring(0.5)
            .unwrap_err()
            .to_string()
            .contains("taken for room")
    );
    assert!("castle".parse::<SceneKind>().is_err());
}

/// What no place has, or nothing but one, is an object.
#[test]
fn degenerate_scenes_are_objects() {
    for log_scale in [f32::NEG_INFINITY, -30.0, 0.0, 20.0] {
        for position in [[0.0; 3], [1e6, -3.0, 2.0]] {
            let one = Gaussians {
                positions: vec![position; 2],
                rotations: vec![[0.0; 4]; 2],
                log_scales: vec![[log_scale; 3]; 2],
                opacity_logits: vec![f32::NEG_INFINITY; 2],
                ..Gaussians::default()
            };
            assert!(Extent::of(&one).is_ok());
            assert_eq!(SceneKind::of(&one).unwrap().0, SceneKind::Object);
        }
    }
}
