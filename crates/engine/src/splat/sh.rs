//! Spherical harmonics: from coefficients to the colour seen from a direction, and the gradient back.
use super::{Changes, Learnable, PreparedView};
use crate::scene::Sh;
use rayon::prelude::*;
use std::ops::Range;

/// Coefficients a channel at the highest degree.
pub const MAX_COEFFICIENTS: usize = 25;

pub(super) const C0: f32 = 0.282_094_8;
pub(super) const C1: f32 = 0.488_602_52;
pub(super) const C2: [f32; 5] = [1.092_548_5, -1.092_548_5, 0.315_391_57, -1.092_548_5, 0.546_274_24];
pub(super) const C3: [f32; 7] = [
    -0.590_043_6,
    2.890_611_4,
    -0.457_045_8,
    0.373_176_34,
    -0.457_045_8,
    1.445_305_7,
    -0.590_043_6,
];
pub(super) const C4: [f32; 9] = [
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

/// Rows of coefficients that one task takes: with what is learned of them they fit the second cache, so that memory is read
/// once for all views.
const ROWS: usize = 1024;

/// Colours of the visible Gaussians of `view`, `[visible][3]`: `max(0, SH(direction) + 0.5)`.
///
/// `changes` are added to the coefficients first; bands above the view's degree are left out. `view` must have been prepared from a scene of as many Gaussians as
/// `sh` has.
pub fn colours(sh: &Sh, changes: Option<Changes<'_>>, view: &PreparedView) -> Vec<f32> {
    colours_of_views(sh, changes, &[view]).pop().unwrap_or_default()
}

/// [`colours`] of each of some views.
pub fn colours_of_views(sh: &Sh, changes: Option<Changes<'_>>, views: &[&PreparedView]) -> Vec<Vec<f32>> {
    let stride = sh.per_gaussian();
    let mut all: Vec<Vec<f32>> = views.iter().map(|view| vec![0.0; view.visible.len() * 3]).collect();
    let mut tasks: Vec<Vec<ColoursOfPart<'_>>> = Vec::new();
    tasks.resize_with((sh.coefficients.len() / stride).div_ceil(ROWS), Vec::new);
    for (view, out) in views.iter().zip(&mut all) {
        let mut rest = &mut out[..];
        for (task, seen) in tasks.iter_mut().zip(parts(&view.visible)) {
            let (out, after) = std::mem::take(&mut rest).split_at_mut(3 * seen.len());
            rest = after;
            task.push(ColoursOfPart { view, seen, out });
        }
    }
    tasks
        .into_par_iter()
        .flatten_iter()
        .for_each(|ColoursOfPart { view, seen, out }| {
            let degree = sh.degree.min(view.degree);
            let seen = view.visible[seen.clone()].iter().zip(&view.directions[seen]);
            for (out, (&row, &direction)) in out.as_chunks_mut::<3>().0.iter_mut().zip(seen) {
                let at = row as usize * stride;
                let changed = changes.and_then(|changes| changes.of(row)).unwrap_or_default();
                let b = basis(degree, direction);
                *out = sum(&b, &sh.coefficients[at..at + stride], changed).map(|c| c.max(0.0));
            }
        });
    all
}

/// A part of the colours of a view.
struct ColoursOfPart<'a> {
    view: &'a PreparedView,
    /// Which of the visible Gaussians.
    seen: Range<usize>,
    out: &'a mut [f32],
}

/// `0.5 + sum over k of b[k] (coefficients[k] + changed[k])`, by colour; there may be fewer changes than coefficients.
#[inline(always)]
fn sum(b: &[f32; MAX_COEFFICIENTS], coefficients: &[f32], changed: &[f32]) -> [f32; 3] {
    let mut sum = [0.5f32; 3];
    let (both, plain) = coefficients.split_at(changed.len());
    let (both, changed, plain) = (
        both.as_chunks::<3>().0,
        changed.as_chunks::<3>().0,
        plain.as_chunks::<3>().0,
    );
    for (b, (h, o)) in b.iter().zip(both.iter().zip(changed)) {
        for j in 0..3 {
            sum[j] += b * (h[j] + o[j]);
        }
    }
    for (b, h) in b[both.len()..].iter().zip(plain) {
        for j in 0..3 {
            sum[j] += b * h[j];
        }
    }
    sum
}

/// Where rows `0..ROWS`, `ROWS..2 ROWS` and so on are in ascending rows.
fn parts(rows: &[u32]) -> impl Iterator<Item = Range<usize>> {
    let mut start = 0;
    (1..).map(move |part: usize| {
        let end = start + rows[start..].partition_point(|row| (*row as usize) < part * ROWS);
        std::mem::replace(&mut start, end)..end
    })
}

/// What a picture of a view says of its colours.
#[derive(Clone, Copy, Debug)]
pub struct ColourGradient<'a> {
    /// The view.
    pub view: &'a PreparedView,
    /// Its colours as [`colours`] returned them: where one is 0 it was clamped, and its gradient is 0.
    pub colours: &'a [f32],
    /// The gradient to them, `[visible][3]`.
    pub gradient: &'a [f32],
}

/// Adds to `out` (`[slots][columns]`) what a gradient to colours means for the learned coefficients.
pub fn backward(learnable: &Learnable, of_view: ColourGradient<'_>, out: &mut [f32]) {
    backward_of_views(learnable, &[of_view], out);
}

/// [`backward`] of each of some views, one after the other for every coefficient: sums in a fixed order.
pub fn backward_of_views(learnable: &Learnable, views: &[ColourGradient<'_>], out: &mut [f32]) {
    let columns = learnable.columns();
    let mut tasks = Vec::new();
    let mut rest = out;
    let mut first = 0;
    for slots in parts(learnable.rows()).take(learnable.gaussians().div_ceil(ROWS)) {
        let (out, after) = rest.split_at_mut(slots.len() * columns);
        rest = after;
        tasks.push((first, out, Vec::with_capacity(views.len())));
        first = slots.end;
    }
    for of_view in views {
        let seen = parts(&of_view.view.visible);
        tasks.iter_mut().zip(seen).for_each(|(task, seen)| task.2.push(seen));
    }
    tasks.into_par_iter().for_each(|(first, out, seen)| {
        for (of_view, seen) in views.iter().zip(seen) {
            of_view.add(learnable, seen, first, out);
        }
    });
}

impl ColourGradient<'_> {
    /// Of a range of the visible Gaussians; `out` starts at the slot `first`.
    fn add(&self, learnable: &Learnable, seen: Range<usize>, first: usize, out: &mut [f32]) {
        let (view, columns) = (self.view, learnable.columns());
        let degree = learnable.degree().min(view.degree);
        let (colours, gradients) = (self.colours.as_chunks::<3>().0, self.gradient.as_chunks::<3>().0);
        for i in seen {
            let mut g = [0.0f32; 3];
            for j in 0..3 {
                if colours[i][j] > 0.0 {
                    g[j] = gradients[i][j];
                }
            }
            if g == [0.0; 3] {
                continue;
            }
            let Some(slot) = learnable.slot(view.visible[i]) else {
                continue;
            };
            let b = basis(degree, view.directions[i]);
            let at = (slot - first) * columns;
            for (out, b) in out[at..at + columns].as_chunks_mut::<3>().0.iter_mut().zip(b) {
                for j in 0..3 {
                    out[j] += b * g[j];
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
