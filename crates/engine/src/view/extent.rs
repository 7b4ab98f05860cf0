//! Where a scene is, how large it is and which way is up, robust against floaters.
//!
//! Every Gaussian counts by what it shows: opacity times the area of its two longer axes, where areas are capped at
//! the 90 % quantile so that a few huge Gaussians (sky, haze) do not decide. Then
//!
//! * centre: per axis, midway between the 10 % and the 90 % quantile of the positions. The median would sit in the
//!   densest part, which for a figure on a patch of ground is the ground;
//! * radius: the 95 % quantile of the distance to the centre, but at most 2.5 times the median distance, which only
//!   bites where a far background surrounds what was captured;
//! * up: flat captures betray the ground. For each axis the Gaussians whose shortest axis is along it are taken as
//!   level surfaces; the axis with the most is vertical, with y preferred unless another has half as much again.
//!   If those level surfaces gather at one end of the scene, that end is below; if not, the convention of the tools
//!   decides: y points down (COLMAP), z up (NeRF), x up.
//!
//! A scene *lies on ground* when one thin level sheet at its lower end is wide and carries a good part of the weight:
//! from below there would be nothing to see but that sheet.
use super::quantiles::quantiles;
use crate::error::{Error, Result};
use crate::scene::Gaussians;

/// Largest radius and coordinate of a scene; beyond it single precision cannot hold a camera that sees it.
const MAX_SIZE: f64 = 1e12;
/// Radius given to a scene whose Gaussians are all points at one place.
const MIN_RADIUS: f64 = 1e-6;

/// Half the thickness of what may count as one level sheet, in radii of the scene.
const HALF_SHEET: f64 = 0.06;

/// Robust place, size and orientation of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Extent {
    /// Centre of what is to be seen, world units.
    pub centre: [f32; 3],
    /// Radius of the sphere that holds nearly all of it, world units, greater than zero.
    pub radius: f32,
    /// Unit vector.
    pub up: [f32; 3],
    /// Whether the scene lies on a sheet of ground that hides it from below.
    pub on_ground: bool,
}

impl Extent {
    /// Measures a scene.
    ///
    /// # Errors
    /// [`Error::BadOption`] for a scene without Gaussians, or one larger than 10^12 units.
    pub fn of(gaussians: &Gaussians) -> Result<Extent> {
        Self::weighed(gaussians, &weights(gaussians))
    }

    /// Measures a scene whose Gaussians [show](weights) so much.
    ///
    /// # Errors
    /// Those of [`Extent::of`].
    pub(super) fn weighed(gaussians: &Gaussians, weights: &[f64]) -> Result<Extent> {
        if gaussians.is_empty() {
            return Err(bad("it has no Gaussians, so there is nothing to see".into()));
        }
        let axis = |k: usize| gaussians.positions.iter().map(move |p| f64::from(p[k]));
        let spans: [[f64; 2]; 3] = std::array::from_fn(|k| quantiles(axis(k), weights, [0.1, 0.9]));
        let centre: [f64; 3] = std::array::from_fn(|k| 0.5 * (spans[k][0] + spans[k][1]));
        let distances = gaussians.positions.iter().map(|p| {
            (0..3)
                .map(|k| (f64::from(p[k]) - centre[k]).powi(2))
                .sum::<f64>()
                .sqrt()
        });
        let [half, most] = quantiles(distances, weights, [0.5, 0.95]);
        // What a scene of one Gaussian, or of many at one place, shows is as large as the Gaussians are.
        let size = 2.0 * quantiles(gaussians.log_scales.iter().map(longest), weights, [0.5])[0];
        let radius = most.min(2.5 * half).max(size).max(MIN_RADIUS);
        if centre.iter().any(|c| c.abs() > MAX_SIZE) || radius > MAX_SIZE {
            return Err(bad(format!(
                "centre {centre:?} or radius {radius} is beyond the limit of {MAX_SIZE:e} units"
            )));
        }
        let (up, on_ground) = up(gaussians, weights, centre, radius);
        Ok(Extent {
            centre: centre.map(|c| c as f32),
            radius: radius as f32,
            up,
            on_ground,
        })
    }
}

fn bad(reason: String) -> Error {
    Error::BadOption { field: "scene", reason }
}

/// Standard deviation along a Gaussian's longest axis.
fn longest(log_scales: &[f32; 3]) -> f64 {
    log_scales.iter().map(|s| f64::from(*s).exp()).fold(0.0, f64::max)
}

/// The product of the standard deviations along a Gaussian's two longer axes.
pub(super) fn area(log_scales: &[f32; 3]) -> f64 {
    // Scales of points and lines are minus infinity: they show nothing. A disc has one such axis, and an area.
    let [a, b, c] = log_scales.map(f64::from);
    (a + b).max(b + c).max(c + a).exp()
}

/// What each Gaussian shows: opacity times capped area; never all zero.
pub(super) fn weights(gaussians: &Gaussians) -> Vec<f64> {
    let areas: Vec<f64> = gaussians.log_scales.iter().map(area).collect();
    let ones = vec![1.0; areas.len()];
    let cap = quantiles(areas.iter().copied(), &ones, [0.9])[0];
    let weights: Vec<f64> = (0..gaussians.len())
        .map(|row| f64::from(gaussians.opacity(row)) * areas[row].min(cap))
        .collect();
    let total: f64 = weights.iter().sum();
    if total.is_finite() && total > 0.0 {
        weights
    } else {
        ones
    }
}

/// The upward direction, and whether the scene lies on ground.
fn up(gaussians: &Gaussians, weights: &[f64], centre: [f64; 3], radius: f64) -> ([f32; 3], bool) {
    let normals: Vec<[f32; 3]> = (0..gaussians.len()).map(|row| normal(gaussians, row)).collect();
    let level: [Vec<f64>; 3] = std::array::from_fn(|k| {
        normals
            .iter()
            .zip(weights)
            .map(|(n, w)| if n[k].abs() > 0.8 { *w } else { 0.0 })
            .collect()
    });
    let share: [f64; 3] = std::array::from_fn(|k| level[k].iter().sum());
    let vertical = [0, 2].into_iter().fold(1, |best: usize, k| {
        let favour = if best == 1 { 1.5 } else { 1.0 };
        if share[k] > favour * share[best] { k } else { best }
    });
    // From here on in radii from the centre.
    let place = |row: usize, k: usize| (f64::from(gaussians.positions[row][k]) - centre[k]) / radius;
    let heights: Vec<f64> = (0..gaussians.len()).map(|row| place(row, vertical)).collect();
    let [sheet] = quantiles(heights.iter().copied(), &level[vertical], [0.5]);
    let (mut below, mut above, mut in_sheet) = (0.0, 0.0, weights.to_vec());
    for row in 0..gaussians.len() {
        if (heights[row] - sheet).abs() >= HALF_SHEET {
            *(if heights[row] < sheet { &mut below } else { &mut above }) += weights[row];
            in_sheet[row] = 0.0;
        }
    }
    let (a, b) = ((vertical + 1) % 3, (vertical + 2) % 3);
    let from_axis = (0..gaussians.len()).map(|row| place(row, a).hypot(place(row, b)));
    let [width] = quantiles(from_axis, &in_sheet, [0.9]);

    let total: f64 = weights.iter().sum();
    let at_an_end = f64::min(above, below) < 0.05 * total && f64::max(above, below) > 0.1 * total;
    let on_ground = at_an_end && width > 0.6 && in_sheet.iter().sum::<f64>() > 0.25 * total;
    let upwards = if at_an_end { above > below } else { vertical != 1 };
    let mut up = [0.0; 3];
    up[vertical] = if upwards { 1.0 } else { -1.0 };
    (up, on_ground)
}

/// The direction of a Gaussian's shortest axis, zero where it is not flat enough to have one.
fn normal(gaussians: &Gaussians, row: usize) -> [f32; 3] {
    let scales = gaussians.log_scales[row];
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| scales[*a].total_cmp(&scales[*b]));
    let flat = scales[order[0]] < scales[order[1]] - 0.5;
    if flat { axes(gaussians, row)[order[0]] } else { [0.0; 3] }
}

/// The axes of a Gaussian in the world, and which of them is the shortest.
pub(super) fn shortest_axis(gaussians: &Gaussians, row: usize) -> ([[f32; 3]; 3], usize) {
    let scales = gaussians.log_scales[row];
    let shortest = (0..3).fold(0, |best: usize, k| if scales[k] < scales[best] { k } else { best });
    (axes(gaussians, row), shortest)
}

/// The axes of a Gaussian in the world: the columns of its rotation's matrix.
fn axes(gaussians: &Gaussians, row: usize) -> [[f32; 3]; 3] {
    // What has no direction is not turned, as in the renderer; whole files of zeros exist.
    let q = gaussians.rotations[row].map(f64::from);
    let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    let [w, x, y, z] = if length > 0.0 && length.is_finite() {
        q.map(|v| (v / length) as f32)
    } else {
        [1.0, 0.0, 0.0, 0.0]
    };
    [
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y + w * z),
            2.0 * (x * z - w * y),
        ],
        [
            2.0 * (x * y - w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z + w * x),
        ],
        [
            2.0 * (x * z + w * y),
            2.0 * (y * z - w * x),
            1.0 - 2.0 * (x * x + y * y),
        ],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::scene_path;

    /// A level disc of flat Gaussians at height `ground`, with a column from there to `top` on it, along `axis`.
    fn figure(axis: usize, ground: f32, top: f32) -> Gaussians {
        let mut gaussians = Gaussians::default();
        for i in 0..1000 {
            let (sine, cosine) = (i as f32 * 2.4).sin_cos();
            let t = i as f32 / 1000.0;
            let (reach, height, scales) = if i % 4 == 0 {
                (0.1, ground + t * (top - ground), [-3.0; 3])
            } else {
                (t.sqrt(), ground, [0, 1, 2].map(|k| if k == axis { -8.0 } else { -3.0 }))
            };
            let mut position = [0.0; 3];
            position[axis] = height;
            position[(axis + 1) % 3] = 5.0 + reach * sine;
            position[(axis + 2) % 3] = reach * cosine;
            gaussians.positions.push(position);
            gaussians.log_scales.push(scales);
            gaussians.rotations.push([2.0, 0.0, 0.0, 0.0]);
            gaussians.opacity_logits.push(3.0);
        }
        gaussians
    }

    #[test]
    fn a_figure_on_ground_stands_upright_whatever_its_axis() {
        for axis in 0..3 {
            for top in [1.5, -1.5] {
                let extent = Extent::of(&figure(axis, 2.0, 2.0 + top)).unwrap();
                let mut up = [0.0; 3];
                up[axis] = top.signum();
                assert_eq!((extent.up, extent.on_ground), (up, true));
                assert!((extent.centre[(axis + 1) % 3] - 5.0).abs() < 0.1);
                assert!((0.8..1.8).contains(&extent.radius), "{}", extent.radius);
            }
        }
    }

    #[test]
    fn floaters_and_huge_gaussians_do_not_move_it() {
        let clean = figure(1, 0.0, 1.0);
        let mut dirty = clean.clone();
        for i in 0..20 {
            dirty.positions[50 * i] = [1e4, -1e5, 3e4];
            dirty.log_scales[50 * i] = [20.0; 3];
        }
        let (clean, dirty) = (Extent::of(&clean).unwrap(), Extent::of(&dirty).unwrap());
        assert_eq!(clean.up, dirty.up);
        assert!(
            (0.9..1.2).contains(&(dirty.radius / clean.radius)),
            "{clean:?} {dirty:?}"
        );
    }

    #[test]
    fn real_scenes_are_seen_the_right_way_up() {
        let known = [
            ("pod.ply", [0.0, -1.0, 0.0], false),
            ("donut.ply", [0.0, 0.0, 1.0], false),
            ("playbot_31k.ply", [0.0, -1.0, 0.0], true),
            ("playbot_8k.ply", [0.0, -1.0, 0.0], true),
        ];
        for (name, up, on_ground) in known {
            let Some(path) = scene_path(name) else { return };
            let extent = Extent::of(&crate::scene::Scene::read(&path).unwrap().gaussians).unwrap();
            assert_eq!((extent.up, extent.on_ground), (up, on_ground), "{name}");
        }
    }
}
