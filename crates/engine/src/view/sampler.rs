//! An endless seeded stream of cameras around a scene, in two splits whose directions never meet.
//!
//! Directions are those from which the scene is seen: the whole sphere, or what is above the ground where the scene
//! lies on a sheet of it ([`Extent::on_ground`]).
//!
//! **Split.** 64 points of a Fibonacci lattice, fixed in world axes and the same for every seed, are the places of
//! the held-out views: those lie within 2.5 degrees of one, training views at least 5 degrees from all of them. So
//! views held out under one seed are at least 2.5 degrees from the training views of every seed.
//!
//! **Spread.** Training directions follow Roberts' R2 sequence, shifted by the seed: any run of consecutive indices
//! is spread evenly. Held-out places are visited in order of largest distance to those before, so that even the
//! first five look from all around. Distance, aim and the place within a held-out cap are drawn from ChaCha8, one
//! stream a view.
//!
//! **Ring.** Training views can be put on a circle instead, at one elevation and one distance and aimed at the centre, as
//! published code has them ([`ViewSampler::train_on_ring`]); held-out views stay where they are.
//!
//! **Given cameras.** Views of both splits can be taken where cameras are ([`ViewSampler::among`]).
use super::camera::Camera;
use super::extent::Extent;
use super::given::GivenViews;
use super::vector::{along, dot, frame, unit};
use crate::error::Result;
use crate::scene::Gaussians;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f32::consts::{PI, TAU};
use std::sync::Arc;

/// Vertical field of view, radians, of views that need not keep away from a tiny scene: 45 degrees.
const FIELD_OF_VIEW: f32 = 0.25 * PI;
/// Distance at which the reference rasteriser culls, world units.
const NEAR: f32 = 0.2;
/// Distances of cameras, times that at which the scene just fills the picture; and that of all cameras on a ring.
const FILL: std::ops::Range<f32> = 0.95..1.2;
const MEAN_FILL: f32 = 0.5 * (FILL.start + FILL.end);
/// Lowest sine of elevation over ground: 6 degrees.
const LOWEST: f32 = 0.1;
/// Places of held-out views.
const HELD_OUT_PLACES: usize = 64;
/// Held-out views stay within this angle of their place, radians.
const HELD_OUT_CAP: f32 = 2.5 * PI / 180.0;
/// Training views stay out of this angle around held-out places, radians.
const TRAINING_GAP: f32 = 5.0 * PI / 180.0;

/// Which of the two disjoint sets of views.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// Views that the optimiser sees.
    Training,
    /// Views for verification, which it never sees.
    HeldOut,
}

/// Cameras around one scene; see the module's text.
#[derive(Clone, Debug)]
pub struct ViewSampler {
    extent: Extent,
    seed: u64,
    shift: [f64; 2],
    places: Vec<[f32; 3]>,
    /// Elevation of all training views, radians.
    ring: Option<f32>,
    /// Where views are, if not around the scene.
    given: Option<Arc<GivenViews>>,
}

impl ViewSampler {
    /// Measures the scene and prepares the stream of `seed`.
    ///
    /// # Errors
    /// Those of [`Extent::of`]: an empty scene, or one too large for single precision.
    pub fn new(gaussians: &Gaussians, seed: u64) -> Result<ViewSampler> {
        let extent = Extent::of(gaussians)?;
        let mut random = stream(seed, u64::MAX);
        let shift = [random.random(), random.random()];
        let seen: Vec<[f32; 3]> = lattice(HELD_OUT_PLACES).filter(|d| seen(&extent, *d)).collect();
        let first = random.random_range(0..seen.len().max(1));
        let places = farthest_first(seen, first);
        Ok(ViewSampler {
            extent,
            seed,
            shift,
            places,
            ring: None,
            given: None,
        })
    }

    /// The same, with views around and between `cameras`; around the scene where there are none.
    ///
    /// # Errors
    /// Those of [`ViewSampler::new`] and [`GivenViews::new`].
    pub fn among(gaussians: &Gaussians, seed: u64, cameras: &[Camera]) -> Result<ViewSampler> {
        let mut sampler = Self::new(gaussians, seed)?;
        if !cameras.is_empty() {
            sampler.given = Some(Arc::new(GivenViews::new(gaussians, cameras)?));
        }
        Ok(sampler)
    }

    /// Puts the training views on a circle at this elevation above the scene's horizon, radians.
    pub fn train_on_ring(&mut self, elevation: f32) {
        self.ring = Some(elevation);
    }

    /// The cameras that views are around, where such were given.
    pub fn given(&self) -> Option<&GivenViews> {
        self.given.as_deref()
    }

    /// Where and how large the scene is.
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
            Split::Training => self.training_direction(index, &mut random),
            Split::HeldOut => self.held_out_direction(index, &mut random),
        };
        let still = split == Split::Training && self.ring.is_some();
        self.place(direction, size, still, &mut random)
    }

    fn training_direction(&self, index: u64, random: &mut ChaCha8Rng) -> [f32; 3] {
        // Roberts' R2 sequence: inverse powers of the plastic number. Whole turns are taken out in integers, so that
        // the stream does not coarsen at huge indices.
        let turn = |alpha: u64, shift: f64| (alpha.wrapping_mul(index) as f64 / 2f64.powi(64) + shift).fract() as f32;
        let mut u = turn(0xC13F_A9A9_02A6_328F, self.shift[0]);
        let mut v = turn(0x91E1_0DA5_C79E_7B1D, self.shift[1]);
        // Refusals are few (12 % of the sphere, half of it over ground); the bound only keeps this a plain loop.
        for _ in 0..1000 {
            let direction = self.direction_at(u, v);
            if self.training_allows(direction) {
                return direction;
            }
            (u, v) = (random.random(), random.random());
        }
        self.direction_at(u, v)
    }

    /// Area-preserving map of the unit square to the directions from which the scene is seen; or of `v` to the ring.
    fn direction_at(&self, u: f32, v: f32) -> [f32; 3] {
        let lowest = if self.extent.on_ground { LOWEST } else { -1.0 };
        let height = match self.ring {
            Some(elevation) => elevation.sin(),
            None => 1.0 - u * (1.0 - lowest),
        };
        let [east, north, up] = frame(self.extent.up);
        let (sine, cosine) = (TAU * v).sin_cos();
        let level = (1.0 - height * height).max(0.0).sqrt();
        let flat = along(east.map(|e| e * cosine), sine, north);
        along(up.map(|e| e * height), level, flat)
    }

    fn training_allows(&self, direction: [f32; 3]) -> bool {
        lattice(HELD_OUT_PLACES).all(|place| dot(place, direction) < TRAINING_GAP.cos())
    }

    fn held_out_direction(&self, index: u64, random: &mut ChaCha8Rng) -> [f32; 3] {
        // `lattice` always has points above any ground; the pole stands in so that nothing can fail here.
        let place = match self.places.len() as u64 {
            0 => self.extent.up,
            n => self.places[(index % n) as usize],
        };
        let [east, north, _] = frame(place);
        let tilt = HELD_OUT_CAP * random.random::<f32>().sqrt();
        let (sine, cosine) = (TAU * random.random::<f32>()).sin_cos();
        let flat = along(east.map(|e| e * cosine), sine, north);
        along(place.map(|e| e * tilt.cos()), tilt.sin(), flat)
    }

    /// The camera that looks from `direction`: near enough to fill the picture, and beyond the near plane. `still` ones are
    /// all at the mean distance and look at the centre.
    fn place(&self, direction: [f32; 3], size: u32, still: bool, random: &mut impl Rng) -> Camera {
        let Extent { centre, radius, up, .. } = self.extent;
        let fill = if still { MEAN_FILL } else { random.random_range(FILL) };
        let wanted = radius * fill / (0.5 * FIELD_OF_VIEW).sin();
        // Tiny scenes: stay back so that their near side is beyond the near plane, and zoom in instead.
        let distance = wanted.max(radius + 1.1 * NEAR);
        let field_of_view = 2.0 * (radius * fill / distance).min(0.99).asin();
        let aim: [f32; 3] = match still {
            true => [0.0; 3],
            false => std::array::from_fn(|_| random.random_range(-0.04..0.04)),
        };
        let target = along(centre, radius, aim);
        let eye = along(target, distance, direction);
        Camera::look_at(eye, target, up, field_of_view, size, size)
    }
}

fn stream(seed: u64, number: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(number);
    random
}

fn seen(extent: &Extent, direction: [f32; 3]) -> bool {
    // A held-out cap must lie above the lowest elevation as a whole.
    !extent.on_ground || dot(extent.up, direction) > LOWEST + HELD_OUT_CAP
}

/// `n` evenly spread directions: a Fibonacci lattice in world axes.
fn lattice(n: usize) -> impl Iterator<Item = [f32; 3]> {
    (0..n).map(move |i| {
        let z = 1.0 - (2.0 * i as f32 + 1.0) / n as f32;
        let level = (1.0 - z * z).max(0.0).sqrt();
        // The golden angle.
        let (sine, cosine) = (i as f32 * PI * (3.0 - 5f32.sqrt())).sin_cos();
        unit([level * cosine, level * sine, z]).unwrap_or([0.0, 0.0, 1.0])
    })
}

/// Reorders points so that each is the farthest from all before it; ties go to the earlier one.
fn farthest_first(mut points: Vec<[f32; 3]>, first: usize) -> Vec<[f32; 3]> {
    if !points.is_empty() {
        points.swap(0, first);
    }
    for done in 1..points.len() {
        let nearest = |p: [f32; 3]| points[..done].iter().map(|q| dot(p, *q)).fold(-1.0, f32::max);
        let closeness: Vec<f32> = points[done..].iter().map(|p| nearest(*p)).collect();
        let best = (0..closeness.len()).min_by(|a, b| closeness[*a].total_cmp(&closeness[*b]));
        points.swap(done, done + best.unwrap_or(0));
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::vector::sub;

    fn ball(scale: f32) -> Gaussians {
        let positions: Vec<[f32; 3]> = lattice(500).map(|p| p.map(|x| x * scale)).collect();
        Gaussians {
            rotations: vec![[0.0; 4]; positions.len()],
            log_scales: vec![[(0.05 * scale).ln(); 3]; positions.len()],
            opacity_logits: vec![2.0; positions.len()],
            positions,
            ..Gaussians::default()
        }
    }

    /// From which a camera looks: aim jitter moves eye and target together.
    fn direction(camera: &Camera) -> [f32; 3] {
        camera.rotation[2].map(|x| -x)
    }

    #[test]
    fn splits_never_meet_whatever_the_seeds() {
        let scene = ball(1.0);
        let (a, b) = (
            ViewSampler::new(&scene, 1).unwrap(),
            ViewSampler::new(&scene, 99).unwrap(),
        );
        let training: Vec<_> = (0..2000)
            .map(|i| direction(&a.camera(Split::Training, i, 32)))
            .collect();
        let mut closest = -1.0f32;
        for sampler in [&a, &b] {
            for i in 0..200 {
                let held_out = direction(&sampler.camera(Split::HeldOut, i, 32));
                closest = training.iter().map(|d| dot(*d, held_out)).fold(closest, f32::max);
            }
        }
        assert!(
            closest < 2.4f32.to_radians().cos(),
            "{} degrees",
            closest.acos().to_degrees()
        );
        // The gap costs little: most of the sphere stays in use.
        assert!(closest > 6f32.to_radians().cos());
    }

    #[test]
    fn a_ring_is_a_circle_that_keeps_away_from_held_out_views() {
        let scene = ball(1.0);
        let sphere = ViewSampler::new(&scene, 4).unwrap();
        let mut ring = sphere.clone();
        ring.train_on_ring(30f32.to_radians());
        let Extent { centre, up, .. } = *ring.extent();
        let cameras: Vec<Camera> = (0..400).map(|i| ring.camera(Split::Training, i, 32)).collect();
        let held_out: Vec<Camera> = (0..200).map(|i| ring.camera(Split::HeldOut, i, 32)).collect();
        let distance = |camera: &Camera| {
            let [x, y, z] = sub(camera.centre(), centre);
            (x * x + y * y + z * z).sqrt()
        };
        let mut azimuths = [false; 12];
        let [east, north, _] = frame(up);
        for camera in &cameras {
            let from = direction(camera);
            assert!((dot(from, up) - 0.5).abs() < 1e-4, "{from:?}");
            assert!((distance(camera) - distance(&cameras[0])).abs() < 1e-3 * distance(camera));
            let turn = dot(from, north).atan2(dot(from, east)) / TAU + 0.5;
            azimuths[((turn * 12.0) as usize).min(11)] = true;
            assert!(
                held_out
                    .iter()
                    .all(|h| dot(direction(h), from) < 2.4f32.to_radians().cos())
            );
        }
        assert_eq!(azimuths, [true; 12]);
        for (i, camera) in held_out.iter().enumerate() {
            assert_eq!(*camera, sphere.camera(Split::HeldOut, i as u64, 32));
        }
    }

    #[test]
    fn both_splits_look_from_all_around() {
        let sampler = ViewSampler::new(&ball(1.0), 3).unwrap();
        for (split, count) in [(Split::Training, 64), (Split::HeldOut, 24)] {
            for start in [0, 1 << 40] {
                let views: Vec<_> = (start..start + count)
                    .map(|i| direction(&sampler.camera(split, i, 32)))
                    .collect();
                for probe in lattice(40) {
                    let nearest = views.iter().map(|d| dot(*d, probe)).fold(-1.0, f32::max);
                    assert!(nearest > 0.6, "{split:?} leaves a hole at {probe:?}: {nearest}");
                }
            }
        }
    }

    #[test]
    fn the_same_arguments_give_the_same_camera_and_others_another() {
        let scene = ball(1.0);
        let sampler = ViewSampler::new(&scene, 5).unwrap();
        let again = ViewSampler::new(&scene, 5).unwrap();
        let other = ViewSampler::new(&scene, 6).unwrap();
        for split in [Split::Training, Split::HeldOut] {
            for index in [0, 7, u64::MAX] {
                let camera = sampler.camera(split, index, 64);
                assert_eq!(camera, again.camera(split, index, 64));
                assert_ne!(camera, other.camera(split, index, 64));
                assert_ne!(camera, sampler.camera(split, index ^ 1, 64));
            }
        }
    }

    #[test]
    fn the_scene_fills_the_picture_beyond_the_near_plane() {
        for scale in [1e-4, 0.1, 1.0, 1e6] {
            let scene = ball(scale);
            let sampler = ViewSampler::new(&scene, 5).unwrap();
            for index in 0..50 {
                let camera = sampler.camera(Split::Training, index, 100);
                let (mut least, mut most) = (f32::INFINITY, f32::NEG_INFINITY);
                for p in &scene.positions {
                    let [x, _, z] = camera.to_camera(*p);
                    assert!(z > NEAR, "scale {scale}: depth {z}");
                    let pixel = camera.fx * x / z + camera.cx;
                    (least, most) = (least.min(pixel), most.max(pixel));
                }
                assert!((-10.0..40.0).contains(&least), "scale {scale}: {least}..{most}");
                assert!((60.0..110.0).contains(&most), "scale {scale}: {least}..{most}");
            }
        }
    }

    #[test]
    fn degenerate_scenes_give_finite_cameras() {
        let one = |log_scale: f32, position: [f32; 3]| Gaussians {
            positions: vec![position; 2],
            rotations: vec![[0.0; 4]; 2],
            log_scales: vec![[log_scale; 3]; 2],
            opacity_logits: vec![f32::NEG_INFINITY; 2],
            ..Gaussians::default()
        };
        for log_scale in [f32::NEG_INFINITY, -30.0, 0.0, 20.0] {
            for position in [[0.0; 3], [1e6, -3.0, 2.0]] {
                let sampler = ViewSampler::new(&one(log_scale, position), 1).unwrap();
                let camera = sampler.camera(Split::HeldOut, 0, 64);
                let numbers = camera.rotation.into_iter().flatten().chain(camera.translation);
                assert!(numbers.chain([camera.fx, camera.fy]).all(f32::is_finite), "{camera:?}");
                assert!(dot(sub(camera.centre(), position), [1.0; 3]).is_finite());
            }
        }
        assert!(ViewSampler::new(&Gaussians::default(), 1).is_err());
        assert!(ViewSampler::new(&one(0.0, [1e30, 0.0, 0.0]), 1).is_err());
        assert!(ViewSampler::new(&one(80.0, [0.0; 3]), 1).is_err());
    }
}
