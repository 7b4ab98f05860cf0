//! The ground around the focus of an unbounded scene: captures stand as their first camera did, not upright.
//!
//! A plane is fitted to what Gaussians show within three radii, first by their principal axes, then again and again with less
//! weight for what is far from it (Cauchy's weights), so that what stands on the ground counts for little. It is the ground when
//! much of what is shown lies near it, and when it is no steeper than half a right angle, or nearly all else is on one side of
//! it. Of large scenes every so many Gaussians stand for all.
use super::extent::Extent;
use super::vector::dot;
use crate::message::eigen::symmetric;
use crate::scene::Gaussians;

/// What counts, in radii.
const AROUND: f64 = 3.0;
/// Distance from the plane at which a Gaussian counts half, in radii.
const NEAR: f64 = 0.1;
/// Gaussians that are looked at, about as many.
const SAMPLES: usize = 100_000;
/// How often the plane is fitted anew.
const FITS: usize = 12;
/// So much of what is shown must lie within so many radii of it.
const LEAST: f64 = 0.3;
const THICK: f64 = 0.25;
/// Least cosine to the direction that was taken for up: 45 degrees.
const STEEPEST: f32 = 0.707;
/// Steeper ground has this share of all that does not lie near it above it.
const ABOVE: f64 = 0.9;

/// Which way is up, away from the ground; the direction that `focus` has where no ground is found. `shown` is what each Gaussian
/// shows.
pub(super) fn upright(gaussians: &Gaussians, shown: &[f64], focus: &Extent) -> [f32; 3] {
    let radius = f64::from(focus.radius);
    let from_centre =
        |p: &[f32; 3]| -> [f64; 3] { std::array::from_fn(|k| (f64::from(p[k]) - f64::from(focus.centre[k])) / radius) };
    let points: Vec<([f64; 3], f64)> = (gaussians.positions.iter().map(from_centre))
        .zip(shown.iter().copied())
        .step_by(1 + gaussians.len() / SAMPLES)
        .filter(|(p, _)| p.iter().map(|x| x * x).sum::<f64>() <= AROUND * AROUND)
        .collect();
    let mut plane = None;
    for _ in 0..FITS {
        match fitted(&points, plane) {
            Some(found) => plane = Some(found),
            None => return focus.up,
        }
    }
    let Some(plane) = plane else { return focus.up };
    let whole: f64 = points.iter().map(|(_, weight)| weight).sum();
    let beyond = |sign: f64| -> f64 {
        let far = points.iter().filter(|(p, _)| sign * plane.distance(p) > THICK);
        far.map(|(_, weight)| weight).sum()
    };
    let [above, below] = [beyond(1.0), beyond(-1.0)];
    let normal = plane.normal.map(|x| x as f32);
    let cosine = dot(normal, focus.up);
    if above + below > (1.0 - LEAST) * whole {
        return focus.up;
    }
    let sign = if cosine.abs() >= STEEPEST {
        cosine.signum()
    } else if above.max(below) >= ABOVE * (above + below) && above != below {
        (above - below).signum() as f32
    } else {
        return focus.up;
    };
    normal.map(|x| x * sign)
}

/// A plane by its unit normal and a place on it.
#[derive(Clone, Copy)]
struct Plane {
    normal: [f64; 3],
    place: [f64; 3],
}

impl Plane {
    fn distance(&self, p: &[f64; 3]) -> f64 {
        (0..3).map(|k| self.normal[k] * (p[k] - self.place[k])).sum()
    }
}

/// The plane through the weighted mean along the two longer principal axes; weights count less far from `before`.
fn fitted(points: &[([f64; 3], f64)], before: Option<Plane>) -> Option<Plane> {
    let weight = |p: &[f64; 3], shown: f64| match before {
        Some(plane) => shown / (1.0 + (plane.distance(p) / NEAR).powi(2)),
        None => shown,
    };
    let (mut sum, mut place) = (0.0, [0.0; 3]);
    for (p, shown) in points {
        let weight = weight(p, *shown);
        sum += weight;
        (0..3).for_each(|k| place[k] += weight * p[k]);
    }
    let place = place.map(|x| x / sum);
    let mut covariance = vec![0.0; 9];
    for (p, shown) in points {
        let weight = weight(p, *shown) / sum;
        for (k, entry) in covariance.iter_mut().enumerate() {
            let (a, b) = (k / 3, k % 3);
            *entry += weight * (p[a] - place[a]) * (p[b] - place[b]);
        }
    }
    let vectors = symmetric(covariance, 3)?.vectors;
    Some(Plane {
        normal: [vectors[6], vectors[7], vectors[8]],
        place,
    })
}

#[cfg(test)]
mod tests {
    use super::super::vector::{rotation, unit};
    use super::*;
    use crate::sample::sample_of;
    use crate::view::{SceneKind, Split, ViewSampler};

    /// The scene turned about a level axis.
    fn turned(gaussians: &Gaussians, degrees: f64) -> ([f32; 3], Gaussians) {
        let (sine, cosine) = (0.5 * degrees.to_radians()).sin_cos();
        let [w, x, y, z] = [cosine, 0.8 * sine, 0.0, 0.6 * sine];
        let matrix = rotation([w, x, y, z]);
        let turn = |p: [f32; 3]| matrix.map(|row| (0..3).map(|k| row[k] as f32 * p[k]).sum());
        let mut out = gaussians.clone();
        out.positions.iter_mut().for_each(|p| *p = turn(*p));
        for r in &mut out.rotations {
            let [a, b, c, d] = r.map(f64::from);
            *r = [
                w * a - x * b - y * c - z * d,
                w * b + x * a + y * d - z * c,
                w * c - x * d + y * a + z * b,
                w * d + x * c - y * b + z * a,
            ]
            .map(|q| q as f32);
        }
        (turn([0.0, -1.0, 0.0]), out)
    }

    #[test]
    fn nobody_stands_under_tilted_ground() {
        for (seed, degrees) in [(1, 0.0), (2, 12.0), (3, 25.0), (4, -38.0), (5, 70.0)] {
            let scene = sample_of(SceneKind::Unbounded, 4000, 0, seed).unwrap().gaussians;
            let (up, tilted) = turned(&scene, degrees);
            let sampler = ViewSampler::new(&tilted, seed).unwrap();
            assert_eq!(sampler.kind(), SceneKind::Unbounded);
            let found = sampler.extent().up;
            assert!(dot(found, up) > 0.999, "{degrees}: {found:?} instead of {up:?}");
            for index in 0..40 {
                let eye = sampler.camera(Split::HeldOut, index, 32).centre();
                assert!(dot(eye, up) > 0.1, "{degrees}: {eye:?}");
            }
        }
    }

    #[test]
    fn without_ground_up_is_what_it_was() {
        let mut ball = Gaussians::default();
        for direction in super::super::lattice::lattice(2000) {
            ball.positions.push(unit(direction).unwrap());
        }
        let focus = Extent {
            centre: [0.0; 3],
            radius: 1.0,
            up: [0.0, 0.0, 1.0],
            on_ground: false,
        };
        assert_eq!(upright(&ball, &vec![1.0; 2000], &focus), focus.up);
        assert_eq!(upright(&Gaussians::default(), &[], &focus), focus.up);
    }
}
