//! From bytes to Gaussians.
use super::colour::{Harmonics, index};
use super::half;
use super::header::{Header, Level, Section, f32_at, u16_at, u32_at};
use crate::fields::{COLOUR, Rows, file_index, rest_count};
use crate::gaussians::Gaussians;
use crate::ignored::{BadRows, Ignored};
use crate::range::{Range, logit};

/// Reads the Gaussians of all sections of a file; `Err` says what is wrong with one.
pub(super) fn read(
    file: &[u8],
    header: &Header,
    sections: &[Section],
    bad_rows: BadRows,
) -> Result<(Gaussians, Ignored), String> {
    let degree = sections.iter().map(|section| section.degree).max().unwrap_or(0);
    let mut rows = Rows::with_capacity(degree, degree, header.gaussians as usize, bad_rows);
    let harmonics = Harmonics::of(header);
    let mut values = vec![0.0; COLOUR + 3 + rest_count(degree)];
    for (i, section) in sections.iter().enumerate() {
        let buckets = Buckets::of(file, header.level, section).map_err(|reason| format!("section {i}: {reason}"))?;
        let body = &file[section.rows as usize..section.end as usize];
        for (row, bytes) in body.chunks_exact(header.level.row(section.degree)).enumerate() {
            geometry(header.level, bytes, &buckets, row as u64, &mut values);
            let place = section.first as usize + row;
            if let Some(axis) = values[7..10].iter().position(|scale| *scale < 0.0) {
                let scale = values[7 + axis];
                rows.reject(|| format!("the scale of row {place} along axis {axis} is {scale}"))?;
                continue;
            }
            for scale in &mut values[7..10] {
                *scale = f64::from(*scale).ln() as f32;
            }
            let colour = &bytes[header.level.geometry()..];
            values[10] = logit(colour[3]);
            for (value, byte) in values[COLOUR..COLOUR + 3].iter_mut().zip(colour) {
                *value = Range::UNIT.coefficient(*byte);
            }
            values[COLOUR + 3..].fill(0.0);
            for i in 0..rest_count(section.degree) {
                values[COLOUR + file_index(degree, 3 + i)] = harmonics.read(&colour[4..], index(i));
            }
            rows.push(&values)?;
        }
    }
    let (mut gaussians, ignored) = rows.finish();
    gaussians.sh.trim();
    Ok((gaussians, ignored))
}

/// Position, rotation w, x, y, z and deviations of a row, in the order of [`Rows::push`].
fn geometry(level: Level, bytes: &[u8], buckets: &Buckets, row: u64, values: &mut [f32]) {
    let number = |i: usize| match level {
        Level::Single => f32_at(bytes, 4 * i),
        Level::Half | Level::Byte => half::value(u16_at(bytes, 2 * i)),
    };
    for axis in 0..3 {
        values[axis] = match level {
            Level::Single => number(axis),
            Level::Half | Level::Byte => buckets.position(row, axis, u16_at(bytes, 2 * axis)),
        };
        values[7 + axis] = number(3 + axis);
    }
    for i in 0..4 {
        values[3 + i] = number(6 + i);
    }
}

/// Cubes of a section, in which positions are steps from the centre. Those that are full are first.
struct Buckets<'a> {
    section: &'a Section,
    centres: Vec<[f32; 3]>,
    /// The row after the last of each that is not full.
    ends: Vec<u64>,
}

impl Buckets<'_> {
    fn of<'a>(file: &[u8], level: Level, section: &'a Section) -> Result<Buckets<'a>, String> {
        let (mut centres, mut ends) = (Vec::new(), Vec::new());
        if level != Level::Single && section.gaussians > 0 {
            let (lengths, rest) = file[section.start as usize..].split_at(4 * section.partial as usize);
            let mut end = section.full * section.bucket;
            for length in lengths.chunks_exact(4) {
                end += u64::from(u32_at(length, 0));
                ends.push(end);
            }
            if end != section.gaussians {
                let there = section.gaussians;
                return Err(format!("buckets of {end} Gaussians, and {there} Gaussians"));
            }
            let count = (section.full + section.partial) as usize;
            centres.extend(
                rest.chunks_exact(12)
                    .take(count)
                    .map(|bytes| [0, 4, 8].map(|at| f32_at(bytes, at))),
            );
            if let Some(bucket) = centres.iter().position(|centre| centre.iter().any(|v| !v.is_finite())) {
                let centre = centres[bucket];
                return Err(format!("the centre of bucket {bucket} is {centre:?}"));
            }
        }
        Ok(Buckets { section, centres, ends })
    }

    /// The coordinate of row `row` of the section that is so many steps.
    fn position(&self, row: u64, axis: usize, steps: u16) -> f32 {
        let full = self.section.full * self.section.bucket;
        let bucket = match row < full {
            true => row / self.section.bucket,
            false => self.section.full + self.ends.partition_point(|end| *end <= row) as u64,
        };
        let centre = f64::from(self.centres[bucket as usize][axis]);
        ((f64::from(steps) - self.section.middle) * self.section.step + centre) as f32
    }
}
