//! Where a compressed PLY has its chunks, Gaussians and spherical harmonics, checked against the size of the file.
use super::CHUNK;
use crate::MAX_DEGREE;
use crate::fields::rest_count;
use crate::fields::{bytes, quote};
use crate::ply::header::{Storage, element, scalars, storage};
use ply_rs::ply::{Header, ScalarType};

/// The ranges of a chunk's positions and log scales: minima, then maxima.
pub(crate) const GEOMETRY: [&str; 12] = [
    "min_x",
    "min_y",
    "min_z",
    "max_x",
    "max_y",
    "max_z",
    "min_scale_x",
    "min_scale_y",
    "min_scale_z",
    "max_scale_x",
    "max_scale_y",
    "max_scale_z",
];
/// The ranges of a chunk's colours, which files of older writers have not.
pub(crate) const COLOUR: [&str; 6] = ["min_r", "min_g", "min_b", "max_r", "max_g", "max_b"];
/// The words of a Gaussian.
pub(crate) const WORDS: [&str; 4] = ["packed_position", "packed_rotation", "packed_scale", "packed_color"];

/// Rows of fixed size in the body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Table {
    /// Its first byte.
    pub start: usize,
    /// Bytes of a row.
    pub row: usize,
    /// How many rows.
    pub count: usize,
}

impl Table {
    /// The rows; the body was checked to have them.
    pub fn rows<'a>(&self, body: &'a [u8]) -> std::slice::ChunksExact<'a, u8> {
        body[self.start..self.start + self.row * self.count].chunks_exact(self.row)
    }

    /// The same, for changes.
    pub fn rows_mut<'a>(&self, body: &'a mut [u8]) -> std::slice::ChunksExactMut<'a, u8> {
        body[self.start..self.start + self.row * self.count].chunks_exact_mut(self.row)
    }

    /// The byte after its last row, if it lies within what a file can have.
    fn end(&self) -> Option<usize> {
        self.row.checked_mul(self.count)?.checked_add(self.start)
    }
}

/// What the header says. Columns are the first bytes of properties within their rows.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    /// Element chunk; it may have more rows than are needed.
    pub chunks: Table,
    /// Columns of [`GEOMETRY`].
    pub geometry: [usize; 12],
    /// Columns of [`COLOUR`].
    pub colour: Option<[usize; 6]>,
    /// Element vertex.
    pub gaussians: Table,
    /// Columns of the packed position, rotation, scale and colour.
    pub words: [usize; 4],
    /// Element sh, with as many rows as vertex; columns of `f_rest_0` and so on.
    pub rest: Option<(Table, Vec<usize>)>,
    /// Degree of the spherical harmonics that the file has room for.
    pub degree: usize,
}

impl Layout {
    /// Finds everything; `Err` is what is missing or wrong.
    pub fn find(header: &Header) -> Result<Layout, String> {
        if storage(header) != (Storage::Binary { big_endian: false }) {
            return Err("a compressed PLY (property packed_position) must be binary_little_endian".to_string());
        }
        let chunk = Columns::find(header, "chunk")?;
        let geometry = chunk.all(&GEOMETRY, &ScalarType::Float)?;
        let colour = if COLOUR.iter().any(|name| chunk.has(name)) {
            Some(chunk.all(&COLOUR, &ScalarType::Float)?)
        } else {
            None
        };
        let vertex = Columns::find(header, "vertex")?;
        let words = vertex.all(&WORDS, &ScalarType::UInt)?;
        let (chunks, gaussians) = (chunk.table, vertex.table);
        let needed = gaussians.count.div_ceil(CHUNK);
        if chunks.count < needed {
            return Err(format!(
                "element chunk has {} rows of {CHUNK} Gaussians each; the {} of element vertex need {needed}",
                chunks.count, gaussians.count
            ));
        }
        // gsplat writes the element without a property where there is nothing in it.
        let has_rest = header.elements.get("sh").is_some_and(|sh| !sh.properties.is_empty());
        let (degree, rest) = match has_rest {
            true => {
                let (degree, rest) = find_rest(header, gaussians.count)?;
                (degree, Some(rest))
            }
            false => (0, None),
        };
        Ok(Layout {
            chunks,
            geometry,
            colour,
            gaussians,
            words,
            rest,
            degree,
        })
    }

    /// Compares the counts with the bytes after the header, before anything is allocated; `Err` is the reason.
    pub fn check_size(&self, body: u64) -> Result<(), String> {
        let tables = [("chunk", Some(&self.chunks)), ("vertex", Some(&self.gaussians))];
        let sh = ("sh", self.rest.as_ref().map(|(table, _)| table));
        for (name, table) in tables.into_iter().chain([sh]) {
            let Some(table) = table else { continue };
            if table.end().is_none_or(|end| body < end as u64) {
                let there = body.saturating_sub(table.start as u64) / table.row as u64;
                return Err(format!(
                    "truncated body: {there} of the {} rows of element {name} that the header promises are there",
                    table.count
                ));
            }
        }
        Ok(())
    }
}

/// Degree and place of element sh.
fn find_rest(header: &Header, rows: usize) -> Result<(usize, (Table, Vec<usize>)), String> {
    let sh = Columns::find(header, "sh")?;
    if sh.table.count != rows {
        return Err(format!("element sh has {} rows, element vertex {rows}", sh.table.count));
    }
    let rest = sh
        .columns
        .iter()
        .filter(|(name, ..)| name.starts_with("f_rest_"))
        .count();
    let degree = (1..=MAX_DEGREE)
        .find(|degree| rest_count(*degree) == rest)
        .ok_or_else(|| format!("{rest} f_rest properties fit no degree of spherical harmonics; 9, 24, 45 or 72 do"))?;
    let columns: Result<Vec<_>, _> = (0..rest)
        .map(|i| sh.one(&format!("f_rest_{i}"), &ScalarType::UChar))
        .collect();
    Ok((degree, (sh.table, columns?)))
}

/// The properties of an element.
struct Columns<'a> {
    element: &'a str,
    table: Table,
    /// Names, types and first bytes.
    columns: Vec<(&'a str, &'a ScalarType, usize)>,
}

impl<'a> Columns<'a> {
    fn find(header: &'a Header, name: &'a str) -> Result<Columns<'a>, String> {
        let (found, start) = element(header, name).map_err(|e| format!("a compressed PLY, but {e}"))?;
        let mut row = 0;
        let mut columns = Vec::new();
        for (property, kind) in scalars(found)? {
            columns.push((property, kind, row));
            row += bytes(kind);
        }
        let start = usize::try_from(start).map_err(|_| format!("element {name} starts at byte {start}"))?;
        let count = found.count;
        let table = Table { start, row, count };
        Ok(Columns {
            element: name,
            table,
            columns,
        })
    }

    fn has(&self, name: &str) -> bool {
        self.columns.iter().any(|(other, ..)| *other == name)
    }

    /// The first byte of a property.
    fn one(&self, name: &str, kind: &ScalarType) -> Result<usize, String> {
        let element = self.element;
        match self.columns.iter().find(|(other, ..)| *other == name) {
            Some((_, other, start)) if *other == kind => Ok(*start),
            Some((_, other, _)) => Err(format!(
                "property {} of element {element} is {other:?}, must be {kind:?}",
                quote(name)
            )),
            None => Err(format!(
                "a compressed PLY, but element {element} has no property {name}"
            )),
        }
    }

    fn all<const N: usize>(&self, names: &[&str; N], kind: &ScalarType) -> Result<[usize; N], String> {
        let mut starts = [0; N];
        for (start, name) in starts.iter_mut().zip(names) {
            *start = self.one(name, kind)?;
        }
        Ok(starts)
    }
}
