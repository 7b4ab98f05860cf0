//! From where a scene is seen best: from all around, from its front, or from inside.
//!
//! Around a capture lie floaters and the backs of walls, which captors did not see. Views from where captors stood see much more
//! of what is drawn than views from all around do, although some of these look from the same side.
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use super::camera::Camera;
use super::directions::Directions;
use super::extent::Extent;
use super::inside::InsideViews;
use super::kind::SceneKind;
use super::placing::Placing;
use super::sampler::Split;
use super::sight::{PointSplats, SIDE};
use super::solid::SolidGrid;
use crate::scene::Gaussians;

/// Views of each kind.
const VIEWS: u64 = 12;
/// A scene of which so much more is seen from its front than from all around was captured from there.
const MORE_FROM_FRONT: f32 = 1.2;
/// One in which so much more comes through to those who stand inside was captured from there.
const CLEARER_INSIDE: f32 = 2.3;
/// If at most this comes through from all around: floaters and walls are many layers, while a few large splats are not.
const CLUTTERED: f32 = 0.07;

/// What views of three kinds see of a scene; shares are of its Gaussians, by their opacity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Vantage {
    /// Share that is seen in any of twelve views from all around.
    pub seen_from_around: f32,
    /// The same from the front.
    pub seen_from_front: f32,
    /// Share that comes through of what lies in a view from all around.
    pub clear_from_around: f32,
    /// The same from inside; zero where nobody can stand there.
    pub clear_from_inside: f32,
}

impl Vantage {
    /// Looks at a scene of that extent, front and grid.
    pub(super) fn of(gaussians: &Gaussians, extent: &Extent, front: [f32; 3], grid: &SolidGrid) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(0);
        let around = Directions::around(extent, &mut random);
        let facing = Directions::facing(front, &mut random);
        let level = Directions::level(extent.up, &mut random);
        let mut views = |kind: SceneKind, directions: &Directions| -> Vec<Camera> {
            let placing = Placing {
                kind,
                extent,
                split: Split::HeldOut,
                still: false,
                size: SIDE,
            };
            let view = |index| placing.camera(directions.held_out(index, &mut random), &mut random);
            (0..VIEWS).map(view).collect()
        };
        let splats = PointSplats::of(gaussians);
        let around = splats.seen_by(&views(SceneKind::Object, &around));
        let facing = splats.seen_by(&views(SceneKind::Forward, &facing));
        let inside = InsideViews::new(grid.clone(), extent).map_or(0.0, |inside| {
            let look = |index| {
                let direction = level.held_out(index, &mut random);
                inside.look(direction, extent.up, SIDE, &mut random)
            };
            splats.seen_by(&(0..VIEWS).map(look).collect::<Vec<_>>()).clear
        });
        Self {
            seen_from_around: around.seen,
            seen_from_front: facing.seen,
            clear_from_around: around.clear,
            clear_from_inside: inside,
        }
    }

    /// The kind of scene that is seen so.
    pub fn kind(&self) -> SceneKind {
        if self.seen_from_front > MORE_FROM_FRONT * self.seen_from_around {
            SceneKind::Forward
        } else if self.clear_from_around <= CLUTTERED
            && self.clear_from_inside > CLEARER_INSIDE * self.clear_from_around
        {
            SceneKind::Room
        } else {
            SceneKind::Object
        }
    }
}
