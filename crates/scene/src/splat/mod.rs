//! Files of 32 bytes a Gaussian without a header, as antimatter15's viewer reads them (.splat).
//!
//! Position and standard deviations in single precision, colour and opacity as four bytes, a unit quaternion w, x, y, z
//! as four. There are no spherical harmonics beyond the constant one.
use crate::Result;
use crate::container::{Container, Format};
use crate::error::{UNKNOWN, bad};
use crate::fields::Rows;
use crate::gaussians::{Gaussians, Sh};
use crate::ignored::{BadRows, Ignored};
use crate::range::{Range, logit};
use crate::remaining::read_remaining;
use crate::summary::Summary;
use std::io::{self, BufReader, Read, Write};
use std::path::Path;
use std::sync::Arc;

/// Bytes of a Gaussian.
pub(crate) const ROW: usize = 32;
/// First byte of the colour of a row.
const COLOUR: usize = 24;
/// How far the length of a rotation may be from 1. Its bytes make up for 0.02, other conventions for rounding as much.
const UNIT: f32 = 0.1;

/// A file as it was read.
#[derive(Debug)]
struct Splat {
    body: Vec<u8>,
    ignored: Ignored,
}

/// Reads a file of `size` bytes from its first; `path` is for messages. The reason of a refusal continues a sentence
/// that says what else the file is not.
///
/// Nothing in a file says that it is one, so it must look like one to be read: a whole number of rows, at least one;
/// and at least half of them with a position that is finite, standard deviations that are finite and not negative, and
/// a rotation of length 1, which writers make them, unless they are [balls](is_ball). Zeros, text, pictures and noise fail that.
/// Rows whose numbers are not such are bad even there.
pub(crate) fn read(
    path: &Path,
    source: &mut BufReader<impl Read>,
    size: u64,
    bad_rows: BadRows,
) -> Result<(Gaussians, Arc<dyn Container>)> {
    let refused = |reason| bad(path, format!("{}{reason}", UNKNOWN));
    check_size(size).map_err(refused)?;
    let body = read_remaining(path, source, size)?;
    // Again, since a file can shrink between the look at its size and the read.
    check_size(body.len() as u64).map_err(refused)?;
    let (gaussians, ignored) = decode(&body, bad_rows).map_err(refused)?;
    Ok((gaussians, Arc::new(Splat { body, ignored })))
}

/// What the head of a file of `size` bytes says: half of its rows must look like Gaussians, as half of all must when it
/// is read. `Err` is the reason for which it is none.
pub(crate) fn summary(head: &[u8], size: u64) -> Result<Summary, String> {
    let rows = &head[..head.len() / ROW * ROW];
    check_size(size)
        .and_then(|()| check_rows(rows))
        .map_err(|reason| format!("{UNKNOWN}{reason}"))?;
    Ok(Summary {
        format: Format::Splat,
        gaussians: size / ROW as u64,
        degree: 0,
        file: size,
    })
}

/// Whether a file of `size` bytes that begins with `head` may be one: at least one row is there, and half of them look
/// like it. Bad ones among them are for the reader to tell of.
pub(crate) fn looks_like(head: &[u8], size: u64) -> bool {
    let rows = &head[..head.len() - head.len() % ROW];
    check_size(size).is_ok() && !rows.is_empty() && check_rows(rows).is_ok()
}

fn check_size(size: u64) -> Result<(), String> {
    if size == 0 {
        return Err("it is empty".to_string());
    }
    if !size.is_multiple_of(ROW as u64) {
        return Err(format!("its size of {size} bytes is no multiple of {ROW}"));
    }
    Ok(())
}

fn decode(body: &[u8], bad_rows: BadRows) -> Result<(Gaussians, Ignored), String> {
    check_rows(body)?;
    let mut collected = Rows::with_capacity(0, 0, body.len() / ROW, bad_rows);
    for (i, row) in body.chunks_exact(ROW).enumerate() {
        if let Some(fault) = fault(row) {
            collected.reject(|| fault.of_row(i))?;
            continue;
        }
        let [x, y, z, a, b, c] = floats(row);
        let [w, i, j, k] = rotation(row);
        let log = |scale: f32| f64::from(scale).ln() as f32;
        let [red, green, blue] = [0, 1, 2].map(|channel| Range::UNIT.coefficient(row[COLOUR + channel]));
        let (a, b, c, alpha) = (log(a), log(b), log(c), logit(row[COLOUR + 3]));
        collected.push(&[x, y, z, w, i, j, k, a, b, c, alpha, red, green, blue])?;
    }
    Ok(collected.finish())
}

/// Whether enough rows are Gaussians; see [`read`].
fn check_rows(body: &[u8]) -> Result<(), String> {
    let (mut units, mut first) = (0, None);
    for (i, row) in body.chunks_exact(ROW).enumerate() {
        if let Some(fault) = fault(row) {
            first = first.or(Some((i, fault)));
            continue;
        }
        let length = rotation(row).iter().map(|v| v * v).sum::<f32>().sqrt();
        units += usize::from((length - 1.0).abs() <= UNIT || is_ball(row));
    }
    let rows = body.len() / ROW;
    if units >= rows.div_ceil(2) {
        return Ok(());
    }
    Err(match first {
        Some((i, fault)) => fault.of_row(i),
        None => format!("only {units} of {rows} rows have a rotation of length 1 or are balls"),
    })
}

/// Whether a row is as large along all axes, so that its rotation means nothing: programs that make splats of point clouds write
/// any. Its place must be other numbers than its size, as a repeated byte's are not.
fn is_ball(row: &[u8]) -> bool {
    let [x, y, z, a, b, c] = floats(row);
    a > 0.0 && a == b && b == c && [x, y, z] != [a; 3]
}

/// A number of a row that can't be: which of [`floats`], and what it is.
#[derive(Clone, Copy)]
struct Fault(usize, f32);

impl Fault {
    fn of_row(self, row: usize) -> String {
        let Fault(place, value) = self;
        match ["x", "y", "z"].get(place) {
            Some(axis) => format!("{axis} of row {row} is {value}"),
            None => format!("the scale of row {row} along axis {} is {value}", place - 3),
        }
    }
}

/// The first number of a row that can't be.
fn fault(row: &[u8]) -> Option<Fault> {
    let can_be = |place: usize, value: f32| value.is_finite() && (place < 3 || value >= 0.0);
    let mut values = floats(row).into_iter().enumerate();
    values
        .find(|(place, value)| !can_be(*place, *value))
        .map(|(place, value)| Fault(place, value))
}

/// The numbers at the start of a row: position, standard deviations.
fn floats(row: &[u8]) -> [f32; 6] {
    std::array::from_fn(|i| {
        let mut bytes = [0; 4];
        bytes.copy_from_slice(&row[4 * i..4 * i + 4]);
        f32::from_le_bytes(bytes)
    })
}

/// The quaternion at the end of a row.
fn rotation(row: &[u8]) -> [f32; 4] {
    std::array::from_fn(|i| (f32::from(row[28 + i]) - 128.0) / 128.0)
}

impl Container for Splat {
    fn format(&self) -> Format {
        Format::Splat
    }

    fn bytes(&self) -> usize {
        self.body.len()
    }

    fn exact(&self) -> bool {
        false
    }

    fn quantize_colors(&self, _row: usize, coefficients: &mut [f32]) {
        for value in coefficients {
            *value = Range::UNIT.coefficient(Range::UNIT.nearest(*value));
        }
    }

    fn ignored(&self) -> Option<&Ignored> {
        self.ignored.if_any()
    }

    fn write(&self, sh: &Sh, out: &mut dyn Write) -> io::Result<()> {
        let mut patched = [0; ROW];
        for (row, colour) in self.body.chunks_exact(ROW).zip(self.ignored.spread(sh)) {
            patched.copy_from_slice(row);
            for (byte, value) in patched[COLOUR..].iter_mut().zip(colour.unwrap_or_default()) {
                *byte = Range::UNIT.nearest(*value);
            }
            out.write_all(&patched)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
