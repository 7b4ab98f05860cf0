//! Tables: what was measured, what the paper says of it, and what nobody measured yet.
mod cell;
mod grid;

pub use cell::Cell;
pub use grid::{Bar, Case, Layout, grid};

use serde::Serialize;

/// A table; all rows have a cell for each column.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Table {
    /// What it shows.
    pub title: String,
    /// Heads of the columns, with their units.
    pub columns: Vec<String>,
    /// Its rows.
    pub rows: Vec<Row>,
    /// How it is to be read, below it.
    pub notes: Vec<String>,
}

/// A row of a table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Whether it is part of the row above that is not.
    pub part: bool,
    /// Its cells.
    pub cells: Vec<Cell>,
}

impl Row {
    /// A row that stands for itself.
    pub fn new(cells: Vec<Cell>) -> Self {
        Self { part: false, cells }
    }
}
