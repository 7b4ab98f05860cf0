//! Scenes of the project's own: Gaussians on textured solid shapes that stand on a disc of ground, in a room, on hills, on
//! a stage of which only what its captors saw is there, or on a disc amid a landscape.
//!
//! Points are spread over each surface in proportion to its area; surroundings of the disc are coarser in proportion to
//! their distance. A Gaussian there is as wide as the spacing of
//! points and a tenth of that thick along the surface normal, so that the surface closes without fringes. Its
//! constant colour is the texture under a lamp and a sky; its highlight is a Phong lobe fitted into the spherical
//! harmonics of the scene's degree.
mod arrange;
mod highlight;
mod points;
mod shapes;
mod texture;

use crate::error::{Error, Result};
use crate::scene::{Gaussians, MAX_DEGREE, Scene, Sh};
use crate::view::vector::{along, cross, dot, perpendicular, unit};
use crate::view::{Camera, SceneKind};
use arrange::STAND;
use highlight::Highlight;
use points::Points;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use shapes::Solid;
use texture::Texture;

/// Most Gaussians of a sample; it is meant to be small.
pub const MAX_GAUSSIANS: usize = 10_000_000;

/// Standard deviation along the surface, in spacings of points: neighbours overlap at 0.8 of their height.
const WIDTH: f64 = 0.6;
/// Standard deviation along the normal, in those along the surface.
const FLATNESS: f64 = 0.1;
/// Logit of the opacity of every Gaussian: 0.98.
const OPACITY_LOGIT: f32 = 4.0;
/// Constant term of the spherical harmonics.
const SH_C0: f32 = 0.282_094_8;
/// Direction from which the lamp shines, before it is brought to length 1; y points down, as in captured scenes.
const LAMP: [f32; 3] = [0.45, -0.8, 0.4];

/// Makes a sample scene; the same arguments give the same scene.
///
/// It is about 3 units across, y points down. `sh_degree` is 0 to 4; degree 0 has no highlights.
///
/// # Errors
/// [`Error::BadOption`] for no Gaussians or more than [`MAX_GAUSSIANS`], or a degree above 4.
pub fn sample(gaussians: usize, sh_degree: usize, seed: u64) -> Result<Scene> {
    sample_of(SceneKind::Object, gaussians, sh_degree, seed)
}

/// Where the viewers of a sample are, 640 by 480 pixels: in a room at the height of eyes, half of them looking across it and
/// half along its walls; above a landscape; before a stage. None for an object, which is seen from all around.
pub fn cameras(kind: SceneKind, count: usize) -> Vec<Camera> {
    let camera = |i: usize| {
        // The golden angle: any number of cameras is spread evenly, and neighbours in the list look elsewhere.
        let angle = i as f32 * std::f32::consts::PI * (3.0 - 5f32.sqrt());
        let share = ((i as f32 + 0.5) / count as f32).sqrt();
        let (eye, target) = match kind {
            SceneKind::Object | SceneKind::Room => in_room(i, angle, 0.35 * share),
            SceneKind::Terrain => {
                let reach = 1.3 * share;
                let eye = [reach * angle.cos(), -2.6 - 0.4 * (i % 4) as f32, reach * angle.sin()];
                (eye, [-0.5 * eye[0], 0.0, -0.5 * eye[2]])
            }
            SceneKind::Forward => {
                let [x, y, z] = STAND;
                let eye = [x + 1.1 * share * angle.cos(), y + 0.5 * share * angle.sin(), z];
                (eye, [0.3 * eye[0], -0.4 * arrange::STAGE[1] as f32, 0.0])
            }
            SceneKind::Unbounded => {
                let (elevation, distance) = (0.2 + 0.15 * (i % 4) as f32, 2.8 + 0.7 * share);
                let (sine, cosine) = elevation.sin_cos();
                let eye = [cosine * angle.cos(), -sine, cosine * angle.sin()].map(|x| distance * x);
                (eye, [0.0, -0.3, 0.0])
            }
        };
        Camera::look_at(eye, target, [0.0, -1.0, 0.0], 0.9, 640, 480)
    };
    let count = if kind == SceneKind::Object { 0 } else { count };
    (0..count).map(camera).collect()
}

/// Eye and target of a camera in a room, so far from its middle.
fn in_room(i: usize, angle: f32, reach: f32) -> ([f32; 3], [f32; 3]) {
    let [a, b] = arrange::ROOM.map(|side| side as f32);
    let ceiling = arrange::CEILING as f32;
    let eye = [reach * a * angle.cos(), -0.55 * ceiling, reach * b * angle.sin()];
    let turned = angle + if i.is_multiple_of(2) { std::f32::consts::PI } else { 1.2 };
    let height = -(0.25 + 0.4 * (i % 5) as f32 / 4.0) * ceiling;
    (eye, [a * turned.cos(), height, b * turned.sin()])
}

/// Makes a sample scene of a kind, as [`sample`] does.
///
/// # Errors
/// Those of [`sample`].
pub fn sample_of(kind: SceneKind, gaussians: usize, sh_degree: usize, seed: u64) -> Result<Scene> {
    if !(1..=MAX_GAUSSIANS).contains(&gaussians) {
        let reason = format!("{gaussians} is not between 1 and {MAX_GAUSSIANS}");
        return Err(Error::BadOption {
            field: "--gaussians",
            reason,
        });
    }
    if sh_degree > MAX_DEGREE {
        let reason = format!("{sh_degree} is above the largest degree, {MAX_DEGREE}");
        return Err(Error::BadOption {
            field: "--sh-degree",
            reason,
        });
    }
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let solids = match kind {
        SceneKind::Object => arrange::arrange(&mut random),
        SceneKind::Room => arrange::furnish(&mut random),
        SceneKind::Terrain => arrange::landscape(&mut random),
        SceneKind::Forward => arrange::stage(&mut random),
        SceneKind::Unbounded => arrange::surroundings(&mut random),
    };
    let lamp = unit(LAMP).unwrap_or([0.0, -1.0, 0.0]);
    let highlight = Highlight::new(sh_degree);
    let coarseness = |solid: &Solid| match kind {
        SceneKind::Unbounded => arrange::coarseness(solid),
        _ => 1.0,
    };
    // Of equally coarse ones.
    let weighed = |solid: &Solid| solid.area() / coarseness(solid).powi(2);
    let area: f64 = solids.iter().map(weighed).sum();
    let mut scene = Gaussians {
        sh: Sh {
            degree: sh_degree,
            ..Sh::default()
        },
        ..Gaussians::default()
    };
    let mut area_done = 0.0;
    for solid in &solids {
        let texture = Texture::random(&mut random, solid.is_ground());
        area_done += weighed(solid);
        // Rounding the running total gives the last solid exactly what is left.
        let count = (gaussians as f64 * area_done / area).round() as usize - scene.len();
        let seen_from = (kind == SceneKind::Forward).then_some(STAND);
        let points = Points::new(solid, count, seen_from);
        let deviation = WIDTH * points.spacing();
        let finer = 1.0 / coarseness(solid) as f32;
        for i in 0..count {
            let (position, normal) = points.draw(i, &mut random);
            let shade = shade(
                texture.colour(solid.to_own_axes(position).map(|x| finer * x)),
                normal,
                lamp,
            );
            scene.positions.push(position);
            scene.rotations.push(facing(normal));
            scene
                .log_scales
                .push([deviation, deviation, deviation * FLATNESS].map(|s| s.ln() as f32));
            scene.opacity_logits.push(OPACITY_LOGIT);
            let mut coefficients = highlight.fitted(reflected(lamp, normal), texture.gloss());
            for (channel, value) in shade.into_iter().enumerate() {
                coefficients[channel] += (value - 0.5) / SH_C0;
            }
            scene.sh.coefficients.extend(coefficients);
        }
    }
    Ok(Scene::from_gaussians(scene))
}

/// Matt colour under the lamp and a sky that is brightest overhead.
fn shade(albedo: [f32; 3], normal: [f32; 3], lamp: [f32; 3]) -> [f32; 3] {
    let direct = dot(normal, lamp).max(0.0);
    let sky = 0.5 - 0.5 * normal[1];
    albedo.map(|a| a * (0.3 + 0.25 * sky + 0.55 * direct))
}

/// The direction in which a surface mirrors the lamp.
fn reflected(lamp: [f32; 3], normal: [f32; 3]) -> Option<[f32; 3]> {
    let cosine = dot(lamp, normal);
    (cosine > 0.0).then(|| along(lamp.map(|x| -x), 2.0 * cosine, normal))
}

/// Quaternion w, x, y, z that turns the z axis to the unit vector `normal`.
fn facing(normal: [f32; 3]) -> [f32; 4] {
    let z = [0.0, 0.0, 1.0];
    // Half-way construction: (1 + cos, axis sin) before normalisation; it vanishes only at half a turn.
    let [x, y, zz] = cross(z, normal);
    let q = [1.0 + normal[2], x, y, zz];
    let length = q.iter().map(|v| v * v).sum::<f32>().sqrt();
    if length > 1e-4 {
        q.map(|v| v / length)
    } else {
        let [x, y, z] = perpendicular(z);
        [0.0, x, y, z]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::Extent;

    #[test]
    fn has_what_was_asked_for_and_nothing_odd() {
        for (count, degree) in [(1, 0), (2, 4), (37, 1), (1000, 2), (2000, 3)] {
            let g = sample(count, degree, 7).unwrap().gaussians;
            assert_eq!((g.len(), g.sh.degree), (count, degree));
            assert_eq!(g.sh.coefficients.len(), count * g.sh.per_gaussian());
            let flat = g.positions.iter().flatten().chain(g.log_scales.iter().flatten());
            assert!(
                flat.chain(g.rotations.iter().flatten())
                    .chain(&g.sh.coefficients)
                    .all(|v| v.is_finite())
            );
        }
    }

    /// Nothing but air is where the cameras are, and wherever they look is something.
    #[test]
    fn a_room_is_seen_from_inside() {
        for seed in 0..4 {
            let scene = sample_of(SceneKind::Room, 4000, 1, seed).unwrap().gaussians;
            let cameras = cameras(SceneKind::Room, 24);
            for camera in &cameras {
                let [x, y, z] = camera.centre();
                let near = |p: &&[f32; 3]| ((p[0] - x).powi(2) + (p[1] - y).powi(2) + (p[2] - z).powi(2)).sqrt() < 0.3;
                assert_eq!(scene.positions.iter().filter(near).count(), 0, "seed {seed}");
                let view = crate::splat::prepare(&scene, camera, crate::splat::WeightCache::None).unwrap();
                assert!(view.visible.len() > 300, "seed {seed}: {}", view.visible.len());
            }
            let [a, b] = arrange::ROOM.map(|side| side as f32 + 0.01);
            assert!(scene.positions.iter().all(|p| p[0].abs() < a && p[2].abs() < b));
        }
    }

    /// Gaussians are as large as they look from where the cameras are, and nothing stands in their way.
    #[test]
    fn surroundings_are_coarse_and_around() {
        for seed in 0..4 {
            let scene = sample_of(SceneKind::Unbounded, 4000, 1, seed).unwrap().gaussians;
            let far = |p: &[f32; 3]| p.iter().map(|x| x * x).sum::<f32>().sqrt();
            let size = |which: &dyn Fn(f32) -> bool| {
                let sizes = scene.positions.iter().zip(&scene.log_scales);
                let sizes: Vec<f32> = sizes.filter(|(p, _)| which(far(p))).map(|(_, s)| s[0].exp()).collect();
                sizes.iter().sum::<f32>() / sizes.len() as f32
            };
            let [near, away, sky] = [
                size(&|d| d < 1.4),
                size(&|d| (6.0..20.0).contains(&d)),
                size(&|d| d > 40.0),
            ];
            assert!(
                away > 2.5 * near && sky > 3.0 * away,
                "seed {seed}: {near} {away} {sky}"
            );
            for camera in cameras(SceneKind::Unbounded, 24) {
                let [x, y, z] = camera.centre();
                let near = |p: &&[f32; 3]| ((p[0] - x).powi(2) + (p[1] - y).powi(2) + (p[2] - z).powi(2)).sqrt() < 0.3;
                assert_eq!(scene.positions.iter().filter(near).count(), 0, "seed {seed}");
            }
        }
    }

    #[test]
    fn seeds_decide_everything() {
        let scene = |seed| sample(500, 3, seed).unwrap().gaussians;
        assert_eq!(scene(1), scene(1));
        assert_ne!(scene(1), scene(2));
    }

    #[test]
    fn silly_arguments_are_refused() {
        for (count, degree, field) in [
            (0, 3, "--gaussians"),
            (MAX_GAUSSIANS + 1, 3, "--gaussians"),
            (10, 5, "--sh-degree"),
        ] {
            let error = sample(count, degree, 0).unwrap_err().to_string();
            assert!(error.starts_with(field), "{error}");
        }
    }

    #[test]
    fn stands_upright_on_ground() {
        for seed in 0..6 {
            let extent = Extent::of(&sample(3000, 0, seed).unwrap().gaussians).unwrap();
            assert_eq!((extent.up, extent.on_ground), ([0.0, -1.0, 0.0], true), "seed {seed}");
        }
    }

    #[test]
    fn thin_axes_are_normals() {
        for normal in [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.6, -0.8, 0.0], [0.36, 0.48, -0.8]] {
            let [w, x, y, z] = facing(normal);
            let third = [
                2.0 * (x * z + w * y),
                2.0 * (y * z - w * x),
                1.0 - 2.0 * (x * x + y * y),
            ];
            assert!(dot(third, normal) > 0.9999, "{normal:?} {third:?}");
        }
    }
}
