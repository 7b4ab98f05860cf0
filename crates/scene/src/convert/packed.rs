//! SuperSplat's compressed PLY: chunks of 256 Gaussians in Morton order, four words each, a byte a harmonic.
use super::values::{opacity_byte, smallest_three, step, unit};
use crate::Gaussians;
use crate::fields::{file_index, rest_count};
use crate::packed::layout::{COLOUR, GEOMETRY, WORDS};
use crate::packed::{CHUNK, rest};
use crate::range::{C0, Range};
use std::f64::consts::FRAC_1_SQRT_2;
use std::io::{self, Write};

/// Log scales are put within this, since flat axes have infinite ones.
const LARGEST_LOG_SCALE: f32 = 20.0;
/// Largest numbers of 11 and 10 bits.
const BITS_11: u32 = 2047;
const BITS_10: u32 = 1023;

/// Writes checked Gaussians, in the order of `order`: a permutation of their rows.
pub(super) fn write(gaussians: &Gaussians, order: &[usize], out: &mut dyn Write) -> io::Result<()> {
    write_header(gaussians, out)?;
    let chunks: Vec<Chunk> = order.chunks(CHUNK).map(|rows| Chunk::of(gaussians, rows)).collect();
    for chunk in &chunks {
        for ranges in [&chunk.position, &chunk.log_scale, &chunk.colour] {
            let ends = ranges
                .iter()
                .map(|range| range.min)
                .chain(ranges.iter().map(|range| range.max));
            for end in ends {
                out.write_all(&end.to_le_bytes())?;
            }
        }
    }
    for (chunk, rows) in chunks.iter().zip(order.chunks(CHUNK)) {
        for row in rows {
            for word in chunk.words(gaussians, *row) {
                out.write_all(&word.to_le_bytes())?;
            }
        }
    }
    let degree = gaussians.sh.degree;
    let per_gaussian = gaussians.sh.per_gaussian();
    let mut bytes = vec![0; rest_count(degree)];
    for row in order {
        let coefficients = &gaussians.sh.coefficients[row * per_gaussian..(row + 1) * per_gaussian];
        for (place, value) in coefficients.iter().enumerate().skip(3) {
            bytes[file_index(degree, place) - 3] = rest::nearest(*value);
        }
        out.write_all(&bytes)?;
    }
    Ok(())
}

fn write_header(gaussians: &Gaussians, out: &mut dyn Write) -> io::Result<()> {
    let n = gaussians.len();
    writeln!(out, "ply\nformat binary_little_endian 1.0")?;
    writeln!(out, "element chunk {}", n.div_ceil(CHUNK))?;
    for name in GEOMETRY.iter().chain(&COLOUR) {
        writeln!(out, "property float {name}")?;
    }
    writeln!(out, "element vertex {n}")?;
    for name in WORDS {
        writeln!(out, "property uint {name}")?;
    }
    let rest = rest_count(gaussians.sh.degree);
    if rest > 0 {
        writeln!(out, "element sh {n}")?;
    }
    for i in 0..rest {
        writeln!(out, "property uchar f_rest_{i}")?;
    }
    writeln!(out, "end_header")
}

/// The ranges of a chunk.
struct Chunk {
    position: [Range; 3],
    log_scale: [Range; 3],
    colour: [Range; 3],
}

impl Chunk {
    fn of(gaussians: &Gaussians, rows: &[usize]) -> Chunk {
        let log_scale = ranges(rows.iter().map(|row| gaussians.log_scales[*row]));
        let within = |end: f32| end.clamp(-LARGEST_LOG_SCALE, LARGEST_LOG_SCALE);
        Chunk {
            position: ranges(rows.iter().map(|row| gaussians.positions[*row])),
            log_scale: log_scale.map(|range| Range {
                min: within(range.min),
                max: within(range.max),
            }),
            colour: colour_ranges(rows.iter().map(|row| constant(gaussians, *row))),
        }
    }

    /// Position, rotation, scale, colour.
    fn words(&self, gaussians: &Gaussians, row: usize) -> [u32; 4] {
        let colour = constant(gaussians, row);
        let [red, green, blue] = [0, 1, 2].map(|k| self.colour[k].nearest(colour[k]));
        [
            point(&self.position, gaussians.positions[row]),
            rotation(gaussians.rotations[row]),
            point(&self.log_scale, gaussians.log_scales[row]),
            u32::from_be_bytes([red, green, blue, opacity_byte(gaussians.opacity_logits[row])]),
        ]
    }
}

/// The constant coefficients of a Gaussian.
fn constant(gaussians: &Gaussians, row: usize) -> [f32; 3] {
    let start = row * gaussians.sh.per_gaussian();
    std::array::from_fn(|channel| gaussians.sh.coefficients[start + channel])
}

/// The ranges of a chunk's colours `0.5 + C0 f_dc`, of red, green and blue.
pub(crate) fn colour_ranges(constants: impl Iterator<Item = [f32; 3]>) -> [Range; 3] {
    ranges(constants.map(|colour| colour.map(|v| (0.5 + C0 * f64::from(v)) as f32)))
}

/// Least and largest along each axis; adding 0 makes the negative one positive, so that the order of rows is no matter.
fn ranges(points: impl Iterator<Item = [f32; 3]>) -> [Range; 3] {
    let none = Range {
        min: f32::INFINITY,
        max: f32::NEG_INFINITY,
    };
    points.fold([none; 3], |ranges, point| {
        std::array::from_fn(|axis| Range {
            min: ranges[axis].min.min(point[axis] + 0.0),
            max: ranges[axis].max.max(point[axis] + 0.0),
        })
    })
}

/// Three fractions of 11, 10 and 11 bits, the first in the highest.
fn point(ranges: &[Range; 3], value: [f32; 3]) -> u32 {
    let [x, y, z] = ranges;
    step(*x, value[0], BITS_11) << 21 | step(*y, value[1], BITS_10) << 11 | step(*z, value[2], BITS_11)
}

/// The place of the largest component in two bits, then the others, ten bits for -sqrt(1/2) to sqrt(1/2) each.
fn rotation(quaternion: [f32; 4]) -> u32 {
    let (largest, others) = smallest_three(unit(quaternion));
    others.iter().fold(largest as u32, |word, v| {
        let share = v * FRAC_1_SQRT_2 + 0.5;
        word << 10 | ((share * f64::from(BITS_10)).round() as u32).min(BITS_10)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_those_of_the_format() {
        let range = |min: f32, max: f32| Range { min, max };
        let ranges = [range(0.0, 2047.0), range(0.0, 1023.0), range(-2047.0, 0.0)];
        assert_eq!(point(&ranges, [5.0, 700.4, -1.0]), 5 << 21 | 700 << 11 | 2046);
        assert_eq!(point(&ranges, [1e9; 3]), u32::MAX);
        // Three components at 0 are the middle: 511.5 rounds up. The sign is that of w.
        assert_eq!(rotation([-2.0, 0.0, 0.0, 0.0]), 512 << 20 | 512 << 10 | 512);
        // sqrt(2) (682 / 1023 - 1/2) = 0.235_702.
        let small = 0.235_702_26f32;
        let large = (1.0 - 3.0 * small * small).sqrt();
        assert_eq!(
            rotation([small, -small, large, small]),
            2 << 30 | 682 << 20 | 341 << 10 | 682
        );
    }

    #[test]
    fn no_range_is_infinite() {
        let gaussians = Gaussians {
            positions: vec![[0.0; 3]],
            rotations: vec![[1.0, 0.0, 0.0, 0.0]],
            log_scales: vec![[f32::NEG_INFINITY, -3.0, 80.0]],
            opacity_logits: vec![0.0],
            sh: crate::Sh {
                degree: 0,
                coefficients: vec![0.0; 3],
            },
        };
        let [flat, usual, huge] = Chunk::of(&gaussians, &[0]).log_scale;
        assert_eq!((flat.min, flat.max), (-20.0, -20.0));
        assert_eq!((usual.min, usual.max), (-3.0, -3.0));
        assert_eq!((huge.min, huge.max), (20.0, 20.0));
    }
}
