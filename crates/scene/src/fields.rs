//! The properties of a Gaussian: which columns of a row they are, and what values they may have.
use crate::gaussians::{Gaussians, MAX_DEGREE, Sh};
use crate::ignored::{BadRows, Ignored, RowFilter};
use ply_rs::ply::ScalarType;

/// Most characters of somebody else's message or line that are repeated in ours.
const MAX_QUOTE: usize = 200;

/// Properties before the rest coefficients, in the order in which rows are handed to [`Rows::push`].
const FIXED: [&str; 14] = [
    "x", "y", "z", "rot_0", "rot_1", "rot_2", "rot_3", "scale_0", "scale_1", "scale_2", "opacity", "f_dc_0", "f_dc_1",
    "f_dc_2",
];
/// Index of `f_dc_0` in [`FIXED`]: colour is what follows.
pub(crate) const COLOUR: usize = 11;

/// One used property.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Field {
    /// Its place among the properties of a row.
    pub column: usize,
    /// Its first byte in a binary row.
    pub offset: usize,
    /// Eight bytes instead of four.
    pub double: bool,
}

/// The used properties: those of [`FIXED`], then `f_rest_0`, `f_rest_1` and so on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Fields {
    /// Degree of the spherical harmonics.
    pub degree: usize,
    /// Where the properties are.
    pub all: Vec<Field>,
}

impl Fields {
    /// Finds the properties among the columns of a row; `Err` is what is missing or wrong.
    pub fn find(columns: &[(&str, &ScalarType)]) -> Result<Fields, String> {
        let find = |name: &str| -> Result<Field, String> {
            let column = columns
                .iter()
                .position(|(other, _)| *other == name)
                .ok_or_else(|| format!("not a 3DGS scene: element vertex has no property {name}"))?;
            let double = match columns[column].1 {
                ScalarType::Float => false,
                ScalarType::Double => true,
                other => {
                    return Err(format!("property {name} is {other:?}, must be float or double"));
                }
            };
            let offset = columns[..column].iter().map(|(_, kind)| bytes(kind)).sum();
            Ok(Field { column, offset, double })
        };
        let mut all = FIXED.into_iter().map(find).collect::<Result<Vec<_>, _>>()?;
        let rest = columns.iter().filter(|(name, _)| name.starts_with("f_rest_")).count();
        let degree = (0..=MAX_DEGREE)
            .find(|degree| rest_count(*degree) == rest)
            .ok_or_else(|| {
                format!("{rest} f_rest properties fit no degree of spherical harmonics; 0, 9, 24, 45 or 72 do")
            })?;
        for i in 0..rest {
            all.push(find(&format!("f_rest_{i}")).map_err(|e| format!("{} ({rest} f_rest properties)", quote(&e)))?);
        }
        Ok(Fields { degree, all })
    }

    /// The band of used property `i`; 0 for all that are no rest coefficients.
    pub fn band(&self, i: usize) -> usize {
        i.checked_sub(FIXED.len()).map_or(0, |rest| band(self.degree, rest))
    }

    /// The columns that hold colour: `f_dc_*`, then `f_rest_*`.
    pub fn colour(&self) -> &[Field] {
        &self.all[COLOUR..]
    }
}

/// Number of `f_rest_*` properties of a degree.
pub(crate) fn rest_count(degree: usize) -> usize {
    3 * ((degree + 1) * (degree + 1) - 1)
}

/// Name of used property `i` in the order of [`Fields`].
pub(crate) fn name(i: usize) -> String {
    FIXED
        .get(i)
        .map_or_else(|| format!("f_rest_{}", i - FIXED.len()), ToString::to_string)
}

/// Which of a file's coefficients (`f_dc_*`, then `f_rest_*` channel-major) is at `place` in a row of [`Sh`]; `stored`
/// is the degree of the file, which the row's may be below.
pub(crate) fn file_index(stored: usize, place: usize) -> usize {
    let rest = (stored + 1) * (stored + 1) - 1;
    match place.checked_sub(3) {
        None => place,
        Some(rest_place) => 3 + (rest_place % 3) * rest + rest_place / 3,
    }
}

/// The degree of the band that `f_rest_*` property `i` of a file of degree `stored` belongs to.
pub(crate) fn band(stored: usize, i: usize) -> usize {
    let rest = (stored + 1) * (stored + 1) - 1;
    (i % rest + 1).isqrt()
}

/// Collects checked rows.
pub(crate) struct Rows {
    gaussians: Gaussians,
    /// Rows of the file that came by.
    seen: usize,
    sieve: RowFilter,
    /// Which value comes at each place of a row of [`Sh`].
    order: Vec<usize>,
}

impl Rows {
    /// Room for `rows` Gaussians of `degree` from a file of degree `stored`; call only with a count that the file's
    /// size supports.
    pub fn with_capacity(stored: usize, degree: usize, rows: usize, bad_rows: BadRows) -> Rows {
        let per_gaussian = 3 + rest_count(degree);
        let gaussians = Gaussians {
            positions: Vec::with_capacity(rows),
            rotations: Vec::with_capacity(rows),
            log_scales: Vec::with_capacity(rows),
            opacity_logits: Vec::with_capacity(rows),
            sh: Sh {
                degree,
                coefficients: Vec::with_capacity(rows * per_gaussian),
            },
        };
        let order = (0..per_gaussian)
            .map(|place| COLOUR + file_index(stored, place))
            .collect();
        Rows {
            gaussians,
            seen: 0,
            sieve: RowFilter::new(bad_rows),
            order,
        }
    }

    /// Adds a row of the values of [`Fields::all`], if they are legal; `Err` names the property and the row.
    pub fn push(&mut self, values: &[f32]) -> Result<(), String> {
        let row = self.seen;
        if let Some(i) = (0..values.len()).find(|i| !legal(*i, values[*i])) {
            return self.reject(|| format!("property {} of row {row} is {}", name(i), values[i]));
        }
        self.seen += 1;
        let all = &mut self.gaussians;
        all.positions.push([values[0], values[1], values[2]]);
        all.rotations.push([values[3], values[4], values[5], values[6]]);
        all.log_scales.push([values[7], values[8], values[9]]);
        all.opacity_logits.push(values[10]);
        all.sh.coefficients.extend(self.order.iter().map(|i| values[*i]));
        Ok(())
    }

    /// Sorts out a row that has no values to be added; `Err` is the reason where such rows are refused.
    pub fn reject(&mut self, reason: impl FnOnce() -> String) -> Result<(), String> {
        self.seen += 1;
        self.sieve.reject(self.seen - 1, reason)
    }

    /// The Gaussians collected, and the rows that are not among them.
    pub fn finish(self) -> (Gaussians, Ignored) {
        let (mut gaussians, ignored) = (self.gaussians, self.sieve.finish());
        if ignored.count() > 0 {
            // Bands may have been in use by bad rows only.
            gaussians.sh.trim();
        }
        (gaussians, ignored)
    }
}

/// Infinite opacity and flat axes exist in real files; nothing else may be infinite, and nothing NaN.
fn legal(i: usize, value: f32) -> bool {
    match i {
        7..=9 => value.is_finite() || value == f32::NEG_INFINITY,
        10 => !value.is_nan(),
        _ => value.is_finite(),
    }
}

/// Bytes of a scalar in a binary row.
pub(crate) fn bytes(scalar: &ScalarType) -> usize {
    match scalar {
        ScalarType::Char | ScalarType::UChar => 1,
        ScalarType::Short | ScalarType::UShort => 2,
        ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
        ScalarType::Double => 8,
    }
}

/// Somebody else's text on one line and not too long.
pub(crate) fn quote(text: &str) -> String {
    let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    match line.char_indices().nth(MAX_QUOTE) {
        Some((end, _)) => format!("{}...", &line[..end]),
        None => line,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rest_coefficients_are_channel_major_in_the_file() {
        // Degree 1: f_rest_0..2 are red's three, f_rest_3..5 green's, f_rest_6..8 blue's; f_rest_0 is number 3.
        let row: Vec<usize> = (0..12).map(|place| file_index(1, place)).collect();
        assert_eq!(row, [0, 1, 2, 3, 6, 9, 4, 7, 10, 5, 8, 11]);
        // In a file of degree 2 green's first is f_rest_8.
        assert_eq!(file_index(2, 4), 3 + 8);
        let bands: Vec<usize> = (0..8).map(|i| band(2, i)).collect();
        assert_eq!(bands, [1, 1, 1, 2, 2, 2, 2, 2]);
        assert_eq!((band(4, 23), band(4, 24), band(4, 15)), (4, 1, 4));
    }
}
