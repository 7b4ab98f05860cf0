//! PlayCanvas' SOG of version 2: `meta.json` and lossless WebP pictures, a pixel a Gaussian, in a ZIP.
use super::cluster::codebook;
use super::palette::{self, Groups};
use super::values::{byte, opacity_byte, smallest_three, unit};
use crate::Gaussians;
use crate::sog::budget::Budget;
use crate::sog::codebook::Codebook;
use crate::sog::decode::{FIRST_COMPONENT, bytes_per_gaussian};
use crate::sog::palette::SIDE_BY_SIDE;
use crate::sog::picture::{Picture, Size};
use serde_json::{Value, json};
use std::f64::consts::SQRT_2;
use std::io::{self, Cursor, Write};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Numbers of a codebook in a file; some readers expect so many.
const NUMBERS: usize = 256;

/// A codebook as it is written and as it is read.
#[derive(Clone, Debug)]
pub(crate) struct Table {
    /// Ascending; the last repeated up to 256.
    numbers: Vec<f32>,
    /// What the reader takes them for.
    read: Codebook,
}

impl Table {
    /// The best for `values`, which are finite or minus infinity.
    pub fn fit(values: impl Iterator<Item = f32>) -> Result<Table, String> {
        let mut numbers = codebook(values);
        let last = numbers.last().copied().unwrap_or_default();
        numbers.resize(NUMBERS, last);
        let listed: Vec<Option<f64>> = numbers.iter().map(|v| Some(f64::from(*v))).collect();
        let read = Codebook::listed(&listed)?;
        Ok(Table { numbers, read })
    }

    /// Index of the nearest number.
    pub fn index(&self, value: f32) -> u8 {
        self.read.nearest(0, value)
    }

    /// The nearest number.
    pub fn kept(&self, value: f32) -> f32 {
        self.read.value(self.index(value))
    }
}

/// What a file has in place of the coefficients of a scene.
#[derive(Clone, Debug)]
pub(crate) struct Colours {
    /// Constant ones, of all channels.
    pub constants: Table,
    /// Higher bands, if any.
    pub rest: Option<Rest>,
}

/// A palette.
#[derive(Clone, Debug)]
pub(crate) struct Rest {
    /// Bands.
    pub degree: usize,
    /// Coefficients of a row, all channels, RGB innermost.
    pub width: usize,
    /// Rows before they are put on numbers, and who has which.
    pub groups: Groups,
    /// What rows are made of.
    pub numbers: Table,
}

/// Degree of the harmonics that a file of these Gaussians has room for; there is no palette of no rows.
pub(crate) fn degree(gaussians: &Gaussians) -> usize {
    match gaussians.is_empty() {
        true => 0,
        false => gaussians.sh.degree.min(super::most_degree(crate::Format::Sog)),
    }
}

impl Colours {
    /// Codebooks and palette of a scene.
    pub fn fit(gaussians: &Gaussians) -> Result<Colours, String> {
        let sh = &gaussians.sh;
        let rows = || sh.coefficients.chunks_exact(sh.per_gaussian());
        let constants = Table::fit(rows().flat_map(|row| row[..3].iter().copied()))?;
        let degree = degree(gaussians);
        let rest = match degree {
            0 => None,
            _ => {
                let width = 3 * ((degree + 1) * (degree + 1) - 1);
                let points: Vec<f32> = rows().flat_map(|row| row[3..3 + width].iter().copied()).collect();
                let groups = palette::groups(&points, width, palette::size(gaussians.len()));
                let numbers = Table::fit(groups.means.iter().copied())?;
                Some(Rest {
                    degree,
                    width,
                    groups,
                    numbers,
                })
            }
        };
        Ok(Colours { constants, rest })
    }
}

/// The file of checked Gaussians in the order of `order`; `Err` is the reason for which it could not be read.
pub(super) fn encode(gaussians: &Gaussians, order: &[usize]) -> Result<Vec<u8>, String> {
    let mut file = Entries::new(order.len());
    let mut meta = json!({
        "version": 2,
        "count": order.len(),
        "means": file.positions(gaussians, order)?,
        "quats": {"files": ["quats.webp"]},
    });
    let turn = |row: usize| rotation(gaussians.rotations[row]);
    file.add("quats.webp", order.iter().map(|row| turn(*row)))?;
    let sizes = Table::fit(gaussians.log_scales.as_flattened().iter().copied())?;
    let size = |row: usize| {
        let [x, y, z] = gaussians.log_scales[row].map(|v| sizes.index(v));
        [x, y, z, u8::MAX]
    };
    file.add("scales.webp", order.iter().map(|row| size(*row)))?;
    meta["scales"] = json!({"codebook": sizes.numbers, "files": ["scales.webp"]});
    let colours = Colours::fit(gaussians)?;
    let per_gaussian = gaussians.sh.per_gaussian();
    let colour = |row: usize| {
        let constants = &gaussians.sh.coefficients[row * per_gaussian..][..3];
        let index = |channel: usize| colours.constants.index(constants[channel]);
        [
            index(0),
            index(1),
            index(2),
            opacity_byte(gaussians.opacity_logits[row]),
        ]
    };
    file.add("sh0.webp", order.iter().map(|row| colour(*row)))?;
    meta["sh0"] = json!({"codebook": colours.constants.numbers, "files": ["sh0.webp"]});
    if let Some(rest) = &colours.rest {
        meta["shN"] = file.palette(rest, order)?;
    }
    file.finish(&meta, bytes_per_gaussian(degree(gaussians)))
}

/// The three smaller components, a byte each for -sqrt(1/2) to sqrt(1/2), and which is the largest.
fn rotation(quaternion: [f32; 4]) -> [u8; 4] {
    let (largest, others) = smallest_three(unit(quaternion));
    let [a, b, c] = others.map(|v| byte((v * SQRT_2 + 1.0) * 127.5));
    [a, b, c, FIRST_COMPONENT + largest as u8]
}

/// What positions are steps of.
fn log_transform(value: f32) -> f64 {
    f64::from(value.abs()).ln_1p().copysign(f64::from(value))
}

/// Entries of the ZIP under construction.
struct Entries {
    gaussians: usize,
    size: Size,
    entries: Vec<(&'static str, Vec<u8>)>,
    /// Bytes that a reader will have of them, unpacked and decoded.
    unpacked: u64,
}

impl Entries {
    /// Pictures nearly square, with sides that are multiples of 4.
    fn new(gaussians: usize) -> Entries {
        let root = (gaussians as f64).sqrt().ceil() as usize;
        let width = root.next_multiple_of(4).max(4);
        let height = gaussians.div_ceil(width).next_multiple_of(4).max(4);
        Entries {
            gaussians,
            size: Size {
                width: width as u32,
                height: height as u32,
            },
            entries: Vec::new(),
            unpacked: 0,
        }
    }

    /// A picture of a pixel a Gaussian.
    fn add(&mut self, name: &'static str, pixels: impl Iterator<Item = [u8; 4]>) -> Result<(), String> {
        self.add_sized(name, self.size, pixels)
    }

    fn add_sized(
        &mut self,
        name: &'static str,
        size: Size,
        pixels: impl Iterator<Item = [u8; 4]>,
    ) -> Result<(), String> {
        let mut rgba: Vec<u8> = pixels.flatten().collect();
        rgba.resize(size.bytes() as usize, 0);
        let webp = Picture::new(size, rgba).encode();
        let webp = webp.map_err(|e| format!("picture {name} cannot be written: {e}"))?;
        self.unpacked += size.bytes() + webp.len() as u64;
        self.entries.push((name, webp));
        Ok(())
    }

    /// Both bytes of positions, and what they are steps of.
    fn positions(&mut self, gaussians: &Gaussians, order: &[usize]) -> Result<Value, String> {
        let mut least = [f64::INFINITY; 3];
        let mut most = [f64::NEG_INFINITY; 3];
        for position in &gaussians.positions {
            for axis in 0..3 {
                let log = log_transform(position[axis]);
                least[axis] = log.min(least[axis]);
                most[axis] = log.max(most[axis]);
            }
        }
        if gaussians.is_empty() {
            (least, most) = ([0.0; 3], [0.0; 3]);
        }
        let steps = |row: usize| -> [[u8; 2]; 3] {
            std::array::from_fn(|axis| {
                // A range of no width gives NaN, which the conversion takes to 0.
                let share = (log_transform(gaussians.positions[row][axis]) - least[axis]) / (most[axis] - least[axis]);
                ((65535.0 * share).round() as u16).to_le_bytes()
            })
        };
        let half = |row: usize, i: usize| {
            let [x, y, z] = steps(row).map(|bytes| bytes[i]);
            [x, y, z, u8::MAX]
        };
        self.add("means_l.webp", order.iter().map(|row| half(*row, 0)))?;
        self.add("means_u.webp", order.iter().map(|row| half(*row, 1)))?;
        Ok(json!({"mins": least, "maxs": most, "files": ["means_l.webp", "means_u.webp"]}))
    }

    /// Rows of the palette, 64 side by side, and each Gaussian's label.
    fn palette(&mut self, rest: &Rest, order: &[usize]) -> Result<Value, String> {
        let count = rest.groups.counts.len();
        let size = Size {
            width: (SIDE_BY_SIDE * rest.width / 3) as u32,
            height: count.div_ceil(SIDE_BY_SIDE) as u32,
        };
        let pixel = |values: &[f32]| {
            let index = |channel: usize| rest.numbers.index(values[channel]);
            [index(0), index(1), index(2), u8::MAX]
        };
        self.add_sized("shN_centroids.webp", size, rest.groups.means.chunks_exact(3).map(pixel))?;
        let label = |row: &usize| {
            let [low, high] = rest.groups.labels[*row].to_le_bytes();
            [low, high, 0, u8::MAX]
        };
        self.add("shN_labels.webp", order.iter().map(label))?;
        Ok(json!({
            "count": count,
            "bands": rest.degree,
            "codebook": rest.numbers.numbers,
            "files": ["shN_centroids.webp", "shN_labels.webp"],
        }))
    }

    /// The ZIP; `Err` where a reader would take it for a bomb.
    fn finish(mut self, meta: &Value, bytes_per_gaussian: u64) -> Result<Vec<u8>, String> {
        let meta = meta.to_string().into_bytes();
        self.unpacked += meta.len() as u64 + self.gaussians as u64 * bytes_per_gaussian;
        self.entries.push(("meta.json", meta));
        let file = zip(&self.entries).map_err(|e| format!("the ZIP cannot be written: {e}"))?;
        Budget::new(file.len() as u64)
            .spend(self.unpacked)
            .map_err(|reason| format!("Gaussians so much alike that no reader would take the file: {reason}"))?;
        Ok(file)
    }
}

/// A ZIP without times. Pictures are compressed already; the text is not worth it.
fn zip(entries: &[(&'static str, Vec<u8>)]) -> io::Result<Vec<u8>> {
    let room = entries.iter().map(|(_, content)| content.len() + 256).sum();
    let mut out = ZipWriter::new(Cursor::new(Vec::with_capacity(room)));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    for (name, content) in entries {
        out.start_file(*name, options)?;
        out.write_all(content)?;
    }
    Ok(out.finish()?.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_have_room_and_sides_of_four() {
        for n in [0, 1, 15, 16, 17, 1000, 101_407] {
            let Size { width, height } = Entries::new(n).size;
            assert_eq!((width % 4, height % 4), (0, 0));
            assert!((width * height) as usize >= n && width > 0 && height > 0);
            assert!(n < 17 || ((width * height) as usize) < n + 8 * width as usize, "{n}");
        }
    }

    #[test]
    fn rotations_are_bytes() {
        assert_eq!(rotation([-3.0, 0.0, 0.0, 0.0]), [128, 128, 128, 252]);
        let half = 0.5f32.sqrt();
        assert_eq!(rotation([0.0, half, -half, 0.0]), [128, 0, 128, 253]);
    }

    #[test]
    fn tables_are_found_again() {
        let table = Table::fit([f32::NEG_INFINITY, 2.5, -1.0].into_iter()).unwrap();
        assert_eq!(table.numbers.len(), 256);
        let kept = [f32::NEG_INFINITY, -1.2, 2.5, 9.0].map(|v| table.kept(v));
        assert_eq!(kept, [-21.0, -1.0, 2.5, 2.5]);
    }
}
