//! Colours of what views show, sixteen Gaussians side by side where enough of them are seen.
use rayon::prelude::*;
use std::ops::Range;

use super::lanes::{LANES, Lanes, Number};
use super::{MAX_COEFFICIENTS, ROWS, WORTH_LANES, basis, basis_of, below, parts, terms};
use crate::scene::Sh;
use crate::simd::{Instructions, Vectorised};
use crate::splat::{Changes, PreparedView};

/// Colours of the visible Gaussians of `view`, `[visible][3]`: `max(0, SH(direction) + 0.5)`.
///
/// `changes` are added to the coefficients first; bands above the view's degree are left out. `view` must have been prepared
/// from a scene of as many Gaussians as `sh` has.
pub fn colours(sh: &Sh, changes: Option<Changes<'_>>, view: &PreparedView) -> Vec<f32> {
    colours_of_views(sh, changes, &[view]).pop().unwrap_or_default()
}

/// [`colours`] of each of some views.
pub fn colours_of_views(sh: &Sh, changes: Option<Changes<'_>>, views: &[&PreparedView]) -> Vec<Vec<f32>> {
    let gaussians = sh.coefficients.len() / sh.per_gaussian();
    let mut all: Vec<Vec<f32>> = views.iter().map(|view| vec![0.0; view.visible.len() * 3]).collect();
    let mut tasks: Vec<Vec<Part<'_>>> = Vec::new();
    tasks.resize_with(gaussians.div_ceil(ROWS), Vec::new);
    for (view, out) in views.iter().zip(&mut all) {
        let mut rest = out.as_chunks_mut::<3>().0;
        for (task, seen) in tasks.iter_mut().zip(parts(&view.visible)) {
            let (out, after) = std::mem::take(&mut rest).split_at_mut(seen.len());
            rest = after;
            task.push(Part {
                degree: sh.degree.min(view.degree),
                rows: &view.visible[seen.clone()],
                directions: &view.directions[seen],
                out,
            });
        }
    }
    let instructions = Instructions::widest();
    tasks.into_par_iter().enumerate().for_each(|(task, views)| {
        let first = task * ROWS;
        let rows = first..gaussians.min(first + ROWS);
        let of = Coefficients { sh, changes };
        instructions.run(Task { of, rows, views });
    });
    all
}

/// What a view shows of some rows.
struct Part<'a> {
    degree: usize,
    rows: &'a [u32],
    directions: &'a [[f32; 3]],
    /// Their colours.
    out: &'a mut [[f32; 3]],
}

impl<'a> Part<'a> {
    /// Takes the first `count` Gaussians off.
    #[inline(always)]
    fn take(&mut self, count: usize) -> Part<'a> {
        let (rows, later_rows) = self.rows.split_at(count);
        let (directions, later_directions) = self.directions.split_at(count);
        let (out, later_out) = std::mem::take(&mut self.out).split_at_mut(count);
        (self.rows, self.directions, self.out) = (later_rows, later_directions, later_out);
        Part {
            degree: self.degree,
            rows,
            directions,
            out,
        }
    }

    /// One after the other.
    #[inline(always)]
    fn one_by_one(self, of: Coefficients<'_>) {
        for ((row, direction), out) in self.rows.iter().zip(self.directions).zip(self.out) {
            let (plain, changed) = of.row(*row as usize);
            *out = sum(&basis(self.degree, *direction), plain, changed).map(|c| c.max(0.0));
        }
    }

    /// Side by side, of coefficients from row `first` on.
    #[inline(always)]
    fn side_by_side(self, first: usize, coefficients: &[Lanes; 3 * MAX_COEFFICIENTS]) {
        let mut direction = [Lanes::of(0.0); 3];
        for (row, of_row) in self.rows.iter().zip(self.directions) {
            for j in 0..3 {
                direction[j].0[(*row as usize - first) % LANES] = of_row[j];
            }
        }
        let b = basis_of(self.degree, direction);
        let mut sum = [Lanes::of(0.5); 3];
        let coefficients = coefficients.as_chunks::<3>().0;
        for (b, coefficients) in b.iter().zip(coefficients).take(terms(self.degree)) {
            for j in 0..3 {
                sum[j] = sum[j] + *b * coefficients[j];
            }
        }
        for j in 0..3 {
            for i in 0..LANES {
                sum[j].0[i] = sum[j].0[i].max(0.0);
            }
        }
        for (row, out) in self.rows.iter().zip(self.out) {
            for j in 0..3 {
                out[j] = sum[j].0[(*row as usize - first) % LANES];
            }
        }
    }
}

/// Coefficients with what is added to them.
#[derive(Clone, Copy)]
struct Coefficients<'a> {
    sh: &'a Sh,
    changes: Option<Changes<'a>>,
}

impl<'a> Coefficients<'a> {
    /// Those of a row, and what is added to the first of them.
    #[inline(always)]
    fn row(&self, row: usize) -> (&'a [f32], &'a [f32]) {
        let stride = self.sh.per_gaussian();
        let changed = self.changes.and_then(|changes| changes.of(row as u32));
        let plain = &self.sh.coefficients[row * stride..][..stride];
        (plain, changed.unwrap_or_default())
    }

    /// Puts those of some rows side by side, with what is added.
    #[inline(always)]
    fn put_side_by_side(&self, rows: Range<usize>, out: &mut [Lanes; 3 * MAX_COEFFICIENTS]) {
        for (i, row) in rows.enumerate().take(LANES) {
            let (plain, changed) = self.row(row);
            let (both, rest) = plain.split_at(changed.len());
            let (out_both, out_rest) = out.split_at_mut(changed.len());
            for (out, (plain, changed)) in out_both.iter_mut().zip(both.iter().zip(changed)) {
                out.0[i] = plain + changed;
            }
            for (out, plain) in out_rest.iter_mut().zip(rest) {
                out.0[i] = *plain;
            }
        }
    }
}

/// Colours of some rows in all views.
struct Task<'a> {
    of: Coefficients<'a>,
    rows: Range<usize>,
    views: Vec<Part<'a>>,
}

impl Vectorised for Task<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(mut self) {
        let mut coefficients = [Lanes::of(0.0); 3 * MAX_COEFFICIENTS];
        for first in self.rows.clone().step_by(LANES) {
            let end = self.rows.end.min(first + LANES);
            let seen: usize = self.views.iter().map(|view| below(view.rows, end)).sum();
            let lanes = seen >= WORTH_LANES;
            if lanes {
                self.of.put_side_by_side(first..end, &mut coefficients);
            }
            for view in &mut self.views {
                let part = view.take(below(view.rows, end));
                match (part.rows.is_empty(), lanes) {
                    (true, _) => {}
                    (false, true) => part.side_by_side(first, &coefficients),
                    (false, false) => part.one_by_one(self.of),
                }
            }
        }
    }
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
