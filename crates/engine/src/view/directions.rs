//! Endless directions in two splits that never meet: around a pole, between two heights.
//!
//! **Split.** Points of a Fibonacci lattice, fixed in world axes and the same for every seed, are the places of the held-out
//! directions: those lie within a small cap around one, training directions at least twice as far from all of them.
//!
//! **Spread.** Training directions follow Roberts' R2 sequence, shifted by the seed. Held-out places are visited in order
//! of largest distance to those before; around a focus so that the first ones are as high as all.
use std::f32::consts::{PI, TAU};

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::extent::Extent;
use super::lattice::{evenly, farthest_first, lattice};
use super::vector::{along, dot, frame};

/// Lowest sine of elevation over ground: 6 degrees.
const LOWEST: f32 = 0.1;
/// Lowest sine of elevation over terrain: 35 degrees.
const OBLIQUE: f32 = 0.573_576_44;
/// Sines of elevation around the focus of an unbounded scene: 10 to 53 degrees. Few captors stand lower or higher, and lower
/// views show little but the ground right before them.
const ORBIT: [f32; 2] = [0.173_648_18, 0.8];
/// Least cosine to the middle of a forward-facing capture: 25 degrees.
const FACING: f32 = 0.906_307_8;
/// Sines of elevation between which one looks about in a room: 30 degrees down to 25 up.
const LEVEL: [f32; 2] = [-0.5, 0.422_618_27];

/// Where directions may lie, and how fine the lattice of held-out ones is.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Zone {
    pole: [f32; 3],
    /// Least and largest cosine to the pole.
    heights: [f32; 2],
    /// Points of the lattice on the whole sphere.
    places: usize,
    /// Held-out directions stay within this angle of their place, radians; training ones stay out of twice the angle.
    cap: f32,
}

impl Zone {
    /// 64 places with caps of 2.5 degrees, or more places with caps that take as large a share of the sphere.
    fn new(pole: [f32; 3], heights: [f32; 2], places: usize) -> Self {
        let cap = HELD_OUT_CAP * (HELD_OUT_PLACES as f32 / places as f32).sqrt();
        Self {
            pole,
            heights,
            places,
            cap,
        }
    }

    /// Whether a held-out cap around a place lies within the heights as a whole.
    fn holds(&self, place: [f32; 3]) -> bool {
        let [lowest, highest] = self.heights;
        let height = dot(self.pole, place);
        (lowest <= -1.0 || height > lowest + self.cap) && (highest >= 1.0 || height < highest - self.cap)
    }
}

/// Places of held-out directions on the whole sphere.
const HELD_OUT_PLACES: usize = 64;
/// Angle around them within which held-out directions lie, radians.
const HELD_OUT_CAP: f32 = 2.5 * PI / 180.0;

/// Directions of one seed.
#[derive(Clone, Debug)]
pub(super) struct Directions {
    zone: Zone,
    shift: [f64; 2],
    /// Places of held-out directions, in the order in which they are looked from.
    places: Vec<[f32; 3]>,
}

impl Directions {
    /// From which a scene on its own is seen: all, or those above its ground.
    pub fn around(extent: &Extent, random: &mut ChaCha8Rng) -> Self {
        let lowest = if extent.on_ground { LOWEST } else { -1.0 };
        Self::new(Zone::new(extent.up, [lowest, 1.0], HELD_OUT_PLACES), random)
    }

    /// From which terrain is seen: above and obliquely.
    pub fn above(up: [f32; 3], random: &mut ChaCha8Rng) -> Self {
        Self::new(Zone::new(up, [OBLIQUE, 1.0], 2 * HELD_OUT_PLACES), random)
    }

    /// From which the focus of an unbounded scene is seen: above its ground, and not from overhead.
    pub fn orbiting(up: [f32; 3], random: &mut ChaCha8Rng) -> Self {
        let zone = Zone::new(up, ORBIT, 2 * HELD_OUT_PLACES);
        Self::ordered(zone, random, |seen, random| evenly(seen, random.random()))
    }

    /// From which a forward-facing capture is seen: those near `front`.
    pub fn facing(front: [f32; 3], random: &mut ChaCha8Rng) -> Self {
        Self::new(Zone::new(front, [FACING, 1.0], 4 * HELD_OUT_PLACES), random)
    }

    /// In which one looks in a room.
    pub fn level(up: [f32; 3], random: &mut ChaCha8Rng) -> Self {
        Self::new(Zone::new(up, LEVEL, HELD_OUT_PLACES), random)
    }

    fn new(zone: Zone, random: &mut ChaCha8Rng) -> Self {
        Self::ordered(zone, random, |seen, random| {
            let first = random.random_range(0..seen.len().max(1));
            farthest_first(seen, first)
        })
    }

    fn ordered(
        zone: Zone,
        random: &mut ChaCha8Rng,
        order: impl Fn(Vec<[f32; 3]>, &mut ChaCha8Rng) -> Vec<[f32; 3]>,
    ) -> Self {
        let shift = [random.random(), random.random()];
        let seen = lattice(zone.places).filter(|place| zone.holds(*place)).collect();
        let places = order(seen, random);
        Self { zone, shift, places }
    }

    /// A training direction; all of them at one elevation above the horizon in radians, where that is given.
    pub fn training(&self, index: u64, elevation: Option<f32>, random: &mut ChaCha8Rng) -> [f32; 3] {
        // Roberts' R2 sequence: inverse powers of the plastic number. Whole turns are taken out in integers, so that
        // the stream does not coarsen at huge indices.
        let turn = |alpha: u64, shift: f64| (alpha.wrapping_mul(index) as f64 / 2f64.powi(64) + shift).fract() as f32;
        let mut u = turn(0xC13F_A9A9_02A6_328F, self.shift[0]);
        let mut v = turn(0x91E1_0DA5_C79E_7B1D, self.shift[1]);
        // Refusals are few (12 % of the sphere, half of it over ground); the bound only keeps this a plain loop.
        for _ in 0..1000 {
            let direction = self.direction_at(u, v, elevation);
            if self.training_allows(direction) {
                return direction;
            }
            (u, v) = (random.random(), random.random());
        }
        self.direction_at(u, v, elevation)
    }

    /// Area-preserving map of the unit square to the zone; or of `v` to a ring.
    fn direction_at(&self, u: f32, v: f32, elevation: Option<f32>) -> [f32; 3] {
        let [lowest, highest] = self.zone.heights;
        let height = match elevation {
            Some(elevation) => elevation.sin(),
            None => highest - u * (highest - lowest),
        };
        let [east, north, up] = frame(self.zone.pole);
        let (sine, cosine) = (TAU * v).sin_cos();
        let level = (1.0 - height * height).max(0.0).sqrt();
        let flat = along(east.map(|e| e * cosine), sine, north);
        along(up.map(|e| e * height), level, flat)
    }

    fn training_allows(&self, direction: [f32; 3]) -> bool {
        lattice(self.zone.places).all(|place| dot(place, direction) < (2.0 * self.zone.cap).cos())
    }

    /// A held-out direction.
    pub fn held_out(&self, index: u64, random: &mut ChaCha8Rng) -> [f32; 3] {
        // `lattice` always has points in any zone; the pole stands in so that nothing can fail here.
        let place = match self.places.len() as u64 {
            0 => self.zone.pole,
            n => self.places[(index % n) as usize],
        };
        let [east, north, _] = frame(place);
        let tilt = self.zone.cap * random.random::<f32>().sqrt();
        let (sine, cosine) = (TAU * random.random::<f32>()).sin_cos();
        let flat = along(east.map(|e| e * cosine), sine, north);
        along(place.map(|e| e * tilt.cos()), tilt.sin(), flat)
    }
}
