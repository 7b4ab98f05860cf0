//! Which coefficients are learned: those of Gaussians that views show, up to a degree.
use crate::scene::Gaussians;

/// Slot of a Gaussian that is not learned.
const NONE: u32 = u32::MAX;

/// Numbers for the learned coefficients of a scene are kept in *slots*, one a learned Gaussian, in the order of rows;
/// a slot has `3 (degree + 1)^2` numbers, laid out as a row of [`Sh`](crate::scene::Sh). All others take no memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Learnable {
    /// Slot of each Gaussian of the scene, ascending, or [`NONE`].
    slots: Vec<u32>,
    /// Row of each slot.
    rows: Vec<u32>,
    degree: usize,
}

impl Learnable {
    /// Learns the Gaussians that are `seen`, up to `degree` of their coefficients.
    pub fn new(seen: &[bool], degree: usize) -> Self {
        let mut slots = vec![NONE; seen.len()];
        let mut rows = Vec::with_capacity(seen.iter().filter(|seen| **seen).count());
        for (row, slot) in slots.iter_mut().enumerate().filter(|(row, _)| seen[*row]) {
            *slot = rows.len() as u32;
            rows.push(row as u32);
        }
        Self { slots, rows, degree }
    }

    /// All coefficients of all Gaussians.
    pub fn all(gaussians: &Gaussians) -> Self {
        Self::new(&vec![true; gaussians.len()], gaussians.sh.degree)
    }

    /// The highest degree that is learned.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// Numbers of a slot.
    pub fn columns(&self) -> usize {
        3 * (self.degree + 1) * (self.degree + 1)
    }

    /// Rows of the learned Gaussians, ascending: slot `i` is Gaussian `rows()[i]`.
    pub fn rows(&self) -> &[u32] {
        &self.rows
    }

    /// Numbers of all slots.
    pub fn len(&self) -> usize {
        self.rows.len() * self.columns()
    }

    /// Whether nothing is learned.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Gaussians of the scene, learned or not.
    pub fn gaussians(&self) -> usize {
        self.slots.len()
    }

    /// Slot of Gaussian `row`, if it is learned.
    #[inline(always)]
    pub fn slot(&self, row: u32) -> Option<usize> {
        let slot = self.slots[row as usize];
        (slot != NONE).then_some(slot as usize)
    }
}

/// Learned changes of coefficients, `[slots][columns]`.
#[derive(Clone, Copy, Debug)]
pub struct Changes<'a> {
    /// Whose they are.
    pub learnable: &'a Learnable,
    /// What is added to the scene's coefficients.
    pub values: &'a [f32],
}

impl<'a> Changes<'a> {
    /// The changes of Gaussian `row`, if it is learned.
    #[inline(always)]
    pub fn of(&self, row: u32) -> Option<&'a [f32]> {
        let columns = self.learnable.columns();
        let slot = self.learnable.slot(row)?;
        Some(&self.values[slot * columns..(slot + 1) * columns])
    }
}
