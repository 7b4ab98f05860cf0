//! How far from a scene a view stands and what it looks at, by the kind of scene.
use std::f32::consts::PI;
use std::ops::Range;

use rand::{Rng, RngExt};

use super::camera::Camera;
use super::extent::Extent;
use super::kind::SceneKind;
use super::sampler::Split;
use super::vector::{along, frame};

/// Vertical field of view, radians, of views that need not keep away from a tiny scene: 45 degrees.
const FIELD_OF_VIEW: f32 = 0.25 * PI;
/// Distance at which the reference rasteriser culls, world units.
pub(super) const NEAR: f32 = 0.2;
/// Distances of cameras, times that at which the scene just fills the picture; and that of all cameras on a ring.
const FILL: Range<f32> = 0.95..1.2;
const MEAN_FILL: f32 = 0.5 * (FILL.start + FILL.end);
/// The same before a forward-facing capture, which is not as deep as wide and may go on beyond the picture.
const FILL_FORWARD: Range<f32> = 0.7..1.0;
/// The same over terrain.
const FILL_TERRAIN: Range<f32> = 0.5..1.1;
/// The same around the focus of an unbounded scene. Where it is all that is fine, captors stood three of its radii away; where
/// the ground on which they stood is as fine, hardly more than one. Here and below first of training views, then of held-out
/// ones: nobody knows where viewers stand, so a mark is made for more of them than it is verified for.
const FILL_UNBOUNDED: [Range<f32>; 2] = [0.5..1.2, 0.6..1.1];
/// Vertical fields of view around it, radians: 40 to 60 degrees, and 45 to 55; it does not fill the picture.
const FIELD_OF_VIEW_UNBOUNDED: [Range<f32>; 2] = [0.698..1.047, 0.785..0.96];
/// How far from the centre views aim, in radii.
const AIM: f32 = 0.04;
/// The same around the focus of an unbounded scene, times how far away the view is: a near view that turns away shows nothing
/// of what somebody came near for.
const AIM_UNBOUNDED: [f32; 2] = [0.25, 0.12];
/// The same over terrain, along the ground, times what the picture does not show.
const AIM_TERRAIN: f32 = 0.7;

/// How far from the centre of its focus views of an unbounded scene stand at most, in its radii.
pub(super) fn farthest_from_focus() -> f32 {
    FILL_UNBOUNDED[0].end / (0.5 * FIELD_OF_VIEW).sin()
}

/// Views of one scene that look at it as a whole, or at the focus of one that is unbounded.
pub(super) struct Placing<'a> {
    pub kind: SceneKind,
    pub extent: &'a Extent,
    pub split: Split,
    /// All at the mean distance, looking at the centre.
    pub still: bool,
    /// Side of the pictures, pixels.
    pub size: u32,
}

impl Placing<'_> {
    /// The camera that looks from `direction`: near enough to fill the picture, and beyond the near plane.
    pub fn camera(&self, direction: [f32; 3], random: &mut impl Rng) -> Camera {
        let Extent { centre, radius, up, .. } = *self.extent;
        let split = usize::from(self.split == Split::HeldOut);
        let fill = match (self.still, self.kind) {
            (true, _) => MEAN_FILL,
            (false, SceneKind::Object | SceneKind::Room) => random.random_range(FILL),
            (false, SceneKind::Forward) => random.random_range(FILL_FORWARD),
            (false, SceneKind::Terrain) => random.random_range(FILL_TERRAIN),
            (false, SceneKind::Unbounded) => random.random_range(FILL_UNBOUNDED[split].clone()),
        };
        let off = match self.kind {
            SceneKind::Unbounded => AIM_UNBOUNDED[split] * fill,
            _ => AIM,
        };
        let wanted = radius * fill / (0.5 * FIELD_OF_VIEW).sin();
        // Tiny scenes: stay back so that their near side is beyond the near plane, and zoom in instead.
        let distance = wanted.max(radius + 1.1 * NEAR);
        let field_of_view = match self.kind {
            SceneKind::Unbounded => random.random_range(FIELD_OF_VIEW_UNBOUNDED[split].clone()),
            _ => 2.0 * (radius * fill / distance).min(0.99).asin(),
        };
        let aim: [f32; 3] = match self.still {
            true => [0.0; 3],
            false => std::array::from_fn(|_| random.random_range(-off..off)),
        };
        let mut target = along(centre, radius, aim);
        if self.kind == SceneKind::Terrain {
            let [east, north, _] = frame(up);
            for axis in [east, north] {
                let beside = AIM_TERRAIN * (FILL_TERRAIN.end - fill) * random.random_range(-1.0..1.0);
                target = along(target, radius * beside, axis);
            }
        }
        let eye = along(target, distance, direction);
        Camera::look_at(eye, target, up, field_of_view, self.size, self.size)
    }
}
