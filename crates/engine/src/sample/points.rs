//! Where on a solid its Gaussians are: evenly over its surface, or over what is seen of it from one place.
use rand::{Rng, RngExt};

use super::shapes::Solid;
use crate::view::vector::{dot, sub};

/// Points that tell which share of a surface is seen.
const PROBES: u64 = 256;

/// Points of one solid.
pub(super) struct Points<'a> {
    solid: &'a Solid,
    count: usize,
    /// Numbers of the sequence whose points are seen; none where all count.
    seen: Option<Vec<u64>>,
    spacing: f64,
}

impl<'a> Points<'a> {
    /// So many points of a solid; those that face away from `eye` are left out.
    pub fn new(solid: &'a Solid, count: usize, eye: Option<[f32; 3]>) -> Self {
        let evenly = (solid.area() / count.max(1) as f64).sqrt();
        let Some(eye) = eye else {
            return Self {
                solid,
                count,
                seen: None,
                spacing: evenly,
            };
        };
        let is_seen = |number: &u64| {
            let [u, v] = even(*number);
            let (position, normal) = solid.point(u, v);
            dot(normal, sub(eye, position)) > 0.0
        };
        let share = (0..PROBES).filter(is_seen).count() as f64 / PROBES as f64;
        // Solids that face away as a whole have as many points, so that there are as many as were asked for.
        let seen: Vec<u64> = match share > 0.0 {
            true => (0..u64::MAX).filter(is_seen).take(count).collect(),
            false => (0..count as u64).collect(),
        };
        Self {
            solid,
            count,
            seen: Some(seen),
            spacing: evenly * share.max(1.0 / PROBES as f64).sqrt(),
        }
    }

    /// Mean distance of neighbours, world units.
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Point `index`, and the unit normal there.
    pub fn draw(&self, index: usize, random: &mut impl Rng) -> ([f32; 3], [f32; 3]) {
        let jitter: [f64; 2] = [random.random(), random.random()];
        let [u, v] = match &self.seen {
            Some(seen) => even(seen[index]),
            // A low-discrepancy grid over the surface, loosened a little to hide its rows.
            None => [
                (index as f64 + jitter[0]) / self.count as f64,
                (index as f64 * 0.618_033_988_749_894_9 + 0.3 * jitter[1] / (self.count as f64).sqrt()).fract(),
            ],
        };
        self.solid.point(u, v)
    }
}

/// Roberts' R2 sequence, of which every part is even, also one that is left when points are left out.
fn even(number: u64) -> [f64; 2] {
    [0.754_877_666_246_692_7, 0.569_840_290_998_053_2].map(|alpha| (0.5 + alpha * number as f64).fract())
}
