//! Where a PLY has its Gaussians, checked against the size of the file before anything is allocated.
use super::header::{Storage, element, scalars, storage};
use crate::fields::Fields;
use crate::fields::bytes;
use ply_rs::ply::Header;

/// What the header says of the Gaussians.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    /// How rows are stored.
    pub storage: Storage,
    /// Bytes (binary) or lines (ASCII) of the body before the first Gaussian.
    pub skip: u64,
    /// Gaussians that the header promises.
    pub rows: u64,
    /// Bytes of a binary row.
    pub row_bytes: usize,
    /// Properties of a row.
    pub columns: usize,
    /// Which of them are used, and where they are.
    pub fields: Fields,
}

impl Layout {
    /// Finds the Gaussians; `Err` is the reason why not.
    pub fn find(header: &Header) -> Result<Layout, String> {
        let (vertex, skip) = element(header, "vertex")?;
        let columns = scalars(vertex)?;
        let fields = Fields::find(&columns)?;
        Ok(Layout {
            storage: storage(header),
            skip,
            rows: vertex.count as u64,
            row_bytes: columns.iter().map(|(_, t)| bytes(t)).sum(),
            columns: columns.len(),
            fields,
        })
    }

    /// Compares the counts with the bytes after the header, before anything is allocated; `Err` is the reason.
    pub fn check_size(&self, body: u64) -> Result<(), String> {
        // The shortest row of text has a digit a value and a separator after each but the very last.
        let (row, slack) = match self.storage {
            Storage::Binary { .. } => (self.row_bytes as u64, 0),
            Storage::Ascii => (2 * self.columns as u64, 1),
        };
        let skip = if self.storage == Storage::Ascii { 0 } else { self.skip };
        let there = (body + slack).saturating_sub(skip) / row;
        if there < self.rows || body < skip {
            let rows = self.rows;
            return Err(match self.storage {
                Storage::Binary { .. } => truncated(there, rows),
                Storage::Ascii => {
                    format!("truncated body: {body} bytes cannot hold the {rows} Gaussians that the header promises")
                }
            });
        }
        Ok(())
    }
}

/// The complaint about missing rows.
pub(super) fn truncated(there: u64, promised: u64) -> String {
    format!("truncated body: {there} of the {promised} Gaussians that the header promises are there")
}
