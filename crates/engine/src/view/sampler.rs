//! An endless seeded stream of cameras of one scene, in two splits that never meet.
//!
//! Where cameras stand follows from the [kind](super::SceneKind) of the scene, which is found from its geometry unless it is given:
//!
//! * object: around it, from all [directions](super::directions) or from those above the ground where it lies on a sheet of
//!   ground ([`Extent::on_ground`]). Each camera fills its picture with the scene;
//! * terrain: above and obliquely, over the whole or a part of it;
//! * forward: near the side from which it was captured, as around an object;
//! * room: at free places [inside](super::inside), looking about;
//! * unbounded: at free places [around](super::orbit) what it was captured for, which is in the middle of the picture.
//!
//! **Split.** Held-out directions lie in caps around fixed places, training directions outside of larger ones. So views held
//! out under one seed are apart from the training views of every seed. For objects that is 2.5 degrees.
//!
//! **Spread.** Any run of consecutive training indices is spread evenly over all directions, and the first five held-out ones
//! look from all around. Distance, aim and the place within a held-out cap are drawn from ChaCha8, one stream a view.
//!
//! **Ring.** Training views can be put on a circle instead, at one elevation and one distance and aimed at the centre, as
//! published code has them ([`ViewSampler::train_on_ring`]); held-out views stay where they are.
//!
//! **Given cameras.** Views of both splits can be taken where cameras are ([`ViewSampler::seen_from`]).
use std::sync::Arc;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::camera::Camera;
use super::directions::Directions;
use super::extent::{Extent, weights};
use super::focus::Focus;
use super::given::GivenViews;
use super::inside::InsideViews;
use super::kind::SceneKind;
use super::openness::Openness;
use super::orbit::Orbit;
use super::placing::{Placing, farthest_from_focus};
use super::solid::SolidGrid;
use crate::error::{Error, Result};
use crate::scene::Gaussians;

/// How often a view of an unbounded scene is drawn anew before it is taken from where it is.
const TRIES: usize = 8;

/// Which of the two disjoint sets of views.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// Views that the optimiser sees.
    Training,
    /// Views for verification, which it never sees.
    HeldOut,
}

/// Where views are taken from, if neither the kind that is found nor the scene's own extent is to decide.
#[derive(Clone, Copy, Debug, Default)]
pub struct Viewpoints<'a> {
    /// The kind of the scene; found from its geometry where none is given.
    pub kind: Option<SceneKind>,
    /// Cameras that views are at, around and between; then the kind says nothing.
    pub cameras: &'a [Camera],
}

/// Cameras of one scene; see the module's text.
#[derive(Clone, Debug)]
pub struct ViewSampler {
    extent: Extent,
    seed: u64,
    kind: SceneKind,
    directions: Directions,
    /// Elevation of all training views, radians.
    ring: Option<f32>,
    /// Where views stand inside a room.
    inside: Option<Arc<InsideViews>>,
    /// Where they stand around the focus of an unbounded scene.
    orbit: Option<Arc<Orbit>>,
    /// Where views are, if not where the scene says.
    given: Option<Arc<GivenViews>>,
}

impl ViewSampler {
    /// Finds the kind of the scene and prepares the stream of `seed`.
    ///
    /// # Errors
    /// Those of [`Extent::of`]: an empty scene, or one too large for single precision.
    pub fn new(gaussians: &Gaussians, seed: u64) -> Result<ViewSampler> {
        Self::seen_from(gaussians, seed, Viewpoints::default())
    }

    /// The stream of `seed` around a scene that is an object, whatever it looks like.
    ///
    /// # Errors
    /// Those of [`Extent::of`].
    pub fn around(gaussians: &Gaussians, seed: u64) -> Result<ViewSampler> {
        let kind = Some(SceneKind::Object);
        Self::seen_from(gaussians, seed, Viewpoints { kind, cameras: &[] })
    }

    /// The stream of `seed`, from where `viewpoints` say.
    ///
    /// # Errors
    /// Those of [`Extent::of`] and [`GivenViews::new`], and [`Error::BadOption`] for a room without a free place inside.
    pub fn seen_from(gaussians: &Gaussians, seed: u64, viewpoints: Viewpoints<'_>) -> Result<ViewSampler> {
        let shown = weights(gaussians);
        let mut extent = Extent::weighed(gaussians, &shown)?;
        let given = match viewpoints.cameras {
            [] => None,
            cameras => Some(Arc::new(GivenViews::new(gaussians, cameras)?)),
        };
        // Given cameras decide by themselves.
        let known = viewpoints.kind.or(given.is_some().then_some(SceneKind::Object));
        let grid = || SolidGrid::of(gaussians, &shown);
        let find_focus = || Focus::of(gaussians, &shown, &extent);
        let mut random = stream(seed, u64::MAX);
        let (mut inside, mut orbit) = (None, None);
        let (kind, front, focus, grid) = match known {
            Some(kind @ (SceneKind::Object | SceneKind::Terrain)) => (kind, extent.up, None, None),
            Some(kind @ SceneKind::Unbounded) => (kind, extent.up, Some(find_focus()), None),
            Some(kind @ SceneKind::Room) => (kind, extent.up, None, Some(grid())),
            Some(SceneKind::Forward) | None => {
                let (focus, grid) = (find_focus(), grid());
                let (kind, found) = match known {
                    Some(kind) => (kind, Openness::of(gaussians, &shown, &extent, &focus, &grid)),
                    None => SceneKind::found(gaussians, &shown, &extent, &focus, &grid),
                };
                (kind, found.front, Some(focus), Some(grid))
            }
        };
        if let (SceneKind::Unbounded, Some(focus)) = (kind, focus) {
            extent = focus.extent;
            let reach = extent.radius * farthest_from_focus();
            orbit = Some(Arc::new(Orbit::new(gaussians, &extent, reach + extent.radius)));
        }
        let directions = match kind {
            SceneKind::Object => Directions::around(&extent, &mut random),
            SceneKind::Terrain => Directions::above(extent.up, &mut random),
            SceneKind::Forward => Directions::facing(front, &mut random),
            SceneKind::Room => Directions::level(extent.up, &mut random),
            SceneKind::Unbounded => Directions::orbiting(extent.up, &mut random),
        };
        if let (SceneKind::Room, Some(grid)) = (kind, grid) {
            inside = Some(Arc::new(InsideViews::new(grid, &extent)?));
        }
        Ok(ViewSampler {
            extent,
            seed,
            kind,
            directions,
            ring: None,
            inside,
            orbit,
            given,
        })
    }

    /// Puts the training views on a circle at this elevation above the scene's horizon, radians.
    ///
    /// # Errors
    /// [`Error::BadOption`] for a scene that is no object.
    pub fn train_on_ring(&mut self, elevation: f32) -> Result<()> {
        if self.kind != SceneKind::Object {
            return Err(Error::BadOption {
                field: "ring",
                reason: format!(
                    "a circle is around an object, and this scene is taken for {}",
                    self.kind
                ),
            });
        }
        self.ring = Some(elevation);
        Ok(())
    }

    /// The kind of scene that views are made for; without a meaning among given cameras.
    pub fn kind(&self) -> SceneKind {
        self.kind
    }

    /// The cameras that views are around, where such were given.
    pub fn given(&self) -> Option<&GivenViews> {
        self.given.as_deref()
    }

    /// The places where views stand in a room.
    pub fn inside(&self) -> Option<&InsideViews> {
        self.inside.as_deref()
    }

    /// Whether every view shows another part of the scene, and none the whole.
    pub fn shows_parts(&self) -> bool {
        self.given.is_some() || self.inside.is_some() || self.orbit.is_some()
    }

    /// Whether all views are of a forward-facing capture, from its front.
    pub fn faces_one_side(&self) -> bool {
        self.kind == SceneKind::Forward && self.given.is_none()
    }

    /// What an unbounded scene was captured for, where views go around that.
    pub fn focus(&self) -> Option<&Extent> {
        (self.orbit.is_some() && self.given.is_none()).then_some(&self.extent)
    }

    /// Where and how large the scene is, or the focus of one that is unbounded.
    pub fn extent(&self) -> &Extent {
        &self.extent
    }

    /// View `index` of a split, `size` by `size` pixels: the same arguments give the same camera.
    pub fn camera(&self, split: Split, index: u64, size: u32) -> Camera {
        // Even streams for training, odd ones for held-out; the topmost bit is spared for `new`.
        let odd = u64::from(split == Split::HeldOut);
        let mut random = stream(self.seed, (index & (u64::MAX >> 2)) * 2 + odd);
        if let Some(given) = &self.given {
            return match split {
                Split::Training => given.training(index, size, &mut random),
                Split::HeldOut => given.held_out(index, size),
            };
        }
        let direction = match split {
            Split::Training => self.directions.training(index, self.ring, &mut random),
            Split::HeldOut => self.directions.held_out(index, &mut random),
        };
        if let Some(inside) = &self.inside {
            return inside.look(direction, self.extent.up, size, &mut random);
        }
        let placing = Placing {
            kind: self.kind,
            extent: &self.extent,
            split,
            still: split == Split::Training && self.ring.is_some(),
            size,
        };
        let mut view = placing.camera(direction, &mut random);
        if let Some(orbit) = &self.orbit {
            let mut tries = 1..TRIES;
            while !orbit.is_clear(view.centre(), &self.extent) && tries.next().is_some() {
                view = placing.camera(direction, &mut random);
            }
        }
        view
    }
}

fn stream(seed: u64, number: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(number);
    random
}

#[cfg(test)]
mod tests;
