//! What is fixed for a view while only colours are learned: visible splats, tile lists, weights.
use super::geometry::Geometry;
use super::project::{Projected, Projector, Splat2d};
use super::tiles::{TILE, TileLists};
use super::weights::SparseWeights;
use crate::error::{Error, Result};
use crate::scene::Gaussians;
use crate::simd::Instructions;
use crate::view::Camera;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Largest picture side; keeps all products of tiles and pixels well within 32 bits.
pub const MAX_SIDE: u32 = 16_384;
/// Rows projected at a time by one thread.
const CHUNK: usize = 4096;

/// What a prepared view keeps besides its tile lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WeightCache {
    /// Nothing: weights are computed anew at every use. For large pictures and for the GPU.
    None,
    /// Every weight (5 bytes each): drawing and its gradient become sparse products. For pictures drawn repeatedly.
    Weights,
    /// Every weight in half precision (3 bytes each).
    HalfWeights,
}

/// Where the time of [`Geometry::prepare`] went.
#[derive(Clone, Copy, Debug, Default)]
pub struct PrepareTimes {
    /// Projecting and culling.
    pub project: Duration,
    /// Sorting into tiles.
    pub sort: Duration,
    /// Computing the weights that are kept, and what follows from them.
    pub weights: Duration,
}

/// Tells views apart that a rasteriser keeps on a device; says nothing about their content.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ViewId(pub u64);

impl ViewId {
    fn next() -> Self {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        ViewId(COUNT.fetch_add(1, Ordering::Relaxed))
    }
}

impl PartialEq for ViewId {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// A view of a scene, ready to be drawn with any colours. Not to be changed: rasterisers may keep copies.
#[derive(Clone, Debug, PartialEq)]
pub struct PreparedView {
    /// The camera.
    pub camera: Camera,
    /// Rows of the scene's Gaussians that may be seen, ascending. With cached weights, those that are.
    pub visible: Vec<u32>,
    /// Their splats, in the same order.
    pub splats: Vec<Splat2d>,
    /// Unit vectors from the camera to them.
    pub directions: Vec<[f32; 3]>,
    /// Splats of each tile.
    pub tiles: TileLists,
    /// Bands of spherical harmonics above this degree are not shown.
    pub degree: usize,
    pub(crate) weights: Option<SparseWeights>,
    pub(crate) id: ViewId,
}

impl PreparedView {
    /// Memory that the view holds, in bytes.
    pub fn bytes(&self) -> usize {
        let per_visible = size_of::<u32>() + size_of::<Splat2d>() + size_of::<[f32; 3]>();
        self.visible.len() * per_visible + self.tiles.bytes() + self.weight_bytes()
    }

    /// Memory of the cached weights, in bytes.
    pub fn weight_bytes(&self) -> usize {
        self.weights.as_ref().map_or(0, SparseWeights::bytes)
    }

    /// Number of cached weights, if they are cached.
    pub fn weight_count(&self) -> Option<usize> {
        self.weights.as_ref().map(SparseWeights::len)
    }

    /// Numbers of a picture of this view: `height * width * 3`.
    pub fn picture_len(&self) -> usize {
        3 * self.camera.width as usize * self.camera.height as usize
    }

    pub(crate) fn check(&self, what: &'static str, len: usize, expected: usize) -> Result<()> {
        if len == expected {
            return Ok(());
        }
        Err(Error::BadOption {
            field: what,
            reason: format!("{len} numbers where the view needs {expected}"),
        })
    }
}

/// [`Geometry::prepare`] for a scene that is looked at once.
///
/// # Errors
/// Those of [`Geometry::prepare`].
pub fn prepare(gaussians: &Gaussians, camera: &Camera, cache: WeightCache) -> Result<PreparedView> {
    Geometry::new(gaussians).prepare(camera, cache)
}

pub(super) fn prepare_with(
    geometry: &Geometry<'_>,
    camera: &Camera,
    larger: f64,
    cache: WeightCache,
) -> Result<(PreparedView, PrepareTimes)> {
    check_camera(camera)?;
    let gaussians = geometry.gaussians;
    let mut clock = Instant::now();
    let mut lap = || std::mem::replace(&mut clock, Instant::now()).elapsed();
    let mut times = PrepareTimes::default();
    let projector = Projector::new(camera, larger);
    let n = gaussians.len();
    let instructions = Instructions::widest();
    let chunks: Vec<Projected> = (0..n.div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            let rows = chunk * CHUNK..n.min((chunk + 1) * CHUNK);
            projector.project(instructions, geometry, rows)
        })
        .collect();
    let count = chunks.iter().map(|chunk| chunk.rows.len()).sum();
    let mut visible = Vec::with_capacity(count);
    let mut splats = Vec::with_capacity(count);
    let mut rects = Vec::with_capacity(count);
    for chunk in chunks {
        visible.extend(chunk.rows);
        splats.extend(chunk.splats);
        rects.extend(chunk.rects);
    }
    times.project = lap();
    let (columns, rows) = (camera.width.div_ceil(TILE), camera.height.div_ceil(TILE));
    let mut tiles = TileLists::new(columns, rows, &splats, &rects)?;
    drop(rects);
    times.sort = lap();
    let mut weights = None;
    if cache != WeightCache::None {
        let half = cache == WeightCache::HalfWeights;
        let (kept, keep) = SparseWeights::new(camera, &tiles, &splats, half)?;
        let mut used = vec![false; splats.len()];
        for (slot, splat) in tiles.splats.iter().enumerate() {
            used[*splat as usize] |= keep[slot];
        }
        let mut left = 0;
        let mut renumber = vec![u32::MAX; splats.len()];
        for (i, number) in renumber.iter_mut().enumerate() {
            if used[i] {
                *number = left as u32;
                visible[left] = visible[i];
                splats[left] = splats[i];
                left += 1;
            }
        }
        visible.truncate(left);
        splats.truncate(left);
        tiles = tiles.pruned(&keep, &renumber);
        weights = Some(kept);
    }
    // Views are kept: what their lists have grown beyond their length would more than double them.
    visible.shrink_to_fit();
    splats.shrink_to_fit();
    let tiles = tiles.with_slots(visible.len());
    let directions = visible
        .par_iter()
        .with_min_len(CHUNK)
        .map(|row| projector.direction(gaussians, *row as usize))
        .collect();
    times.weights = lap();
    let view = PreparedView {
        camera: camera.clone(),
        visible,
        splats,
        directions,
        tiles,
        degree: gaussians.sh.degree,
        weights,
        id: ViewId::next(),
    };
    Ok((view, times))
}

fn check_camera(camera: &Camera) -> Result<()> {
    let bad = |reason: String| {
        Err(Error::BadOption {
            field: "camera",
            reason,
        })
    };
    for (name, side) in [("width", camera.width), ("height", camera.height)] {
        if side == 0 || side > MAX_SIDE {
            return bad(format!("{name} is {side}, it must be 1 to {MAX_SIDE} pixels"));
        }
    }
    for (name, focal) in [("fx", camera.fx), ("fy", camera.fy)] {
        if !(focal > 0.0 && focal <= 1e7) {
            return bad(format!("{name} is {focal}, it must be above 0 and at most 1e7 pixels"));
        }
    }
    let pose = camera
        .rotation
        .iter()
        .flatten()
        .chain(&camera.translation)
        .chain([&camera.cx, &camera.cy]);
    if pose.into_iter().any(|v| !v.is_finite()) {
        return bad("pose or principal point has a number that is not finite".into());
    }
    Ok(())
}
