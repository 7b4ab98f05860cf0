//! Views of surroundings from inside: from free places, looking about.
//!
//! **Places.** Free cells of the [grid](super::solid) that are closed in, at heights at which eyes are, and as far from what is
//! solid as half of what the best of them is, at least two cells.
//!
//! **Views.** The [direction](super::directions) comes first, so that all sides are looked at equally often. Of some random places
//! the first counts from which one sees far enough that way, so that no picture is full of one near wall; else the one from
//! which one sees farthest. Views of both splits stand at any place; their directions never meet.
use rand::{Rng, RngExt};
use rayon::prelude::*;

use super::camera::Camera;
use super::extent::Extent;
use super::lattice::lattice;
use super::solid::SolidGrid;
use super::vector::{along, dot};
use crate::error::{Error, Result};

/// Vertical field of view of the mean view, radians: 66 degrees; views have 0.85 to 1.2 of it.
const FIELD_OF_VIEW: f32 = 1.15;
const ZOOMED: std::ops::Range<f32> = 0.85..1.2;
/// Share of directions that must be closed, of those in which looks go, so that a place is inside.
const CLOSED: f32 = 0.6;
/// Directions that are tried for that.
const LOOKS: usize = 64;
/// Heights of eyes, as shares of the way from the lowest to the highest free place.
const HEIGHTS: std::ops::RangeInclusive<f32> = 0.25..=0.75;
/// Least distance to what is solid, in that of the best place, and in cells.
const CLEARANCE: f32 = 0.5;
const LEAST_CELLS: u32 = 2;
/// How far one has to see ahead, in the longest side of the grid.
const AHEAD: f32 = 0.5;
/// Places that are tried for a direction.
const TRIES: usize = 8;

/// Where one may stand inside a scene.
#[derive(Clone, Debug)]
pub struct InsideViews {
    grid: SolidGrid,
    /// Cells in which one may stand.
    places: Vec<usize>,
    clearance: f32,
}

impl InsideViews {
    /// The places of a scene.
    ///
    /// # Errors
    /// [`Error::BadOption`] where no free place is closed in.
    pub(super) fn new(grid: SolidGrid, extent: &Extent) -> Result<Self> {
        let clearances = grid.clearances();
        let looks: Vec<_> = lattice(LOOKS)
            .filter(|look| dot(*look, extent.up).abs() < 0.5)
            .collect();
        let open = ((1.0 - CLOSED) * looks.len() as f32) as usize;
        let closed_in = |cell: &usize| {
            let place = grid.middle(*cell);
            let mut escapes = looks.iter().filter(|look| grid.way(place, **look, 0.0).is_none());
            escapes.nth(open).is_none()
        };
        // Where nothing is solid nothing has a distance to it.
        let roomy = |cell: &usize| (LEAST_CELLS..u32::MAX).contains(&clearances[*cell]);
        let mut places: Vec<usize> = (0..grid.len())
            .into_par_iter()
            .with_min_len(64)
            .filter(|cell| roomy(cell) && closed_in(cell))
            .collect();
        let height = |cell: usize| dot(grid.middle(cell), extent.up);
        let (low, high) = places
            .iter()
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), cell| {
                (low.min(height(*cell)), high.max(height(*cell)))
            });
        places.retain(|cell| high <= low || HEIGHTS.contains(&((height(*cell) - low) / (high - low))));
        let best = places.iter().map(|cell| clearances[*cell]).max();
        let best = best.ok_or_else(|| Error::BadOption {
            field: "kind",
            reason: "room, but there is no free place inside the scene where a camera could stand".into(),
        })?;
        let least = (best as f32 * CLEARANCE).max(LEAST_CELLS as f32);
        places.retain(|cell| clearances[*cell] as f32 >= least);
        Ok(Self {
            clearance: (least - 1.0) * grid.side,
            grid,
            places,
        })
    }

    /// How near a view comes to what is solid, world units, as exactly as the grid knows.
    pub fn clearance(&self) -> f32 {
        self.clearance
    }

    /// Cells of the grid in which views may stand.
    pub fn places(&self) -> usize {
        self.places.len()
    }

    /// The view in a direction, `size` by `size` pixels.
    pub(super) fn look(&self, direction: [f32; 3], up: [f32; 3], size: u32, random: &mut impl Rng) -> Camera {
        let longest = self.grid.side * self.grid.counts.iter().max().map_or(1.0, |count| *count as f32);
        let mut best = (f32::NEG_INFINITY, [0.0; 3]);
        for _ in 0..TRIES {
            let place = self.place(random);
            let ahead = self.grid.way(place, direction, 0.0).unwrap_or(0.0);
            if ahead > best.0 {
                best = (ahead, place);
            }
            if ahead >= AHEAD * longest {
                break;
            }
        }
        let eye = best.1;
        let field_of_view = FIELD_OF_VIEW * random.random_range(ZOOMED);
        Camera::look_at(eye, along(eye, longest, direction), up, field_of_view, size, size)
    }

    /// Somewhere in a random cell.
    fn place(&self, random: &mut impl Rng) -> [f32; 3] {
        let middle = self.grid.middle(self.places[random.random_range(0..self.places.len())]);
        middle.map(|x| x + self.grid.side * random.random_range(-0.5..0.5))
    }
}
