//! The rows of a PLY file: decoded column by column, and written back with nothing but colours changed.
use super::header::Storage;
use super::layout::{Layout, truncated};
use crate::fields::quote;
use crate::fields::{COLOUR, Field, Rows, file_index};
use crate::gaussians::{Gaussians, Sh};
use crate::ignored::{BadRows, Ignored};
use std::io::{self, Write};

/// Decodes the body of a file, all the bytes after its header; `Err` is the reason why not.
pub(super) fn decode(layout: &Layout, body: &[u8], bad_rows: BadRows) -> Result<(Gaussians, Ignored), String> {
    let mut values = vec![0.0; layout.fields.all.len()];
    match layout.storage {
        Storage::Binary { big_endian } => {
            let rows = binary_rows(layout, body)?;
            let degree = used_degree(layout, rows.clone(), big_endian);
            let mut collected = Rows::with_capacity(layout.fields.degree, degree, layout.rows as usize, bad_rows);
            // Values of bands that are not used stay 0.
            let used: Vec<(usize, Field)> = layout.fields.all.iter().copied().enumerate().collect();
            let used: Vec<_> = used
                .into_iter()
                .filter(|(i, _)| layout.fields.band(*i) <= degree)
                .collect();
            for row in rows {
                for (i, field) in &used {
                    values[*i] = get(row, *field, big_endian);
                }
                collected.push(&values)?;
            }
            Ok(collected.finish())
        }
        Storage::Ascii => {
            // Again, since a file can shrink between the look at its size and the read.
            layout.check_size(body.len() as u64)?;
            let degree = layout.fields.degree;
            let mut collected = Rows::with_capacity(degree, degree, layout.rows as usize, bad_rows);
            let mut words = Vec::with_capacity(layout.columns);
            let mut lines = ascii_lines(body).filter(|line| !line.trim_ascii().is_empty());
            for _ in 0..layout.skip {
                lines.next().ok_or("the body ends before the first Gaussian")?;
            }
            for row in 0..layout.rows {
                let line = lines.next().ok_or_else(|| truncated(row, layout.rows))?;
                split(line, &mut words);
                if words.len() < layout.columns && lines.next().is_none() {
                    return Err(truncated(row, layout.rows));
                }
                if words.len() != layout.columns {
                    return Err(format!("row {row} has {} values, not {}", words.len(), layout.columns));
                }
                let word = |field: &Field| &line[words[field.column].clone()];
                let mut unread = None;
                for (i, field) in layout.fields.all.iter().enumerate() {
                    match number(word(field)) {
                        Some(value) => values[i] = value,
                        None => unread = unread.or(Some(i)),
                    }
                }
                match unread {
                    None => collected.push(&values)?,
                    Some(i) => collected.reject(|| {
                        let word = String::from_utf8_lossy(word(&layout.fields.all[i]));
                        let (name, word) = (crate::fields::name(i), quote(&word));
                        format!("property {name} of row {row} is {word:?}, not a number")
                    })?,
                }
            }
            let (mut gaussians, ignored) = collected.finish();
            gaussians.sh.trim();
            Ok((gaussians, ignored))
        }
    }
}

/// The highest band in which some row has a coefficient other than 0.
fn used_degree(layout: &Layout, rows: std::slice::ChunksExact<'_, u8>, big_endian: bool) -> usize {
    let fields = &layout.fields;
    let mut degree = 0;
    // Highest bands first: most files use all that they have, and their first row says so.
    let mut order: Vec<usize> = (COLOUR + 3..fields.all.len()).collect();
    order.sort_by_key(|i| std::cmp::Reverse(fields.band(*i)));
    for row in rows {
        let unused = order.iter().take_while(|i| fields.band(**i) > degree);
        for i in unused {
            if get(row, fields.all[*i], big_endian) != 0.0 {
                degree = fields.band(*i);
                break;
            }
        }
        if degree == fields.degree {
            break;
        }
    }
    degree
}

/// Writes the body with the colours `sh`. Values that are as they were keep their bytes, as do the rows `ignored`.
///
/// `layout` and `body` are those of a successful [`decode`], `sh` has the degree and rows that it found, and `ignored`
/// are the others; bands above are written as they are.
pub(super) fn encode(layout: &Layout, body: &[u8], sh: &Sh, ignored: &Ignored, out: &mut impl Write) -> io::Result<()> {
    let stored = layout.fields.degree;
    let fields: Vec<Field> = (0..sh.per_gaussian())
        .map(|place| layout.fields.colour()[file_index(stored, place)])
        .collect();
    let mut colours = ignored.spread(sh);
    match layout.storage {
        Storage::Binary { big_endian } => {
            let rows = binary_rows(layout, body).map_err(io::Error::other)?;
            let end = layout.skip as usize + rows.len() * layout.row_bytes;
            out.write_all(&body[..layout.skip as usize])?;
            let mut patched = vec![0; layout.row_bytes];
            for (row, colour) in rows.zip(&mut colours) {
                patched.copy_from_slice(row);
                for (field, value) in fields.iter().zip(colour.unwrap_or_default()) {
                    set(&mut patched, *field, big_endian, *value);
                }
                out.write_all(&patched)?;
            }
            out.write_all(&body[end..])
        }
        Storage::Ascii => {
            let (mut skip, mut words) = (layout.skip, Vec::new());
            for line in ascii_lines(body) {
                if line.trim_ascii().is_empty() {
                    out.write_all(line)?;
                } else if skip > 0 {
                    skip -= 1;
                    out.write_all(line)?;
                } else if let Some(Some(colour)) = colours.next() {
                    split(line, &mut words);
                    encode_line(&fields, line, &words, colour, out)?;
                } else {
                    out.write_all(line)?;
                }
            }
            Ok(())
        }
    }
}

fn encode_line(
    fields: &[Field],
    line: &[u8],
    words: &[std::ops::Range<usize>],
    colour: &[f32],
    out: &mut impl Write,
) -> io::Result<()> {
    let mut changed: Vec<(usize, f32)> = Vec::new();
    for (field, value) in fields.iter().zip(colour) {
        let old = number(&line[words[field.column].clone()]);
        if old.map(f32::to_bits) != Some(value.to_bits()) {
            changed.push((field.column, *value));
        }
    }
    changed.sort_unstable_by_key(|(column, _)| *column);
    let mut done = 0;
    for (column, value) in changed {
        out.write_all(&line[done..words[column].start])?;
        // The shortest text that reads back as the same number.
        write!(out, "{value:?}")?;
        done = words[column].end;
    }
    out.write_all(&line[done..])
}

/// The promised rows, checked against the bytes that are there.
fn binary_rows<'a>(layout: &Layout, body: &'a [u8]) -> Result<std::slice::ChunksExact<'a, u8>, String> {
    // Again, since a file can shrink between the look at its size and the read.
    layout.check_size(body.len() as u64)?;
    let start = layout.skip as usize;
    let bytes = layout.rows as usize * layout.row_bytes;
    Ok(body[start..start + bytes].chunks_exact(layout.row_bytes))
}

/// Lines with their ends.
fn ascii_lines(body: &[u8]) -> impl Iterator<Item = &[u8]> {
    body.split_inclusive(|b| *b == b'\n')
}

/// The places of the words of a line.
fn split(line: &[u8], words: &mut Vec<std::ops::Range<usize>>) {
    words.clear();
    let mut start = None;
    for (i, byte) in line.iter().enumerate() {
        match (start, byte.is_ascii_whitespace()) {
            (None, false) => start = Some(i),
            (Some(first), true) => {
                words.push(first..i);
                start = None;
            }
            _ => (),
        }
    }
    words.extend(start.map(|first| first..line.len()));
}

fn number(word: &[u8]) -> Option<f32> {
    std::str::from_utf8(word).ok()?.parse().ok()
}

/// A value of a binary row. Offsets come from the header and lie within the row.
fn get(row: &[u8], field: Field, big_endian: bool) -> f32 {
    if field.double {
        let mut bytes = [0; 8];
        bytes.copy_from_slice(&row[field.offset..field.offset + 8]);
        (if big_endian {
            f64::from_be_bytes(bytes)
        } else {
            f64::from_le_bytes(bytes)
        }) as f32
    } else {
        let mut bytes = [0; 4];
        bytes.copy_from_slice(&row[field.offset..field.offset + 4]);
        if big_endian {
            f32::from_be_bytes(bytes)
        } else {
            f32::from_le_bytes(bytes)
        }
    }
}

/// Puts a value into a binary row, unless it is there already: a double keeps its lower digits.
fn set(row: &mut [u8], field: Field, big_endian: bool, value: f32) {
    if get(row, field, big_endian).to_bits() == value.to_bits() {
        return;
    }
    if field.double {
        let value = f64::from(value);
        let bytes = if big_endian {
            value.to_be_bytes()
        } else {
            value.to_le_bytes()
        };
        row[field.offset..field.offset + 8].copy_from_slice(&bytes);
    } else {
        let bytes = if big_endian {
            value.to_be_bytes()
        } else {
            value.to_le_bytes()
        };
        row[field.offset..field.offset + 4].copy_from_slice(&bytes);
    }
}
