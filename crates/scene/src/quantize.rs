//! What files of a format keep of colours, without writing one: stand-ins for conversion while a mark is learned.
//!
//! Ranges and codebooks of some formats come from the scene, and so [`ColorQuantizer`] is fitted once to the scene as it is
//! before its colours change. With the colours changed it gives what [`convert`](crate::convert) and reading would give
//! then: bit by bit, but for SOG, whose codebooks and groups stay those of the scene that it was fitted to.
//! Groups of a changed scene follow its changes a little: of independent noise of 0.02 on the harmonics of a captured
//! scene (101,407 Gaussians, degree 3) files keep 73 % and the stand-in 62 %.
use crate::convert::{self, check_arrays, morton, packed, sog, splat, spz};
use crate::error::bad;
use crate::packed::{CHUNK, rest};
use crate::range::Range;
use crate::spz::colour;
use crate::{Error, Format, Gaussians, Result};
use std::path::Path;

/// What messages call the scene, which has no file.
const NAME: &str = "quantised scene";

/// What a file of a format keeps of the coefficients of a scene.
#[derive(Clone, Debug)]
pub struct ColorQuantizer {
    gaussians: usize,
    per_gaussian: usize,
    how: How,
}

#[derive(Clone, Debug)]
enum How {
    /// Everything.
    Ply,
    /// Everything up to the highest degree that a glTF has.
    Gltf,
    Spz,
    Splat,
    Ksplat,
    Packed(Chunks),
    Sog(Box<Shared>),
}

/// Chunks of a compressed PLY; their ranges are those of the colours that are asked for.
#[derive(Clone, Debug)]
struct Chunks {
    /// Rows in the order of the file.
    order: Vec<usize>,
    /// Chunk of each row.
    chunk: Vec<usize>,
    constants: Vec<[f32; 3]>,
}

/// What Gaussians of a SOG share.
#[derive(Clone, Debug)]
struct Shared {
    colours: sog::Colours,
    /// Coefficients of the bands of the palette, a row each.
    rest: Vec<f32>,
}

impl ColorQuantizer {
    /// Fits to a scene. Takes as long as the order, the codebooks and the palette of a conversion: seconds for SOG.
    ///
    /// # Errors
    /// [`Error::BadScene`]: arrays of different lengths, coefficients that are not finite.
    pub fn fit(gaussians: &Gaussians, format: Format) -> Result<ColorQuantizer> {
        check_arrays(gaussians).map_err(refused)?;
        let per_gaussian = gaussians.sh.per_gaussian();
        let coefficients = &gaussians.sh.coefficients;
        if let Some(i) = coefficients.iter().position(|v| !v.is_finite()) {
            let (row, value) = (i / per_gaussian, coefficients[i]);
            return Err(refused(format!("a colour of row {row} is {value}")));
        }
        let how = match format {
            Format::Ply => How::Ply,
            Format::Gltf | Format::Glb => How::Gltf,
            Format::Spz => How::Spz,
            Format::Splat => How::Splat,
            Format::Ksplat => How::Ksplat,
            Format::CompressedPly => How::Packed(Chunks::of(gaussians)),
            Format::Sog => {
                let colours = sog::Colours::fit(gaussians).map_err(refused)?;
                let width = colours.rest.as_ref().map_or(0, |rest| rest.width);
                let rows = coefficients.chunks_exact(per_gaussian);
                let rest = rows.flat_map(|row| &row[3..3 + width]).copied().collect();
                How::Sog(Box::new(Shared { colours, rest }))
            }
        };
        Ok(ColorQuantizer {
            gaussians: gaussians.len(),
            per_gaussian,
            how,
        })
    }

    /// Replaces coefficients by what a file keeps of them. `coefficients` is `[rows.len()][(degree + 1)^2][3]`, in
    /// which row `i` is that of Gaussian `rows[i]`; each at most once. Gaussians that are not among them count as those
    /// of the scene, for ranges and palettes that they share with those that are.
    ///
    /// Bands that the format has no room for become 0. A band that a compressed PLY has nothing but its bytes next to
    /// 0 for, for any Gaussian, is 0 when it is read, and within 1/64 of 0 here.
    ///
    /// # Errors
    /// [`Error::BadScene`]: a row that the scene has not, another number of coefficients than `rows` have.
    pub fn apply(&self, rows: &[usize], coefficients: &mut [f32]) -> Result<()> {
        let (needed, there) = (rows.len() * self.per_gaussian, coefficients.len());
        if there != needed {
            let count = rows.len();
            return Err(refused(format!(
                "{there} coefficients for {count} rows, must be {needed}"
            )));
        }
        if let Some(row) = rows.iter().find(|row| **row >= self.gaussians) {
            return Err(refused(format!("row {row} of a scene of {}", self.gaussians)));
        }
        match &self.how {
            How::Ply => (),
            How::Gltf => {
                let most = convert::most_degree(Format::Glb) + 1;
                for row in coefficients.chunks_exact_mut(self.per_gaussian) {
                    row.iter_mut().skip(3 * most * most).for_each(|value| *value = 0.0);
                }
            }
            How::Spz => coefficients.chunks_exact_mut(self.per_gaussian).for_each(keep_spz),
            How::Splat => coefficients.chunks_exact_mut(self.per_gaussian).for_each(keep_splat),
            How::Ksplat => coefficients.chunks_exact_mut(self.per_gaussian).for_each(keep_ksplat),
            How::Packed(chunks) => chunks.apply(rows, coefficients, self.per_gaussian),
            How::Sog(shared) => shared.apply(rows, coefficients, self.per_gaussian),
        }
        Ok(())
    }
}

fn refused(reason: String) -> Error {
    bad(Path::new(NAME), reason)
}

fn keep_spz(row: &mut [f32]) {
    let (constants, rest) = row.split_at_mut(3);
    for value in constants {
        *value = colour::constant(colour::constant_byte(*value));
    }
    for (i, value) in rest.iter_mut().enumerate() {
        *value = colour::harmonic(spz::harmonic_byte(i, *value));
    }
}

fn keep_splat(row: &mut [f32]) {
    let (constants, rest) = row.split_at_mut(3);
    for value in constants {
        *value = Range::UNIT.coefficient(splat::kept_byte(*value));
    }
    rest.fill(0.0);
}

fn keep_ksplat(row: &mut [f32]) {
    let most = convert::most_degree(Format::Ksplat) + 1;
    for value in &mut row[..3] {
        *value = Range::UNIT.coefficient(splat::kept_byte(*value));
    }
    row.iter_mut().skip(3 * most * most).for_each(|value| *value = 0.0);
}

impl Chunks {
    fn of(gaussians: &Gaussians) -> Chunks {
        let order = morton(&gaussians.positions);
        let mut chunk = vec![0; order.len()];
        for (place, row) in order.iter().enumerate() {
            chunk[*row] = place / CHUNK;
        }
        let rows = gaussians.sh.coefficients.chunks_exact(gaussians.sh.per_gaussian());
        Chunks {
            order,
            chunk,
            constants: rows.map(|row| [row[0], row[1], row[2]]).collect(),
        }
    }

    fn apply(&self, rows: &[usize], coefficients: &mut [f32], per_gaussian: usize) {
        let mut constants = self.constants.clone();
        for (row, colour) in rows.iter().zip(coefficients.chunks_exact(per_gaussian)) {
            constants[*row].copy_from_slice(&colour[..3]);
        }
        let mut ranges: Vec<Option<[Range; 3]>> = vec![None; self.order.len().div_ceil(CHUNK)];
        for (row, colour) in rows.iter().zip(coefficients.chunks_exact_mut(per_gaussian)) {
            let chunk = self.chunk[*row];
            let ranges = ranges[chunk].get_or_insert_with(|| {
                let members = self.order.iter().skip(chunk * CHUNK).take(CHUNK);
                packed::colour_ranges(members.map(|row| constants[*row]))
            });
            for (value, range) in colour.iter_mut().zip(ranges) {
                *value = range.coefficient(range.nearest(*value));
            }
            for value in &mut colour[3..] {
                *value = rest::value(rest::nearest(*value));
            }
        }
    }
}

impl Shared {
    fn apply(&self, rows: &[usize], coefficients: &mut [f32], per_gaussian: usize) {
        let constants = &self.colours.constants;
        for colour in coefficients.chunks_exact_mut(per_gaussian) {
            colour[..3].iter_mut().for_each(|value| *value = constants.kept(*value));
        }
        let Some(sog::Rest {
            width, groups, numbers, ..
        }) = &self.colours.rest
        else {
            return coefficients
                .chunks_exact_mut(per_gaussian)
                .for_each(|row| row[3..].fill(0.0));
        };
        // How far the changes move the sums of each group: a row of a palette is the mean of those who share it.
        let mut moved = vec![0.0f64; groups.counts.len() * width];
        for (row, colour) in rows.iter().zip(coefficients.chunks_exact(per_gaussian)) {
            let group = usize::from(groups.labels[*row]) * width;
            let own = &self.rest[row * width..(row + 1) * width];
            for ((sum, new), old) in moved[group..group + width].iter_mut().zip(&colour[3..]).zip(own) {
                *sum += f64::from(*new) - f64::from(*old);
            }
        }
        for (row, colour) in rows.iter().zip(coefficients.chunks_exact_mut(per_gaussian)) {
            let label = usize::from(groups.labels[*row]);
            let (group, count) = (label * width, f64::from(groups.counts[label]));
            let (kept, beyond) = colour[3..].split_at_mut(*width);
            for (place, value) in kept.iter_mut().enumerate() {
                let mean = f64::from(groups.means[group + place]) + moved[group + place] / count;
                *value = numbers.kept(mean as f32);
            }
            beyond.fill(0.0);
        }
    }
}

#[cfg(test)]
mod tests;
