//! What kind of scene it is, by a rule on its geometry: how it was captured decides where its viewers stand.
//!
//! A scene of fewer than a hundred Gaussians is an object. Else the first of these that holds, on the figures of [`Openness`]:
//!
//! * *unbounded*: what is drawn finest is a small part of it, and surroundings cover a quarter of the horizon there,
//! * *terrain*: flat and seen from above,
//! * *forward*: much is hidden from every side, and [views](Vantage) from the front see much more than those from all around,
//! * *room*: a good part of it is hollow, and something inside is seen by nobody outside; or much is hidden from every side,
//!   and to views from inside much more comes through than to those from all around,
//! * *forward*: from one level side most is seen and nearly nothing is hidden, and much more is hidden from behind,
//! * *object*: all others.
//!
//! Colours do not count, so that a marked scene is of the kind that it was.
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::extent::{Extent, weights};
use super::focus::Focus;
use super::openness::Openness;
use super::solid::SolidGrid;
use super::vantage::Vantage;
use crate::scene::Gaussians;

/// An unbounded scene goes so much farther than what is fine in it, and covers so much of the horizon there.
const SPREAD: f32 = 4.0;
const SURROUNDED: f32 = 0.25;
/// A room's least share of cells that are free and closed in.
const HOLLOW: f32 = 0.25;
/// A room's least share that only those see who are inside.
const INSIDE: f32 = 0.05;
/// Terrain is at most so high for its width, and so much of it is seen from above.
const FLAT: f32 = 0.2;
const FROM_ABOVE: f32 = 0.75;
/// So much of a forward-facing capture is seen from its front, at most so much is hidden from there, so much from behind, and so
/// much more. What is hidden from no side, as glass and floaters, is an object: a mark that is made for one side is not read
/// from another, while one that is made from all around is read from the front as well.
const FROM_FRONT: f32 = 0.6;
const HIDDEN: f32 = 0.06;
const BEHIND: f32 = 0.08;
const MORE_BEHIND: f32 = 0.04;
/// Where so much is hidden from the best side, views tell whether it is an object.
const MUCH_HIDDEN: f32 = 0.28;
/// Fewer Gaussians than these say nothing.
const FEWEST: usize = 100;

/// How a scene was captured, and where its viewers are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SceneKind {
    /// Something seen from outside, from all around or from above its ground.
    Object,
    /// Surroundings, seen from inside.
    Room,
    /// Ground, seen from above and obliquely.
    Terrain,
    /// What a camera saw that faced one way, seen from that side.
    Forward,
    /// Something amid its surroundings, seen from around it.
    Unbounded,
}

impl SceneKind {
    /// All kinds.
    pub const ALL: [SceneKind; 5] = [Self::Object, Self::Room, Self::Terrain, Self::Forward, Self::Unbounded];

    /// The kind of a scene, and the figures that say so.
    ///
    /// # Errors
    /// Those of [`Extent::of`]: an empty scene, or one too large for single precision.
    pub fn of(gaussians: &Gaussians) -> crate::Result<(SceneKind, Openness)> {
        let shown = weights(gaussians);
        let extent = Extent::weighed(gaussians, &shown)?;
        let focus = Focus::of(gaussians, &shown, &extent);
        let grid = SolidGrid::of(gaussians, &shown);
        Ok(Self::found(gaussians, &shown, &extent, &focus, &grid))
    }

    /// The same, of a scene whose extent, focus and grid are known.
    pub(super) fn found(
        gaussians: &Gaussians,
        shown: &[f64],
        extent: &Extent,
        focus: &Focus,
        grid: &SolidGrid,
    ) -> (SceneKind, Openness) {
        let mut found = Openness::of(gaussians, shown, extent, focus, grid);
        let known = found.gaussians < FEWEST || found.hidden_from_front < MUCH_HIDDEN;
        if !known && matches!(Self::by(&found), Self::Object | Self::Room) {
            found.vantage = Some(Vantage::of(gaussians, extent, found.front, grid));
        }
        (Self::by(&found), found)
    }

    /// What the rule says.
    pub fn by(found: &Openness) -> SceneKind {
        let by_sight = found.vantage.map_or(Self::Object, |vantage| vantage.kind());
        if found.gaussians < FEWEST {
            Self::Object
        } else if found.spread >= SPREAD && found.surrounded >= SURROUNDED {
            Self::Unbounded
        } else if found.flatness <= FLAT && found.seen_from_above >= FROM_ABOVE {
            Self::Terrain
        } else if by_sight == Self::Forward {
            Self::Forward
        } else if by_sight == Self::Room || (found.hollow >= HOLLOW && found.inside >= INSIDE) {
            Self::Room
        } else if found.seen_from_front >= FROM_FRONT
            && found.hidden_from_front <= HIDDEN
            && found.hidden_from_behind >= BEHIND
            && found.hidden_from_behind - found.hidden_from_front >= MORE_BEHIND
        {
            Self::Forward
        } else {
            Self::Object
        }
    }

    /// As options and JSON have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Object => "object",
            Self::Room => "room",
            Self::Terrain => "terrain",
            Self::Forward => "forward",
            Self::Unbounded => "unbounded",
        }
    }
}

impl fmt::Display for SceneKind {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.name())
    }
}

impl FromStr for SceneKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let found = Self::ALL.into_iter().find(|kind| kind.name() == text);
        found.ok_or_else(|| format!("{text:?} is none of object, room, terrain, forward, unbounded"))
    }
}
