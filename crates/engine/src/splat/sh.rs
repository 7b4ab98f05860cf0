//! Spherical harmonics: from coefficients to the colour seen from a direction, and the gradient back.
use super::{Changes, Learnable, PreparedView};
use crate::scene::Sh;
use rayon::prelude::*;

/// Coefficients a channel at the highest degree.
pub const MAX_COEFFICIENTS: usize = 25;

const C0: f32 = 0.282_094_8;
const C1: f32 = 0.488_602_52;
const C2: [f32; 5] = [1.092_548_5, -1.092_548_5, 0.315_391_57, -1.092_548_5, 0.546_274_24];
const C3: [f32; 7] = [
    -0.590_043_6,
    2.890_611_4,
    -0.457_045_8,
    0.373_176_34,
    -0.457_045_8,
    1.445_305_7,
    -0.590_043_6,
];
const C4: [f32; 9] = [
    2.503_343,
    -1.770_130_8,
    0.946_174_7,
    -0.669_046_6,
    0.105_785_55,
    -0.669_046_6,
    0.473_087_34,
    -1.770_130_8,
    0.625_835_8,
];

/// Values of the real spherical harmonics for the unit direction `dir`; those above `degree` are 0.
///
/// Order, signs and constants are those of the graphdeco reference up to degree 3 and of gsplat for degree 4.
pub fn basis(degree: usize, dir: [f32; 3]) -> [f32; MAX_COEFFICIENTS] {
    let [x, y, z] = dir;
    let mut b = [0.0; MAX_COEFFICIENTS];
    b[0] = C0;
    if degree == 0 {
        return b;
    }
    b[1] = -C1 * y;
    b[2] = C1 * z;
    b[3] = -C1 * x;
    if degree == 1 {
        return b;
    }
    let (xx, yy, zz) = (x * x, y * y, z * z);
    let (xy, yz, xz) = (x * y, y * z, x * z);
    b[4] = C2[0] * xy;
    b[5] = C2[1] * yz;
    b[6] = C2[2] * (2.0 * zz - xx - yy);
    b[7] = C2[3] * xz;
    b[8] = C2[4] * (xx - yy);
    if degree == 2 {
        return b;
    }
    b[9] = C3[0] * y * (3.0 * xx - yy);
    b[10] = C3[1] * xy * z;
    b[11] = C3[2] * y * (4.0 * zz - xx - yy);
    b[12] = C3[3] * z * (2.0 * zz - 3.0 * xx - 3.0 * yy);
    b[13] = C3[4] * x * (4.0 * zz - xx - yy);
    b[14] = C3[5] * z * (xx - yy);
    b[15] = C3[6] * x * (xx - 3.0 * yy);
    if degree == 3 {
        return b;
    }
    b[16] = C4[0] * xy * (xx - yy);
    b[17] = C4[1] * yz * (3.0 * xx - yy);
    b[18] = C4[2] * xy * (7.0 * zz - 1.0);
    b[19] = C4[3] * yz * (7.0 * zz - 3.0);
    b[20] = C4[4] * (zz * (35.0 * zz - 30.0) + 3.0);
    b[21] = C4[5] * xz * (7.0 * zz - 3.0);
    b[22] = C4[6] * (xx - yy) * (7.0 * zz - 1.0);
    b[23] = C4[7] * xz * (xx - 3.0 * yy);
    b[24] = C4[8] * (xx * (xx - 3.0 * yy) - yy * (3.0 * xx - yy));
    b
}

/// Colours of the visible Gaussians of `view`, `[visible][3]`: `max(0, SH(direction) + 0.5)`.
///
/// `changes` are added to the coefficients first; bands above the view's degree are left out. `view` must have been prepared from a scene of as many Gaussians as
/// `sh` has.
pub fn colours(sh: &Sh, changes: Option<Changes<'_>>, view: &PreparedView) -> Vec<f32> {
    let stride = sh.per_gaussian();
    let mut out = vec![0.0; view.visible.len() * 3];
    let work = |((out, &row), &dir): ((&mut [f32], &u32), &[f32; 3])| {
        let b = basis(sh.degree.min(view.degree), dir);
        let at = row as usize * stride;
        let mut c = [0.5f32; 3];
        let coefficients = &sh.coefficients[at..at + stride];
        let changed = changes.and_then(|changes| changes.of(row)).unwrap_or_default();
        let (both, plain) = coefficients.split_at(changed.len());
        for (k, (h, o)) in both.chunks_exact(3).zip(changed.chunks_exact(3)).enumerate() {
            for j in 0..3 {
                c[j] += b[k] * (h[j] + o[j]);
            }
        }
        for (k, h) in plain.chunks_exact(3).enumerate() {
            for j in 0..3 {
                c[j] += b[changed.len() / 3 + k] * h[j];
            }
        }
        for j in 0..3 {
            out[j] = c[j].max(0.0);
        }
    };
    (out.par_chunks_exact_mut(3), &view.visible, &view.directions)
        .into_par_iter()
        .with_min_len(2048)
        .for_each(|(o, r, d)| work(((o, r), d)));
    out
}

/// Adds to `out` (`[slots][columns]`) what `colour_gradient` (`[visible][3]`) means for the learned coefficients.
///
/// `colours` are those that [`colours`] returned: where one is 0 it was clamped, and its gradient is 0.
pub fn backward(learnable: &Learnable, view: &PreparedView, colours: &[f32], colour_gradient: &[f32], out: &mut [f32]) {
    let part = Part {
        learnable,
        degree: learnable.degree().min(view.degree),
        visible: &view.visible,
        directions: &view.directions,
        colours,
        colour_gradient,
    };
    part.add(0, out);
}

/// A range of the visible Gaussians; ranges own disjoint slots of the gradient because `visible` and slots ascend.
#[derive(Clone, Copy)]
struct Part<'a> {
    learnable: &'a Learnable,
    degree: usize,
    visible: &'a [u32],
    directions: &'a [[f32; 3]],
    colours: &'a [f32],
    colour_gradient: &'a [f32],
}

impl Part<'_> {
    /// `out` starts at the slot `first`.
    fn add(self, first: usize, out: &mut [f32]) {
        let (n, columns) = (self.visible.len(), self.learnable.columns());
        if n > 4096 {
            let at = n / 2;
            // Where the later part's first slot is; without one it has nothing to add to.
            let slot = self.visible[at..].iter().find_map(|row| self.learnable.slot(*row));
            let slot = slot.unwrap_or(first + out.len() / columns);
            let (v, d) = (self.visible.split_at(at), self.directions.split_at(at));
            let (c, g) = (self.colours.split_at(3 * at), self.colour_gradient.split_at(3 * at));
            let (low, high) = out.split_at_mut((slot - first) * columns);
            let left = Part {
                visible: v.0,
                directions: d.0,
                colours: c.0,
                colour_gradient: g.0,
                ..self
            };
            let right = Part {
                visible: v.1,
                directions: d.1,
                colours: c.1,
                colour_gradient: g.1,
                ..self
            };
            rayon::join(|| left.add(first, low), || right.add(slot, high));
            return;
        }
        for i in 0..n {
            let mut g = [0.0f32; 3];
            for j in 0..3 {
                if self.colours[3 * i + j] > 0.0 {
                    g[j] = self.colour_gradient[3 * i + j];
                }
            }
            if g == [0.0; 3] {
                continue;
            }
            let Some(slot) = self.learnable.slot(self.visible[i]) else {
                continue;
            };
            let b = basis(self.degree, self.directions[i]);
            let at = (slot - first) * columns;
            for (k, out) in out[at..at + columns].chunks_exact_mut(3).enumerate() {
                for j in 0..3 {
                    out[j] += b[k] * g[j];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Directions spread evenly over the sphere (Fibonacci lattice).
    fn sphere(n: usize) -> impl Iterator<Item = [f32; 3]> {
        (0..n).map(move |i| {
            let z = 1.0 - (2.0 * i as f64 + 1.0) / n as f64;
            let r = (1.0 - z * z).sqrt();
            let a = i as f64 * std::f64::consts::PI * (3.0 - 5f64.sqrt());
            [(r * a.cos()) as f32, (r * a.sin()) as f32, z as f32]
        })
    }

    #[test]
    fn the_basis_is_orthonormal() {
        let n = 20_000;
        let mut gram = [[0.0f64; MAX_COEFFICIENTS]; MAX_COEFFICIENTS];
        for dir in sphere(n) {
            let b = basis(4, dir);
            for i in 0..MAX_COEFFICIENTS {
                for j in 0..MAX_COEFFICIENTS {
                    gram[i][j] += f64::from(b[i] * b[j]) * 4.0 * std::f64::consts::PI / n as f64;
                }
            }
        }
        for i in 0..MAX_COEFFICIENTS {
            for j in 0..MAX_COEFFICIENTS {
                let want = f64::from(i == j);
                assert!((gram[i][j] - want).abs() < 2e-3, "<{i},{j}> = {}", gram[i][j]);
            }
        }
    }

    #[test]
    fn lower_degrees_are_prefixes() {
        let dir = [0.48, -0.6, 0.64];
        let full = basis(4, dir);
        for degree in 0..4 {
            let count = (degree + 1) * (degree + 1);
            let b = basis(degree, dir);
            assert_eq!(b[..count], full[..count]);
            assert!(b[count..].iter().all(|v| *v == 0.0));
        }
    }
}
