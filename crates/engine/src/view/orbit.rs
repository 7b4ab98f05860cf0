//! Free places around the [focus](super::focus) of an unbounded scene, from which it is seen.
//!
//! A grid as [rooms](super::inside) have it spans the places of all views. A view stands in a free cell, nothing solid is
//! between it and the focus, and what it looks at is not close by.
use super::extent::Extent;
use super::solid::SolidGrid;
use super::vector::{dot, sub, unit};
use crate::scene::Gaussians;

/// What is so many radii from the centre belongs to the focus, and may be in the way.
const FOCUS: f32 = 1.25;
/// So many radii ahead there is nothing solid.
const AHEAD: f32 = 0.5;
/// Cells of the way that are passed over.
const SKIPPED: f32 = 1.0;

/// Where one may stand around a focus.
#[derive(Clone, Debug)]
pub(super) struct Orbit {
    grid: SolidGrid,
}

impl Orbit {
    /// The places of a scene up to `reach` from the centre of its focus, world units.
    pub fn new(gaussians: &Gaussians, focus: &Extent, reach: f32) -> Self {
        let ends = |k: usize| [focus.centre[k] - reach, focus.centre[k] + reach].map(f64::from);
        Self {
            grid: SolidGrid::within(gaussians, std::array::from_fn(ends)),
        }
    }

    /// Whether somebody at `eye` stands in free space and sees the focus.
    pub fn is_clear(&self, eye: [f32; 3], focus: &Extent) -> bool {
        let way = sub(focus.centre, eye);
        let distance = dot(way, way).sqrt();
        let is_free = self.grid.cell(eye).is_none_or(|cell| self.grid.is_free(cell));
        let Some(direction) = unit(way) else { return false };
        let seen_to = self.grid.way(eye, direction, SKIPPED).unwrap_or(f32::INFINITY);
        is_free && seen_to >= focus.radius * AHEAD.max(distance / focus.radius - FOCUS)
    }
}
