//! Where a scene is solid and where it is free: a coarse grid of cells, and rays through it.
//!
//! The grid spans the middle 96 % of what the scene shows along each axis, with a margin, or as much as it is told, in cubes of
//! a 48th of its longest side. A cell is solid when Gaussians cover at least a quarter of one of its faces; each counts with its
//! opacity, spread over its two longer axes. Fields of a grid are coarse on purpose: a shell of several layers is one layer.
use super::extent::shortest_axis;
use super::quantiles::quantiles;
use super::vector::along;
use crate::scene::Gaussians;

/// Cells along the longest side.
const CELLS: f64 = 48.0;
/// Share of the weight that may lie beyond the grid at each end of an axis.
const BEYOND: f64 = 0.02;
/// Margin around what lies within, of the longest side.
const MARGIN: f64 = 0.06;
/// Share of a face that has to be covered.
const COVERED: f32 = 0.25;
/// Half the axes of a Gaussian that count, in standard deviations.
const REACH: f32 = 1.5;
/// Most points along an axis that stand for a Gaussian.
const MOST_POINTS: usize = 9;
/// A ray is looked at so often on its way through a cell.
const STEPS: f32 = 2.0;
/// More steps than the longest way through the grid has.
const MOST_STEPS: usize = 512;

/// Solid and free cells around a scene.
#[derive(Clone, Debug)]
pub(super) struct SolidGrid {
    low: [f32; 3],
    /// Side of a cell, world units.
    pub side: f32,
    pub counts: [usize; 3],
    solid: Vec<bool>,
}

impl SolidGrid {
    /// The grid of a scene whose Gaussians show so much (see [`super::extent`]).
    pub fn of(gaussians: &Gaussians, weights: &[f64]) -> Self {
        let ends: [[f64; 2]; 3] = std::array::from_fn(|k| {
            let values = gaussians.positions.iter().map(|p| f64::from(p[k]));
            quantiles(values, weights, [BEYOND, 1.0 - BEYOND])
        });
        let longest = ends.iter().map(|[low, high]| high - low).fold(0.0, f64::max);
        // A scene at one place has cells that hold its Gaussians.
        let size = |scales: &[f32; 3]| scales.iter().map(|s| f64::from(s.exp())).fold(0.0, f64::max);
        let [largest] = quantiles(gaussians.log_scales.iter().map(size), weights, [0.5]);
        let longest = (1.0 + 2.0 * MARGIN) * longest.max(largest).max(1e-6);
        Self::spanning(gaussians, ends, longest)
    }

    /// The grid of what is between two ends along each axis, world units.
    pub fn within(gaussians: &Gaussians, ends: [[f64; 2]; 3]) -> Self {
        let longest = ends.iter().map(|[low, high]| high - low).fold(1e-6, f64::max);
        Self::spanning(gaussians, ends, longest)
    }

    /// The grid of what is between two ends and a margin beyond them, whose cells are a part of `longest`.
    fn spanning(gaussians: &Gaussians, ends: [[f64; 2]; 3], longest: f64) -> Self {
        let side = longest / CELLS;
        let margin = MARGIN * longest;
        let mut grid = Self {
            low: ends.map(|[low, _]| (low - margin) as f32),
            side: side as f32,
            counts: ends
                .map(|[low, high]| ((high - low + 2.0 * margin) / side).ceil().clamp(1.0, 2.0 * CELLS) as usize),
            solid: Vec::new(),
        };
        let mut cover = vec![0.0f32; grid.counts.iter().product()];
        for row in 0..gaussians.len() {
            grid.add(gaussians, row, &mut cover);
        }
        grid.solid = cover.into_iter().map(|cover| cover >= COVERED).collect();
        grid
    }

    /// Adds what a Gaussian covers of the faces of cells.
    fn add(&self, gaussians: &Gaussians, row: usize, cover: &mut [f32]) {
        let opacity = gaussians.opacity(row);
        let scales = gaussians.log_scales[row].map(f32::exp);
        if !(opacity > 0.0 && scales.iter().all(|scale| scale.is_finite())) {
            return;
        }
        let (axes, short) = shortest_axis(gaussians, row);
        let [a, b] = [(short + 1) % 3, (short + 2) % 3];
        let points = [a, b].map(|axis| {
            let length = 2.0 * REACH * scales[axis];
            ((length / self.side).ceil() as usize).clamp(1, MOST_POINTS)
        });
        let step: [f32; 2] = std::array::from_fn(|k| 2.0 * REACH / points[k] as f32);
        let area = (step[0] * scales[a] * step[1] * scales[b] / (self.side * self.side)).min(1.0);
        for i in 0..points[0] {
            for j in 0..points[1] {
                let at = [(i, 0), (j, 1)].map(|(index, k): (usize, usize)| (index as f32 + 0.5) * step[k] - REACH);
                let place = along(gaussians.positions[row], at[0] * scales[a], axes[a]);
                let place = along(place, at[1] * scales[b], axes[b]);
                if let Some(cell) = self.cell(place) {
                    cover[cell] += opacity * (-0.5 * (at[0] * at[0] + at[1] * at[1])).exp() * area;
                }
            }
        }
    }

    /// The number of the cell that a place is in; none outside the grid.
    pub fn cell(&self, place: [f32; 3]) -> Option<usize> {
        let mut number = 0;
        for k in (0..3).rev() {
            let along = (place[k] - self.low[k]) / self.side;
            if !(along >= 0.0 && along < self.counts[k] as f32) {
                return None;
            }
            // The conversion rounds down.
            number = number * self.counts[k] + along as u32 as usize;
        }
        Some(number)
    }

    /// The three numbers of a cell.
    pub fn numbers(&self, cell: usize) -> [usize; 3] {
        let [x, y, _] = self.counts;
        [cell % x, cell / x % y, cell / (x * y)]
    }

    /// The middle of a cell.
    pub fn middle(&self, cell: usize) -> [f32; 3] {
        let numbers = self.numbers(cell);
        std::array::from_fn(|k| self.low[k] + (numbers[k] as f32 + 0.5) * self.side)
    }

    /// How many cells there are.
    pub fn len(&self) -> usize {
        self.solid.len()
    }

    /// Whether a cell is free.
    pub fn is_free(&self, cell: usize) -> bool {
        !self.solid[cell]
    }

    /// How far it is from a place to what is solid, world units; the first `skipped` cells are not looked at. None where the
    /// ray leaves the grid.
    pub fn way(&self, from: [f32; 3], direction: [f32; 3], skipped: f32) -> Option<f32> {
        // Bounded, because steps may be lost in the rounding of places that are far from the origin.
        for step in 0..MOST_STEPS {
            let distance = (skipped + step as f32 / STEPS) * self.side;
            let cell = self.cell(along(from, distance, direction))?;
            if self.solid[cell] {
                return Some(distance);
            }
        }
        None
    }

    /// Distance of every cell to the nearest solid one, in cells with corners counted as neighbours; 0 for solid ones.
    pub fn clearances(&self) -> Vec<u32> {
        let mut clearance = vec![u32::MAX; self.len()];
        let mut front: Vec<usize> = (0..self.len()).filter(|cell| self.solid[*cell]).collect();
        front.iter().for_each(|cell| clearance[*cell] = 0);
        let mut distance = 0;
        while !front.is_empty() {
            distance += 1;
            let mut next = Vec::new();
            for cell in front {
                self.neighbours(cell, |neighbour| {
                    if clearance[neighbour] == u32::MAX {
                        clearance[neighbour] = distance;
                        next.push(neighbour);
                    }
                });
            }
            front = next;
        }
        clearance
    }

    fn neighbours(&self, cell: usize, mut each: impl FnMut(usize)) {
        let ranges: [std::ops::RangeInclusive<usize>; 3] = {
            let numbers = self.numbers(cell);
            std::array::from_fn(|k| numbers[k].saturating_sub(1)..=(numbers[k] + 1).min(self.counts[k] - 1))
        };
        let [width, height, _] = self.counts;
        for z in ranges[2].clone() {
            for y in ranges[1].clone() {
                for x in ranges[0].clone() {
                    each((z * height + y) * width + x);
                }
            }
        }
    }
}
