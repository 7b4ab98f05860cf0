//! The gradient from colours to the coefficients that are learned, sixteen Gaussians side by side where enough are seen.
use rayon::prelude::*;
use std::ops::Range;

use super::lanes::{LANES, Lanes, Number};
use super::{MAX_COEFFICIENTS, ROWS, WORTH_LANES, basis, basis_of, below, parts, terms};
use crate::simd::{Instructions, Vectorised};
use crate::splat::{Learnable, PreparedView};

/// What a picture of a view says of its colours.
#[derive(Clone, Copy, Debug)]
pub struct ColourGradient<'a> {
    /// The view.
    pub view: &'a PreparedView,
    /// Its colours as [`super::colours`] returned them: where one is 0 it was clamped, and its gradient is 0.
    pub colours: &'a [f32],
    /// The gradient to them, `[visible][3]`.
    pub gradient: &'a [f32],
}

/// Adds to `out` (`[slots][columns]`) what a gradient to colours means for the learned coefficients.
pub fn backward(learnable: &Learnable, of_view: ColourGradient<'_>, out: &mut [f32]) {
    backward_of_views(learnable, &[of_view], out);
}

/// [`backward`] of some views: sums in a fixed order, view by view for every coefficient.
pub fn backward_of_views(learnable: &Learnable, views: &[ColourGradient<'_>], out: &mut [f32]) {
    let (columns, gaussians) = (learnable.columns(), learnable.gaussians());
    let mut tasks = Vec::new();
    let mut rest = out;
    let mut first_slot = 0;
    for (task, slots) in parts(learnable.rows()).take(gaussians.div_ceil(ROWS)).enumerate() {
        let (out, after) = rest.split_at_mut(slots.len() * columns);
        rest = after;
        tasks.push(Task {
            learnable,
            rows: task * ROWS..gaussians.min((task + 1) * ROWS),
            views: Vec::with_capacity(views.len()),
            first_slot,
            out,
        });
        first_slot = slots.end;
    }
    for of_view in views {
        let (colours, gradient) = (of_view.colours.as_chunks::<3>().0, of_view.gradient.as_chunks::<3>().0);
        for (task, seen) in tasks.iter_mut().zip(parts(&of_view.view.visible)) {
            task.views.push(Part {
                degree: learnable.degree().min(of_view.view.degree),
                rows: &of_view.view.visible[seen.clone()],
                directions: &of_view.view.directions[seen.clone()],
                colours: &colours[seen.clone()],
                gradient: &gradient[seen],
            });
        }
    }
    let instructions = Instructions::widest();
    tasks.into_par_iter().for_each(|task| instructions.run(task));
}

/// What a picture says of the colours of some rows.
struct Part<'a> {
    degree: usize,
    rows: &'a [u32],
    directions: &'a [[f32; 3]],
    colours: &'a [[f32; 3]],
    gradient: &'a [[f32; 3]],
}

impl<'a> Part<'a> {
    /// Takes the first `count` Gaussians off.
    #[inline(always)]
    fn take(&mut self, count: usize) -> Part<'a> {
        let (first, later) = self.split(count);
        *self = later;
        first
    }

    #[inline(always)]
    fn split(&self, count: usize) -> (Part<'a>, Part<'a>) {
        let part = |range: Range<usize>| Part {
            degree: self.degree,
            rows: &self.rows[range.clone()],
            directions: &self.directions[range.clone()],
            colours: &self.colours[range.clone()],
            gradient: &self.gradient[range],
        };
        (part(0..count), part(count..self.rows.len()))
    }

    /// The gradient to a colour, 0 where that was clamped.
    #[inline(always)]
    fn unclamped(&self, i: usize) -> [f32; 3] {
        let mut g = [0.0f32; 3];
        for j in 0..3 {
            if self.colours[i][j] > 0.0 {
                g[j] = self.gradient[i][j];
            }
        }
        g
    }

    /// Adds one after the other to `out`, which starts at the slot `first`.
    #[inline(always)]
    fn one_by_one(&self, learnable: &Learnable, first: usize, out: &mut [f32]) {
        let columns = learnable.columns();
        for (i, row) in self.rows.iter().enumerate() {
            let g = self.unclamped(i);
            if g == [0.0; 3] {
                continue;
            }
            let Some(slot) = learnable.slot(*row) else {
                continue;
            };
            let b = basis(self.degree, self.directions[i]);
            let out = &mut out[(slot - first) * columns..][..columns];
            for (out, b) in out.as_chunks_mut::<3>().0.iter_mut().zip(b) {
                for j in 0..3 {
                    out[j] += b * g[j];
                }
            }
        }
    }

    /// Adds side by side, to what is of the rows from `first` on.
    #[inline(always)]
    fn side_by_side(&self, first: usize, out: &mut [Lanes; 3 * MAX_COEFFICIENTS]) {
        let (mut direction, mut g) = ([Lanes::of(0.0); 3], [Lanes::of(0.0); 3]);
        for (i, row) in self.rows.iter().enumerate() {
            let (lane, of_row) = ((*row as usize - first) % LANES, self.unclamped(i));
            for j in 0..3 {
                direction[j].0[lane] = self.directions[i][j];
                g[j].0[lane] = of_row[j];
            }
        }
        let b = basis_of(self.degree, direction);
        for (out, b) in out.as_chunks_mut::<3>().0.iter_mut().zip(b).take(terms(self.degree)) {
            for j in 0..3 {
                out[j] = out[j] + b * g[j];
            }
        }
    }
}

/// The gradient of some rows in all views.
struct Task<'a> {
    learnable: &'a Learnable,
    rows: Range<usize>,
    views: Vec<Part<'a>>,
    /// Slot that `out` starts at.
    first_slot: usize,
    out: &'a mut [f32],
}

impl Task<'_> {
    /// Adds sums of the rows from `first` on.
    #[inline(always)]
    fn add(&mut self, first: usize, end: usize, sums: &[Lanes; 3 * MAX_COEFFICIENTS]) {
        let columns = self.learnable.columns();
        for (i, row) in (first..end).enumerate() {
            if let Some(slot) = self.learnable.slot(row as u32) {
                let out = &mut self.out[(slot - self.first_slot) * columns..][..columns];
                for (out, sum) in out.iter_mut().zip(sums) {
                    *out += sum.0[i % LANES];
                }
            }
        }
    }
}

impl Vectorised for Task<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(mut self) {
        let mut sums = [Lanes::of(0.0); 3 * MAX_COEFFICIENTS];
        for first in self.rows.clone().step_by(LANES) {
            let end = self.rows.end.min(first + LANES);
            let seen: usize = self.views.iter().map(|view| below(view.rows, end)).sum();
            let lanes = seen >= WORTH_LANES;
            if lanes {
                sums[..self.learnable.columns()].fill(Lanes::of(0.0));
            }
            for view in &mut self.views {
                let part = view.take(below(view.rows, end));
                match (part.rows.is_empty(), lanes) {
                    (true, _) => {}
                    (false, true) => part.side_by_side(first, &mut sums),
                    (false, false) => part.one_by_one(self.learnable, self.first_slot, self.out),
                }
            }
            if lanes {
                self.add(first, end, &sums);
            }
        }
    }
}
