//! How much of a scene views see: which of its Gaussians are hardly hidden.
//!
//! A Gaussian is drawn as points, as many as it covers pixels. Points in a pixel are passed from near to far, and each hides
//! as much of what is behind as it is opaque. Captors' cameras see nearly all that a capture has, since training puts
//! Gaussians where cameras see them; from elsewhere floaters and the backs of walls are in the way. Of scenes of many
//! Gaussians some stand for all, each for several of its size.
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;

use super::camera::Camera;
use super::extent::{area, shortest_axis};
use super::quantiles::quantiles;
use super::vector::along;
use crate::scene::Gaussians;

/// Side of the views, pixels.
pub(super) const SIDE: u32 = 48;
/// Most Gaussians that are looked at.
const MOST: usize = 20_000;
/// So many of these are the largest, each for itself.
const LARGE: usize = 10_000;
/// Most points that stand for one in a view.
const MOST_POINTS: usize = 128;
/// Pixels that one covers at most.
const MOST_COVERED: f32 = 1e9;
/// Share of its opacity that has to come through, so that it is seen.
const SEEN: f32 = 0.3;
/// What is fainter shows nothing.
const FAINTEST: f32 = 0.01;
/// A Gaussian is in a view up to so many standard deviations from its middle.
const REACH: f32 = 2.5;

/// What some views of a scene see. Gaussians count by their opacity, whatever their size: what is drawn finely is many.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Sight {
    /// Share of the scene that is seen in any of the views.
    pub seen: f32,
    /// Share that comes through of what lies in a view, mean over the views.
    pub clear: f32,
}

/// Gaussians that stand for a scene.
pub(super) struct PointSplats {
    splats: Vec<PointSplat>,
    /// Random places of a normal distribution, from which the points of Gaussians are taken.
    cloud: Vec<[f32; 3]>,
}

struct PointSplat {
    place: [f32; 3],
    opacity: f32,
    /// Axes as long as the standard deviations.
    axes: [[f32; 3]; 3],
    /// The longest of them.
    longest: f32,
    /// What it covers, world units squared.
    area: f32,
    /// So many Gaussians.
    stands_for: f32,
}

impl PointSplats {
    /// Of large scenes, the largest Gaussians and every n-th of the others: what is large hides what is behind by itself.
    pub fn of(gaussians: &Gaussians) -> Self {
        let areas: Vec<f64> = gaussians.log_scales.iter().map(area).collect();
        let large = match gaussians.len() > MOST {
            true => quantiles(
                areas.iter().copied(),
                &vec![1.0; areas.len()],
                [1.0 - LARGE as f64 / areas.len() as f64],
            )[0],
            false => 0.0,
        };
        let step = gaussians.len().div_ceil(MOST - LARGE);
        let rows = (0..gaussians.len()).filter(|row| areas[*row] >= large || row % step == 0);
        let splat = |row: usize| {
            let scales = gaussians.log_scales[row].map(f32::exp);
            let (axes, _) = shortest_axis(gaussians, row);
            PointSplat {
                place: gaussians.positions[row],
                opacity: gaussians.opacity(row),
                stands_for: if areas[row] >= large { 1.0 } else { step as f32 },
                axes: std::array::from_fn(|k| axes[k].map(|x| x * scales[k])),
                longest: scales.into_iter().fold(0.0, f32::max),
                area: std::f32::consts::TAU * areas[row] as f32,
            }
        };
        let shows =
            |splat: &PointSplat| splat.opacity > FAINTEST && splat.longest.is_finite() && splat.area.is_finite();
        let mut random = ChaCha8Rng::seed_from_u64(0);
        Self {
            splats: rows.map(splat).filter(shows).collect(),
            cloud: (0..MOST_POINTS)
                .map(|_| [0; 3].map(|_| random.sample(StandardNormal)))
                .collect(),
        }
    }

    /// What views of [`SIDE`] by [`SIDE`] pixels see; nothing without views.
    pub fn seen_by(&self, cameras: &[Camera]) -> Sight {
        let views: Vec<Vec<f32>> = cameras.par_iter().map(|camera| self.shares(camera)).collect();
        let opacity = |number: usize| f64::from(self.splats[number].opacity * self.splats[number].stands_for);
        let sum = |of: &dyn Fn(usize) -> bool| -> f64 {
            let splats = (0..self.splats.len()).filter(|number| of(*number));
            splats.map(opacity).sum::<f64>().max(f64::MIN_POSITIVE)
        };
        let seen = sum(&|number| views.iter().any(|shares| shares[number] > SEEN));
        let clear = views.iter().map(|shares| {
            let through = shares.iter().map(|share| f64::from(share.max(0.0)));
            let through: f64 = through.enumerate().map(|(number, share)| share * opacity(number)).sum();
            through / sum(&|number| shares[number] >= 0.0)
        });
        Sight {
            seen: (seen / sum(&|_| true)) as f32,
            clear: (clear.sum::<f64>() / views.len().max(1) as f64) as f32,
        }
    }

    /// The share of every splat that comes through in a view; below zero where it is not in the view.
    fn shares(&self, camera: &Camera) -> Vec<f32> {
        let mut points: Vec<Point> = Vec::with_capacity(2 * self.splats.len());
        for (number, splat) in self.splats.iter().enumerate() {
            self.draw(splat, number, camera, &mut points);
        }
        points.sort_unstable_by_key(|point| (point.place, point.number));
        let (mut whole, mut through) = (vec![0.0f32; self.splats.len()], vec![0.0f32; self.splats.len()]);
        for of_pixel in points.chunk_by(|a, b| a.place >> 32 == b.place >> 32) {
            let mut left = 1.0;
            for point in of_pixel {
                whole[point.number as usize] += point.opacity;
                through[point.number as usize] += left * point.opacity;
                left *= 1.0 - point.opacity.min(0.99);
            }
        }
        let share = |(through, whole): (f32, f32)| if whole > 0.0 { through / whole } else { -1.0 };
        through.into_iter().zip(whole).map(share).collect()
    }

    /// Adds the points of a splat that are in a view.
    fn draw(&self, splat: &PointSplat, number: usize, camera: &Camera, points: &mut Vec<Point>) {
        let depth = camera.to_camera(splat.place)[2];
        let side = SIDE as f32;
        let pixels_a_unit = camera.fy / depth;
        let reach = REACH * pixels_a_unit * splat.longest;
        let near = |x: &f32| (-reach..side + reach).contains(x);
        if !(depth > 0.0 && camera.pixel(splat.place).iter().all(near)) {
            return;
        }
        // What is flat, or right before the camera, has no area or more than any number.
        let covered = (splat.area * splat.stands_for * pixels_a_unit * pixels_a_unit).min(MOST_COVERED);
        let count = (covered.ceil() as usize).clamp(1, MOST_POINTS);
        // A point stands for a part of what the splat covers, or for several layers of it.
        let layers = covered / count as f32;
        let opacity = match layers > 1.0 {
            true => 1.0 - (1.0 - splat.opacity).powf(layers),
            false => splat.opacity * layers,
        };
        for index in 0..count {
            let deviates = match count {
                1 => [0.0; 3],
                // Each takes other points of the cloud.
                _ => self.cloud[(97 * number + index) % MOST_POINTS],
            };
            let place = (0..3).fold(splat.place, |place, k| along(place, deviates[k], splat.axes[k]));
            let depth = camera.to_camera(place)[2];
            let [x, y] = camera.pixel(place);
            if depth > 0.0 && (0.0..side).contains(&x) && (0.0..side).contains(&y) {
                let pixel = y as u64 * u64::from(SIDE) + x as u64;
                points.push(Point {
                    // Positive numbers are in the order of their bits.
                    place: pixel << 32 | u64::from(depth.to_bits()),
                    number: number as u32,
                    opacity,
                });
            }
        }
    }
}

/// A part of a splat before a pixel.
struct Point {
    /// The pixel, and below it the bits of the depth.
    place: u64,
    number: u32,
    opacity: f32,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square wall of `side` by `side` splats before a quarter as many tiny ones.
    fn wall(side: usize, opacity_logit: f32) -> Gaussians {
        let mut scene = Gaussians::default();
        let mut add = |position, size: f32| {
            scene.positions.push(position);
            scene.log_scales.push([size.ln(); 3]);
            scene.rotations.push([1.0, 0.0, 0.0, 0.0]);
            scene.opacity_logits.push(opacity_logit);
        };
        let step = 2.0 / side as f32;
        for i in 0..side * side {
            let [x, y] = [i % side, i / side].map(|n| (n as f32 + 0.5) * step - 1.0);
            add([x, y, 0.0], step);
            if i % 4 == 0 {
                add([0.5 * x, 0.5 * y, 0.5], 0.1 * step);
            }
        }
        scene
    }

    fn from(z: f32) -> Camera {
        Camera::look_at([0.0, 0.0, z], [0.0; 3], [0.0, -1.0, 0.0], 0.8, SIDE, SIDE)
    }

    #[test]
    fn a_wall_hides_what_is_behind_it_from_one_side() {
        // Of the larger scene some splats stand for all.
        for side in [60, 240] {
            let splats = PointSplats::of(&wall(side, 6.0));
            let of_tiny = |camera: &Camera| {
                let shares = splats.shares(camera);
                let all = splats.splats.iter().zip(shares);
                let tiny = all.filter(|(splat, _)| splat.longest < 0.5 / side as f32);
                let shares: Vec<f32> = tiny.map(|(_, share)| share).collect();
                shares.iter().sum::<f32>() / shares.len() as f32
            };
            let [before, behind] = [-3.0, 3.0].map(from);
            assert!(
                of_tiny(&before) < 0.05 && of_tiny(&behind) > 0.95,
                "{side}: {} {}",
                of_tiny(&before),
                of_tiny(&behind)
            );
            let seen = |cameras: &[&Camera]| {
                let cameras: Vec<Camera> = cameras.iter().map(|camera| (*camera).clone()).collect();
                splats.seen_by(&cameras).seen
            };
            assert!(seen(&[&before]) + 0.15 < seen(&[&behind]));
            assert!(seen(&[&before, &behind]) >= seen(&[&behind]));
        }
    }

    #[test]
    fn haze_hides_little_and_no_view_sees_nothing() {
        let splats = PointSplats::of(&wall(60, -3.0));
        let seen = splats.seen_by(&[from(-3.0)]);
        assert!(seen.seen > 0.95 && seen.clear > 0.7, "{seen:?}");
        assert!(splats.seen_by(&[]).seen < 1e-6 && splats.seen_by(&[]).clear == 0.0);
        // Looking away.
        let away = Camera::look_at([0.0, 0.0, -3.0], [0.0, 0.0, -9.0], [0.0, -1.0, 0.0], 0.8, SIDE, SIDE);
        assert!(splats.seen_by(&[away]).seen < 1e-6);
        assert!(
            PointSplats::of(&Gaussians::default())
                .seen_by(&[from(-3.0)])
                .seen
                .is_finite()
        );
    }
}
