//! The rasteriser once more, plainly, in double precision: what the fast ones are compared with.
//!
//! A loop over pixels and depth-sorted Gaussians, with the formulas in the order in which the graphdeco code states
//! them and nothing shared with the other modules but the rules for degenerate input: logits clamped to +-20, log
//! scales to +-30, a zero quaternion is the identity, what is not finite is not drawn. Slow; for tests.
use crate::scene::Gaussians;
use crate::view::Camera;

const TILE: f64 = 16.0;
/// How near, relatively, a decision must be to its threshold to fall either way in single precision.
const NEAR_ALPHA: f64 = 2e-4;
const NEAR_TRANSMITTANCE: f64 = 2e-3;
/// Contributions below this do not matter for a comparison within 1e-4.
const NEGLIGIBLE: f64 = 1e-5;

/// A picture in double precision.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendering {
    /// `[height][width][3]`.
    pub pixels: Vec<f64>,
    /// `[height][width]`: whether some visible contribution sits so near a threshold (alpha 1/255, transmittance 1e-4)
    /// that single precision may decide otherwise. One such decision changes a pixel by up to 1/255, so comparisons
    /// bound these pixels apart.
    pub uncertain: Vec<bool>,
}

/// One projected Gaussian.
struct Projected {
    row: usize,
    depth: f32,
    mean: [f64; 2],
    conic: [f64; 3],
    opacity: f64,
    tiles: [[f64; 2]; 2],
    basis: Vec<f64>,
    /// Before the clamp.
    colour: [f64; 3],
}

/// Draws `gaussians` over `background`.
pub fn render(gaussians: &Gaussians, camera: &Camera, background: [f64; 3]) -> Rendering {
    let sorted = project_all(gaussians, camera);
    let mut out = Rendering {
        pixels: Vec::new(),
        uncertain: Vec::new(),
    };
    for y in 0..camera.height {
        for x in 0..camera.width {
            let mut colour = [0.0; 3];
            let (left, uncertain) = composite(&sorted, x, y, |g, weight| {
                for j in 0..3 {
                    colour[j] += weight * g.colour[j].max(0.0);
                }
            });
            out.pixels.extend((0..3).map(|j| colour[j] + left * background[j]));
            out.uncertain.push(uncertain);
        }
    }
    out
}

/// Gradient to the SH coefficients (`[n][(degree+1)^2][3]`) of a loss whose gradient to the picture is given.
pub fn gradient(gaussians: &Gaussians, camera: &Camera, picture_gradient: &[f64]) -> Vec<f64> {
    let sorted = project_all(gaussians, camera);
    let stride = gaussians.sh.per_gaussian();
    let mut out = vec![0.0; gaussians.len() * stride];
    for y in 0..camera.height {
        for x in 0..camera.width {
            let at = 3 * (y * camera.width + x) as usize;
            let pixel = &picture_gradient[at..at + 3];
            composite(&sorted, x, y, |g, weight| {
                let out = &mut out[g.row * stride..(g.row + 1) * stride];
                for j in (0..3).filter(|j| g.colour[*j] > 0.0) {
                    for (k, b) in g.basis.iter().enumerate() {
                        out[3 * k + j] += b * weight * pixel[j];
                    }
                }
            });
        }
    }
    out
}

/// Gives `add` every contribution to a pixel, front to back; returns what is left for the background.
fn composite<'a>(sorted: &'a [Projected], x: u32, y: u32, mut add: impl FnMut(&'a Projected, f64)) -> (f64, bool) {
    let (x, y) = (f64::from(x), f64::from(y));
    let tile = [(x / TILE).floor(), (y / TILE).floor()];
    let (mut transmittance, mut uncertain) = (1.0, false);
    for g in sorted {
        if (0..2).any(|k| tile[k] < g.tiles[k][0] || tile[k] >= g.tiles[k][1]) {
            continue;
        }
        let (dx, dy) = (g.mean[0] - x, g.mean[1] - y);
        let power = -0.5 * (g.conic[0] * dx * dx + g.conic[2] * dy * dy) - g.conic[1] * dx * dy;
        if power > 0.0 {
            continue;
        }
        let alpha = (g.opacity * power.exp()).min(0.99);
        uncertain |= (alpha * 255.0 - 1.0).abs() < NEAR_ALPHA && alpha * transmittance > NEGLIGIBLE;
        if alpha < 1.0 / 255.0 {
            continue;
        }
        let left = transmittance * (1.0 - alpha);
        uncertain |= (left / 1e-4 - 1.0).abs() < NEAR_TRANSMITTANCE && alpha * transmittance > NEGLIGIBLE;
        if left < 1e-4 {
            break;
        }
        add(g, alpha * transmittance);
        transmittance = left;
    }
    (transmittance, uncertain)
}

fn project_all(gaussians: &Gaussians, camera: &Camera) -> Vec<Projected> {
    let mut sorted: Vec<Projected> = (0..gaussians.len())
        .filter_map(|row| project(gaussians, camera, row))
        .collect();
    // The key is single precision, as in the rasterisers; equal depths go by row.
    sorted.sort_by(|a, b| a.depth.total_cmp(&b.depth).then(a.row.cmp(&b.row)));
    sorted
}

type Matrix = [[f64; 3]; 3];

fn multiply(a: Matrix, b: Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

fn transpose(a: Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

fn project(gaussians: &Gaussians, camera: &Camera, row: usize) -> Option<Projected> {
    let w: Matrix = camera.rotation.map(|r| r.map(f64::from));
    let translation = camera.translation.map(f64::from);
    let p = gaussians.positions[row].map(f64::from);
    let view: [f64; 3] = std::array::from_fn(|r| w[r][0] * p[0] + w[r][1] * p[1] + w[r][2] * p[2] + translation[r]);
    if view[2] <= f64::from(0.2f32) {
        return None;
    }
    let focal = [f64::from(camera.fx), f64::from(camera.fy)];
    let size = [f64::from(camera.width), f64::from(camera.height)];
    let principal = [f64::from(camera.cx), f64::from(camera.cy)];
    let mean: [f64; 2] = std::array::from_fn(|k| focal[k] * view[k] / (view[2] + 1e-7) + principal[k] - 0.5);

    let scale = gaussians.log_scales[row].map(|s| f64::from(s.clamp(-30.0, 30.0)).exp());
    let r = rotation_matrix(gaussians.rotations[row].map(f64::from));
    let m: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| r[i][j] * scale[j]));
    let sigma = multiply(m, transpose(m));
    let t: [f64; 2] = std::array::from_fn(|k| {
        let limit = 1.3 * size[k] / (2.0 * focal[k]);
        (view[k] / view[2]).clamp(-limit, limit) * view[2]
    });
    let z = view[2];
    let j = [
        [focal[0] / z, 0.0, -focal[0] * t[0] / (z * z)],
        [0.0, focal[1] / z, -focal[1] * t[1] / (z * z)],
        [0.0; 3],
    ];
    let jw = multiply(j, w);
    let cov = multiply(multiply(jw, sigma), transpose(jw));
    let (a, b, c) = (cov[0][0] + 0.3, cov[0][1], cov[1][1] + 0.3);
    let det = a * c - b * b;
    if det == 0.0 {
        return None;
    }
    let mid = 0.5 * (a + c);
    let largest = mid + (mid * mid - det).max(0.1).sqrt();
    let radius = (3.0 * largest.sqrt()).ceil();
    let tiles = std::array::from_fn(|k| {
        let count = (size[k] / TILE).ceil();
        let low = ((mean[k] - radius) / TILE).trunc().clamp(0.0, count);
        [low, ((mean[k] + radius + TILE - 1.0) / TILE).trunc().clamp(0.0, count)]
    });
    let logit = f64::from(gaussians.opacity_logits[row].clamp(-20.0, 20.0));
    let conic = [c / det, -b / det, a / det];
    if mean.iter().chain(&conic).any(|v| !v.is_finite()) {
        return None;
    }
    let (basis, colour) = colour(gaussians, camera, row);
    Some(Projected {
        row,
        depth: z as f32,
        mean,
        conic,
        opacity: 1.0 / (1.0 + (-logit).exp()),
        tiles,
        basis,
        colour,
    })
}

fn rotation_matrix(q: [f64; 4]) -> Matrix {
    let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    let [w, x, y, z] = if norm > 0.0 && norm.is_finite() {
        q.map(|v| v / norm)
    } else {
        [1.0, 0.0, 0.0, 0.0]
    };
    [
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
        ],
        [
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
        ],
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        ],
    ]
}

/// The basis in the direction of a Gaussian, and its colour before the clamp.
fn colour(gaussians: &Gaussians, camera: &Camera, row: usize) -> (Vec<f64>, [f64; 3]) {
    let w = camera.rotation.map(|r| r.map(f64::from));
    let t = camera.translation.map(f64::from);
    let centre: [f64; 3] = std::array::from_fn(|k| -(0..3).map(|r| w[r][k] * t[r]).sum::<f64>());
    let d: [f64; 3] = std::array::from_fn(|k| f64::from(gaussians.positions[row][k]) - centre[k]);
    let length = d.iter().map(|v| v * v).sum::<f64>().sqrt();
    let basis = harmonics(gaussians.sh.degree, d.map(|v| v / length));
    let stride = gaussians.sh.per_gaussian();
    let h = &gaussians.sh.coefficients[row * stride..(row + 1) * stride];
    let colour = std::array::from_fn(|j| {
        0.5 + basis
            .iter()
            .enumerate()
            .map(|(k, b)| b * f64::from(h[3 * k + j]))
            .sum::<f64>()
    });
    (basis, colour)
}

/// Real spherical harmonics from associated Legendre polynomials with the Condon-Shortley sign, index `l (l + 1) + m`.
pub(super) fn harmonics(degree: usize, [x, y, z]: [f64; 3]) -> Vec<f64> {
    let mut out = vec![0.0; (degree + 1) * (degree + 1)];
    let factorial = |n: usize| (1..=n).map(|v| v as f64).product::<f64>();
    // (x + iy)^m, which carries sin^m of the polar angle, and P_mm without it.
    let (mut re, mut im, mut p_mm) = (1.0, 0.0, 1.0);
    for m in 0..=degree {
        let (mut before, mut p) = (0.0, p_mm);
        for l in m..=degree {
            let norm = ((2 * l + 1) as f64 / (4.0 * std::f64::consts::PI) * factorial(l - m) / factorial(l + m)).sqrt();
            if m == 0 {
                out[l * (l + 1)] = norm * p;
            } else {
                out[l * (l + 1) + m] = 2f64.sqrt() * norm * p * re;
                out[l * (l + 1) - m] = 2f64.sqrt() * norm * p * im;
            }
            let next = (z * (2 * l + 1) as f64 * p - (l + m) as f64 * before) / (l + 1 - m) as f64;
            (before, p) = (p, next);
        }
        (re, im) = (re * x - im * y, re * y + im * x);
        p_mm *= -((2 * m + 1) as f64);
    }
    out
}

#[cfg(test)]
mod tests;
