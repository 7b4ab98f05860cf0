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
/// The largest of these are not drawn for others.
const LARGE: usize = 10_000;
/// Most points that stand for one in a view.
const MOST_POINTS: usize = 128;
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
pub(super) struct Crowd {
    members: Vec<Member>,
    /// Random places of a normal distribution, from which the points of Gaussians are taken.
    cloud: Vec<[f32; 3]>,
}

struct Member {
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

impl Crowd {
    /// Of large scenes takes the largest, and of the others every so manieth: what is large hides what is behind by itself.
    pub fn of(gaussians: &Gaussians) -> Self {
        let areas: Vec<f64> = gaussians.log_scales.iter().map(area).collect();
        let large = match gaussians.len() > MOST {
            true => quantiles(areas.iter().copied(), &vec![1.0; areas.len()], [1.0 - LARGE as f64 / areas.len() as f64])[0],
            false => 0.0,
        };
        let step = gaussians.len().div_ceil(MOST - LARGE);
        let members = (0..gaussians.len()).filter(|row| areas[*row] >= large || row % step == 0);
        let member = |row: usize| {
            let scales = gaussians.log_scales[row].map(f32::exp);
            let (axes, _) = shortest_axis(gaussians, row);
            Member {
                place: gaussians.positions[row],
                opacity: gaussians.opacity(row),
                stands_for: if areas[row] >= large { 1.0 } else { step as f32 },
                axes: std::array::from_fn(|k| axes[k].map(|x| x * scales[k])),
                longest: scales.into_iter().fold(0.0, f32::max),
                area: std::f32::consts::TAU * areas[row] as f32,
            }
        };
        let shows = |member: &Member| member.opacity > FAINTEST && member.longest.is_finite() && member.area.is_finite();
        let mut random = ChaCha8Rng::seed_from_u64(0);
        Self {
            members: members.map(member).filter(shows).collect(),
            cloud: (0..MOST_POINTS)
                .map(|_| [0; 3].map(|_| random.sample(StandardNormal)))
                .collect(),
        }
    }

    /// What views of [`SIDE`] by [`SIDE`] pixels see; nothing without views.
    pub fn seen_by(&self, cameras: &[Camera]) -> Sight {
        let views: Vec<Vec<f32>> = cameras.par_iter().map(|camera| self.shares(camera)).collect();
        let opacity = |number: usize| f64::from(self.members[number].opacity * self.members[number].stands_for);
        let sum = |of: &dyn Fn(usize) -> bool| -> f64 {
            let members = (0..self.members.len()).filter(|number| of(*number));
            members.map(opacity).sum::<f64>().max(f64::MIN_POSITIVE)
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

    /// The share of every member that comes through in a view; below zero where it is not in the view.
    fn shares(&self, camera: &Camera) -> Vec<f32> {
        let mut points: Vec<Point> = Vec::with_capacity(2 * self.members.len());
        for (number, member) in self.members.iter().enumerate() {
            self.draw(member, number, camera, &mut points);
        }
        points.sort_unstable_by_key(|point| (point.place, point.number));
        let (mut whole, mut through) = (vec![0.0f32; self.members.len()], vec![0.0f32; self.members.len()]);
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

    /// Adds the points of a member that are in a view.
    fn draw(&self, member: &Member, number: usize, camera: &Camera, points: &mut Vec<Point>) {
        let depth = camera.to_camera(member.place)[2];
        let side = SIDE as f32;
        let unit = camera.fy / depth;
        let reach = REACH * unit * member.longest;
        let near = |x: &f32| (-reach..side + reach).contains(x);
        if !(depth > 0.0 && camera.pixel(member.place).iter().all(near)) {
            return;
        }
        let covered = member.area * member.stands_for * unit * unit;
        let count = (covered.ceil() as usize).clamp(1, MOST_POINTS);
        // A point stands for a part of what the member covers, or for several layers of it.
        let layers = covered / count as f32;
        let opacity = match layers > 1.0 {
            true => 1.0 - (1.0 - member.opacity).powf(layers),
            false => member.opacity * layers,
        };
        for index in 0..count {
            let deviates = match count {
                1 => [0.0; 3],
                // Each takes other points of the cloud.
                _ => self.cloud[(97 * number + index) % MOST_POINTS],
            };
            let place = (0..3).fold(member.place, |place, k| along(place, deviates[k], member.axes[k]));
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

/// A part of a member before a pixel.
struct Point {
    /// The pixel, and below it the bits of the depth.
    place: u64,
    number: u32,
    opacity: f32,
}
