//! What an unbounded scene was captured for: the part that cameras went around, amid surroundings that they saw behind it.
//!
//! A trained Gaussian is about as large as a pixel of the cameras that saw it from nearest, so what is drawn finest is where
//! cameras came near. Every Gaussian counts by how *fine* it is: opacity over the area of its two longer axes, which is taken for
//! at least the 10 % quantile of all. Then
//!
//! * centre: per axis, midway between the 10 % and the 90 % quantile of the positions;
//! * up: away from the [ground](super::ground) there;
//! * radius: 1.25 times the 75 % quantile of the distance to the centre, since some of what is fine lies scattered about;
//! * spread: the 75 % quantile of that distance by what Gaussians show (as [`Extent`] counts them) over that by how fine they
//!   are. About 1 where all is equally fine;
//! * surrounded: how much of the horizon, 20 degrees up and down from the centre, is covered by what lies beyond two radii.
//!   Each of twelve sectors counts by the sum of opacities times solid angles, at most as a whole.
use std::f64::consts::TAU;

use super::extent::{Extent, area};
use super::ground::upright;
use super::quantiles::quantiles;
use super::vector::{dot, frame, sub};
use crate::scene::Gaussians;

/// Share of Gaussians that are all taken for as fine as the coarsest of them.
const FINEST: f64 = 0.1;
/// The quantile of distances that tells spread and radius, and what the radius is times that.
const MOST: f64 = 0.75;
const RADIUS: f64 = 1.25;
/// The upper quantile of positions that tells the centre.
const END: f64 = 0.9;
/// What lies so many radii from the centre tells which way is up.
const AROUND: f64 = 2.0;
/// Sectors of the horizon, and the sine of the elevation to which it counts: 20 degrees.
const SECTORS: usize = 12;
const HORIZON: f64 = 0.342;

/// Where the focus of a scene is, and how it lies in what surrounds it.
#[derive(Clone, Debug)]
pub(super) struct Focus {
    /// Of the focus alone; up as what lies around it says.
    pub extent: Extent,
    /// How much farther what is shown goes than what is fine.
    pub spread: f32,
    /// Share of the horizon that surroundings cover.
    pub surrounded: f32,
}

impl Focus {
    /// Finds the focus of a scene of that extent, whose Gaussians [show](super::extent::weights) so much.
    pub fn of(gaussians: &Gaussians, shown: &[f64], whole: &Extent) -> Self {
        let fine = fineness(gaussians);
        let centre: [f64; 3] = std::array::from_fn(|k| {
            let positions = gaussians.positions.iter().map(|p| f64::from(p[k]));
            let [low, high] = quantiles(positions, &fine, [1.0 - END, END]);
            0.5 * (low + high)
        });
        let distance = |p: &[f32; 3]| {
            let squares = (0..3).map(|k| (f64::from(p[k]) - centre[k]).powi(2));
            squares.sum::<f64>().sqrt()
        };
        let distances: Vec<f64> = gaussians.positions.iter().map(distance).collect();
        let [most] = quantiles(distances.iter().copied(), &fine, [MOST]);
        let radius = RADIUS * most;
        let [far] = quantiles(distances.iter().copied(), shown, [MOST]);
        // Where all that is fine is at one place there is nothing to go around.
        if !(radius > 0.0 && radius.is_finite()) {
            return Self {
                extent: whole.clone(),
                spread: 1.0,
                surrounded: 0.0,
            };
        }
        let near = Extent::of(&nearer(gaussians, &distances, AROUND * radius)).unwrap_or_else(|_| whole.clone());
        let mut extent = Extent {
            centre: centre.map(|x| x as f32),
            radius: radius as f32,
            ..near
        };
        extent.up = upright(gaussians, shown, &extent);
        Self {
            spread: (far / most) as f32,
            surrounded: surrounded(gaussians, &distances, &extent),
            extent,
        }
    }
}

/// How fine each Gaussian is: opacity over area. Never all zero.
fn fineness(gaussians: &Gaussians) -> Vec<f64> {
    let areas: Vec<f64> = gaussians.log_scales.iter().map(area).collect();
    let [finest] = quantiles(areas.iter().copied(), &vec![1.0; areas.len()], [FINEST]);
    let finest = finest.max(1e-60);
    let fine: Vec<f64> = (areas.iter().enumerate())
        .map(|(row, area)| f64::from(gaussians.opacity(row)) * finest / area.max(finest))
        .map(|fine| if fine.is_finite() { fine } else { 0.0 })
        .collect();
    match fine.iter().sum::<f64>() > 0.0 {
        true => fine,
        false => vec![1.0; areas.len()],
    }
}

/// Geometry of the Gaussians that are nearer than `limit`.
fn nearer(gaussians: &Gaussians, distances: &[f64], limit: f64) -> Gaussians {
    let mut near = Gaussians::default();
    for row in (0..gaussians.len()).filter(|row| distances[*row] <= limit) {
        near.positions.push(gaussians.positions[row]);
        near.rotations.push(gaussians.rotations[row]);
        near.log_scales.push(gaussians.log_scales[row]);
        near.opacity_logits.push(gaussians.opacity_logits[row]);
    }
    near
}

/// Share of the horizon that is covered from beyond two radii.
fn surrounded(gaussians: &Gaussians, distances: &[f64], extent: &Extent) -> f32 {
    let [east, north, up] = frame(extent.up);
    let beyond = AROUND * f64::from(extent.radius);
    let mut sectors = [0.0f64; SECTORS];
    for (row, distance) in distances.iter().enumerate() {
        let from_centre = sub(gaussians.positions[row], extent.centre);
        let level = f64::from(dot(from_centre, up)).abs() <= HORIZON * distance;
        if level && *distance > beyond && distance.is_finite() {
            let turn = f64::from(dot(from_centre, north).atan2(dot(from_centre, east))) / TAU + 0.5;
            // A Gaussian covers as much as a disc of twice the area of its deviations.
            let angle = TAU * area(&gaussians.log_scales[row]) / (distance * distance);
            let sector = ((turn * SECTORS as f64) as usize).min(SECTORS - 1);
            sectors[sector] += f64::from(gaussians.opacity(row)) * angle;
        }
    }
    let whole = TAU / SECTORS as f64 * 2.0 * HORIZON;
    let covered: f64 = sectors.iter().map(|angle| (angle / whole).min(1.0)).sum();
    (covered / SECTORS as f64) as f32
}
