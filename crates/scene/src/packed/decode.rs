//! From the words of a compressed PLY to Gaussians.
use super::layout::{COLOUR, GEOMETRY, Layout};
use super::{CHUNK, rest};
use crate::fields::{Rows, band, rest_count};
use crate::gaussians::Gaussians;
use crate::ignored::BadRows;
use crate::range::{Range, logit};

/// Largest magnitude of an end of a range of colours: more than any colour, and so much less than single precision
/// holds that no coefficient within the range or near it is infinite.
pub(crate) const LARGEST_COLOUR: f32 = 1e30;

/// What the words of 256 Gaussians are fractions of.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chunk {
    position: [Range; 3],
    log_scale: [Range; 3],
    /// Red, green, blue.
    pub colour: [Range; 3],
}

/// Reads the chunks that have Gaussians; `Err` names a range that cannot be.
pub(super) fn chunks(layout: &Layout, body: &[u8]) -> Result<Vec<Chunk>, String> {
    let needed = layout.gaussians.count.div_ceil(CHUNK);
    let rows = layout.chunks.rows(body).take(needed).enumerate();
    rows.map(|(i, row)| {
        let number = |name: &str, column: usize, limit: f32| {
            let value = f32::from_bits(word(row, column));
            if value.abs() <= limit {
                return Ok(value);
            }
            Err(if value.is_finite() {
                format!("property {name} of chunk {i} is {value:e}, beyond the limit of {limit:e}")
            } else {
                format!("property {name} of chunk {i} is {value}")
            })
        };
        let mut geometry = [0.0; 12];
        for (k, value) in geometry.iter_mut().enumerate() {
            *value = number(GEOMETRY[k], layout.geometry[k], f32::MAX)?;
        }
        let mut colour = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0];
        if let Some(columns) = layout.colour {
            for (k, value) in colour.iter_mut().enumerate() {
                *value = number(COLOUR[k], columns[k], LARGEST_COLOUR)?;
            }
        }
        // Three minima, then three maxima.
        let ranges = |six: &[f32]| {
            std::array::from_fn(|axis| Range {
                min: six[axis],
                max: six[axis + 3],
            })
        };
        Ok(Chunk {
            position: ranges(&geometry[..6]),
            log_scale: ranges(&geometry[6..]),
            colour: ranges(&colour),
        })
    })
    .collect()
}

/// Decodes the body, all the bytes after the header; `Err` is the reason why not. Fractions of legal ranges are legal,
/// so that there are no bad rows.
pub(super) fn decode(layout: &Layout, chunks: &[Chunk], body: &[u8]) -> Result<Gaussians, String> {
    let degree = used_degree(layout, body);
    let mut collected = Rows::with_capacity(layout.degree, degree, layout.gaussians.count, BadRows::Refuse);
    // In the order of a plain PLY: position, rotation, scale, opacity, f_dc_*, f_rest_*.
    let mut values = vec![0.0; 14 + rest_count(layout.degree)];
    let mut rests = layout.rest.as_ref().map(|(table, columns)| (table.rows(body), columns));
    for (i, row) in layout.gaussians.rows(body).enumerate() {
        let chunk = &chunks[i / CHUNK];
        let [at, turn, size, colour] = layout.words.map(|column| word(row, column));
        values[..3].copy_from_slice(&point(at, &chunk.position));
        values[3..7].copy_from_slice(&rotation(turn));
        values[7..10].copy_from_slice(&point(size, &chunk.log_scale));
        let [red, green, blue, alpha] = colour.to_be_bytes();
        values[10] = logit(alpha);
        for (k, byte) in [red, green, blue].into_iter().enumerate() {
            values[11 + k] = chunk.colour[k].coefficient(byte);
        }
        if let Some((rows, columns)) = &mut rests
            && let Some(row) = rows.next()
        {
            for (value, column) in values[14..].iter_mut().zip(columns.iter()) {
                *value = rest::value(row[*column]);
            }
        }
        collected.push(&values)?;
    }
    Ok(collected.finish().0)
}

/// The highest band in which some byte is not one for 0.
fn used_degree(layout: &Layout, body: &[u8]) -> usize {
    let Some((table, columns)) = &layout.rest else { return 0 };
    let bands: Vec<usize> = (0..columns.len()).map(|i| band(layout.degree, i)).collect();
    let used = |row: &[u8]| {
        let of_row = columns
            .iter()
            .zip(&bands)
            .filter(|(column, _)| !rest::may_be_zero(row[**column]));
        of_row.map(|(_, band)| *band).max().unwrap_or(0)
    };
    let mut degree = 0;
    for row in table.rows(body) {
        degree = degree.max(used(row));
        if degree == layout.degree {
            break;
        }
    }
    degree
}

/// A little-endian word of a row.
pub(super) fn word(row: &[u8], column: usize) -> u32 {
    let mut bytes = [0; 4];
    bytes.copy_from_slice(&row[column..column + 4]);
    u32::from_le_bytes(bytes)
}

/// Three fractions of 11, 10 and 11 bits, the first in the highest.
fn point(word: u32, ranges: &[Range; 3]) -> [f32; 3] {
    let [x, y, z] = ranges;
    [
        x.at(word >> 21, 2047) as f32,
        y.at(word >> 11 & 1023, 1023) as f32,
        z.at(word & 2047, 2047) as f32,
    ]
}

/// A unit quaternion w, x, y, z: the place of its largest component in the highest two bits, then the others in their
/// order, ten bits for -sqrt(1/2) to sqrt(1/2) each. The largest is not negative.
fn rotation(word: u32) -> [f32; 4] {
    let small = |shift: u32| (f64::from(word >> shift & 1023) / 1023.0 - 0.5) * std::f64::consts::SQRT_2;
    let others = [small(20), small(10), small(0)];
    let squares: f64 = others.iter().map(|v| v * v).sum();
    let largest = (1.0 - squares).max(0.0).sqrt();
    let place = (word >> 30) as usize;
    let mut rest = others.into_iter();
    std::array::from_fn(|i| if i == place { largest } else { rest.next().unwrap_or(0.0) } as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotations_have_the_largest_component_at_its_place() {
        // 0 is -sqrt(1/2), 1023 sqrt(1/2), and 682 two thirds of the way: sqrt(2) (2/3 - 1/2) = 0.235_702.
        let word = |place: u32| place << 30 | 1023 << 20 | 682 << 10 | 341;
        let (a, b, c) = (0.5f32.sqrt(), 0.235_702_26, -0.235_702_26);
        let m = (1.0f32 - 0.5 - 2.0 * b * b).sqrt();
        let expected = [[m, a, b, c], [a, m, b, c], [a, b, m, c], [a, b, c, m]];
        for (place, expected) in expected.into_iter().enumerate() {
            let found = rotation(word(place as u32));
            for (found, expected) in found.into_iter().zip(expected) {
                assert!((found - expected).abs() < 1e-7, "{place}: {found} {expected}");
            }
        }
        // Components that are too large together leave none for the largest.
        assert_eq!(rotation(3 << 30 | 1023 << 20 | 1023 << 10 | 1023)[3], 0.0);
    }

    #[test]
    fn points_are_11_10_11_bits() {
        let range = |min: f32, max: f32| Range { min, max };
        let ranges = [range(0.0, 2047.0), range(0.0, 1023.0), range(-2047.0, 0.0)];
        assert_eq!(point(5 << 21 | 700 << 11 | 2046, &ranges), [5.0, 700.0, -1.0]);
        assert_eq!(point(u32::MAX, &ranges), [2047.0, 1023.0, 0.0]);
    }
}
