//! To which sides a scene is open: what its geometry alone says about how it was captured.
//!
//! 4096 Gaussians, drawn by what they show, look along 64 even directions through the [grid](super::solid). A look that leaves
//! the grid has *escaped*: from that side the Gaussian is seen. The first two cells are passed over, since layers of one
//! surface lie there. From free cells the same looks tell how far they are *closed in*.
use super::extent::Extent;
use super::focus::Focus;
use super::lattice::lattice;
use super::quantiles::quantiles;
use super::solid::SolidGrid;
use super::vantage::Vantage;
use super::vector::dot;
use crate::scene::Gaussians;
use rayon::prelude::*;
use serde::Serialize;

/// Gaussians that look around.
const SAMPLES: usize = 4096;
/// Directions in which they look; one bit each.
const LOOKS: usize = 64;
/// Cells that are passed over.
const SKIPPED: f32 = 2.0;
/// One free cell in so many along each axis is looked from.
const STRIDE: usize = 2;
/// A free cell is closed in when at most this share of its looks escapes, but for those that are steeply upwards: few captures
/// have a ceiling.
const ESCAPES: f32 = 0.15;
/// Sine of elevation above which a look is steeply upwards: 45 degrees.
const STEEP: f32 = 0.707;
/// A Gaussian faces the inside when at most this share of its looks escapes, and this share of them goes this far, in sides of
/// the grid.
const BURIED: f32 = 0.05;
const FACING_FREE: f32 = 0.2;
const FAR: f32 = 0.15;
/// Cosine between a side and the looks that tell what is seen from it, 32 degrees; a Gaussian counts with the share of these that
/// escapes.
const SIDE: f32 = 0.85;
/// How much what is hidden counts against what is seen.
const HIDDEN: f32 = 2.0;
/// Largest sine of elevation of a level side: 37 degrees.
const LEVEL: f32 = 0.6;

/// What the geometry of a scene says; shares are of what the scene shows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Openness {
    /// Gaussians of the scene.
    #[serde(skip)]
    pub gaussians: usize,
    /// Share of the grid's cells that are free and closed in.
    pub hollow: f32,
    /// Share that nobody outside sees, and that faces free space.
    pub inside: f32,
    /// The level side from which most is seen and least is hidden, a unit vector.
    pub front: [f32; 3],
    /// Share that is seen from there.
    pub seen_from_front: f32,
    /// Share that is hidden from there.
    pub hidden_from_front: f32,
    /// Share that is hidden from the opposite side.
    pub hidden_from_behind: f32,
    /// Share that is seen from above.
    pub seen_from_above: f32,
    /// Height over width, of the middle nine tenths of what is shown.
    pub flatness: f32,
    /// How much farther what is shown goes than what is drawn finest.
    pub spread: f32,
    /// Share of the horizon, as seen from there, that surroundings cover.
    pub surrounded: f32,
    /// What views from several places see, where the other figures make it an object or a room of which much is
    /// hidden.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vantage: Option<Vantage>,
}

impl Openness {
    /// Measures a scene, whose Gaussians [show](super::extent::weights) so much, with its focus and its grid; the same scene
    /// gives the same figures, whatever its colours.
    pub(super) fn of(gaussians: &Gaussians, shown: &[f64], extent: &Extent, focus: &Focus, grid: &SolidGrid) -> Self {
        let looks: Vec<[f32; 3]> = lattice(LOOKS).collect();
        let length = grid.side * *grid.counts.iter().max().unwrap_or(&1) as f32;
        let rows = drawn(shown);
        let count = rows.len().max(1) as f32;
        let cones: Vec<u64> = looks.iter().map(|side| cone(*side, &looks)).collect();
        let (mut inside, mut seen_from, mut hidden_from) = (0, [0.0f32; LOOKS], [0.0f32; LOOKS]);
        let looked = |row: usize| {
            let place = gaussians.positions[row];
            let (mut escaped, mut far) = (0u64, 0);
            for (bit, look) in looks.iter().enumerate() {
                match grid.way(place, *look, SKIPPED) {
                    None => escaped |= 1 << bit,
                    Some(way) => far += usize::from(way > FAR * length),
                }
            }
            (escaped, far)
        };
        let looked: Vec<(u64, usize)> = rows.into_par_iter().with_min_len(64).map(looked).collect();
        for (escaped, far) in looked {
            let share = |count: usize| count as f32 / LOOKS as f32;
            inside += usize::from(share(escaped.count_ones() as usize) <= BURIED && share(far) >= FACING_FREE);
            for (side, cone) in cones.iter().enumerate() {
                let seen = (escaped & cone).count_ones();
                seen_from[side] += seen as f32 / cone.count_ones().max(1) as f32;
                hidden_from[side] += f32::from(u8::from(seen == 0));
            }
        }
        let (seen, hidden) = (seen_from.map(|sum| sum / count), hidden_from.map(|sum| sum / count));
        let nearest = |to: [f32; 3]| {
            let near = |a: &usize, b: &usize| dot(looks[*a], to).total_cmp(&dot(looks[*b], to));
            (0..LOOKS).max_by(near).unwrap_or(0)
        };
        // Sheets are seen from both sides; what stands before them is hidden from behind, and counts.
        let open = |side: usize| seen[side] - HIDDEN * hidden[side];
        let level = (0..LOOKS).filter(|side| dot(looks[*side], extent.up).abs() < LEVEL);
        let front = level.max_by(|a, b| open(*a).total_cmp(&open(*b))).unwrap_or(0);
        let behind = nearest(looks[front].map(|x| -x));
        Self {
            gaussians: gaussians.len(),
            hollow: hollow(grid, &looks, extent.up),
            inside: inside as f32 / count,
            front: looks[front],
            seen_from_front: seen[front],
            hidden_from_front: hidden[front],
            hidden_from_behind: hidden[behind],
            seen_from_above: seen[nearest(extent.up)],
            flatness: flatness(gaussians, shown, extent),
            spread: focus.spread,
            surrounded: focus.surrounded,
            vantage: None,
        }
    }
}

/// The looks near a side, a bit each.
fn cone(side: [f32; 3], looks: &[[f32; 3]]) -> u64 {
    let near = looks.iter().enumerate().filter(|(_, look)| dot(side, **look) > SIDE);
    near.fold(0, |cone, (bit, _)| cone | 1 << bit)
}

/// Rows drawn by their weights, evenly along the sum.
fn drawn(weights: &[f64]) -> Vec<usize> {
    let step = weights.iter().sum::<f64>() / SAMPLES as f64;
    let (mut rows, mut sum) = (Vec::with_capacity(SAMPLES), 0.0);
    for (row, weight) in weights.iter().enumerate() {
        sum += weight;
        while rows.len() < SAMPLES && (rows.len() as f64 + 0.5) * step < sum {
            rows.push(row);
        }
    }
    rows
}

/// Share of the grid's cells that are free and closed in.
fn hollow(grid: &SolidGrid, looks: &[[f32; 3]], up: [f32; 3]) -> f32 {
    let looks: Vec<_> = looks.iter().filter(|look| dot(**look, up) < STEEP).collect();
    let most = (ESCAPES * looks.len() as f32) as usize;
    let looked_from = |cell: &usize| grid.numbers(*cell).iter().all(|n| n % STRIDE == 0);
    let cells: Vec<usize> = (0..grid.len()).filter(looked_from).collect();
    let is_closed_in = |cell: &&usize| {
        let place = grid.middle(**cell);
        let mut escapes = looks.iter().filter(|look| grid.way(place, ***look, 0.0).is_none());
        grid.is_free(**cell) && escapes.nth(most).is_none()
    };
    let closed_in = cells.par_iter().with_min_len(64).filter(is_closed_in).count();
    closed_in as f32 / cells.len().max(1) as f32
}

/// Height over width of the middle nine tenths.
fn flatness(gaussians: &Gaussians, shown: &[f64], extent: &Extent) -> f32 {
    let spans: [f64; 3] = std::array::from_fn(|k| {
        let values = gaussians.positions.iter().map(|p| f64::from(p[k]));
        let [low, high] = quantiles(values, shown, [0.05, 0.95]);
        high - low
    });
    let vertical = (0..3).fold(0, |best: usize, k| {
        if extent.up[k].abs() > extent.up[best].abs() {
            k
        } else {
            best
        }
    });
    let width = spans[(vertical + 1) % 3].min(spans[(vertical + 2) % 3]);
    (spans[vertical] / width.max(1e-9)) as f32
}
