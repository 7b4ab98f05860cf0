//! Scenes into files of another format: any Gaussians in any of them, as the well-known converters write them.
//!
//! | | positions | log scales | rotations | opacity | constant colour | higher bands | rows |
//! |---|---|---|---|---|---|---|---|
//! | PLY | exact | exact | exact | exact | exact | exact | as they are |
//! | compressed PLY | 2047, 1023, 2047 steps of a chunk's range | the same, within ±20 | 10 bits a component | 255 steps | 255 steps of a chunk's range | steps of 1/32 within ±4 | Morton order |
//! | SPZ 3 | steps of 2⁻¹² where they fit | steps of 1/16 from -10 to 5.94 | 9 bits and sign a component | 255 steps | steps of 0.026 within ±3.33 | steps of 1/16, from band 2 on 1/8, within ±1 | as they are |
//! | .splat | exact | exact, but for single precision | 8 bits a component | 255 steps | 255 steps from black to white | none | by size, largest first |
//! | .ksplat 0.1, level 0 | exact | exact, but for single precision | single precision | 255 steps | 255 steps from black to white | exact, up to band 2 | as they are |
//! | glTF, .glb | exact | single precision of their exponentials | single precision | single precision of the sigmoid | exact | exact, up to band 3 | as they are |
//! | SOG 2 | 65535 steps of sign(x) ln(1 + \|x\|) | 256 values | 8 bits a component | 255 steps | 256 values | up to 65536 rows of 256 values, up to band 3 | Morton order |
//!
//! **Sources.** Compressed PLY and SOG follow PlayCanvas' splat-transform, SPZ Niantic's library (12 fractional bits,
//! harmonics of 5 bits in the first band and 4 above it), .splat antimatter15's `convert.py`, .ksplat mkkellogg's viewer. Where those cut off what
//! is after the point (rotations, opacities and positions of SOG; all bytes of .splat) the nearest number is written
//! here, so that errors are half as large and have no bias. Steps of opacity are steps of its sigmoid.
//!
//! **Numbers that some formats have none for.** A rotation of length 0 becomes none at all (w = 1). A flat axis, whose
//! log scale is minus infinity, is 0 in .splat, .ksplat, glTF and PLY, -20 in a compressed PLY, -10 in an SPZ, and 20 below the least
//! finite one of the scene in a SOG. Colours, scales and harmonics beyond what a format holds are put to its ends.
//! Axes are not flipped for SPZ and glTF: the numbers in memory are those of the file, as when it is read.
//!
//! Files depend on nothing but the Gaussians: no time, no random numbers, no number of threads.
pub(crate) mod cluster;
mod gltf;
mod ksplat;
mod order;
pub(crate) mod packed;
pub(crate) mod palette;
mod refuse;
pub(crate) mod sog;
pub(crate) mod splat;
pub(crate) mod spz;
mod values;

pub(crate) use order::morton;
pub(crate) use refuse::check_arrays;
pub(crate) use values::unit;

use crate::error::bad;
use crate::{Error, Format, Gaussians, Result, ply, write_whole};
use std::io::{self, Write};
use std::path::Path;

/// What was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// The format.
    pub format: Format,
    /// Row `i` of the file is Gaussian `order[i]` of those that were given.
    pub order: Vec<usize>,
    /// Degree of the spherical harmonics that the file has room for: that of the Gaussians, or the highest that the
    /// format has (3 for SOG and glTF, 2 for .ksplat, 0 for .splat). Readers see less where the format makes whole bands 0.
    pub degree: usize,
}

/// Writes `gaussians` to `out` as a file of `format`, whatever they were read from; `name` is for messages. See the
/// [module](self) for what the format keeps of them.
///
/// What this crate's reader would refuse is refused before anything is written.
///
/// # Errors
/// [`Error::BadScene`], with property, row and limit: arrays of different lengths, NaN, infinities other than those of
/// opacity and of flat axes, and what the format has no place for: positions beyond ±8388607 (SPZ) or ±1.6e38 (SOG),
/// constant coefficients beyond 3e30 (compressed PLY), no Gaussian at all (.splat, .ksplat, glTF), more than 268 million (SOG) or 2³²
/// (SPZ, .ksplat). For SPZ and SOG, Gaussians so much alike that the file would pass for a decompression bomb. [`Error::Io`]
/// where `out` fails.
pub fn convert(gaussians: &Gaussians, format: Format, name: &Path, out: &mut dyn Write) -> Result<Written> {
    let file = prepare(gaussians, format).map_err(|reason| bad(name, reason))?;
    file.write(out).map_err(Error::io(name))?;
    Ok(file.written())
}

/// Writes `gaussians` as a file at `path`, whole or not at all; its name need not say the format.
///
/// # Errors
/// Those of [`convert`] and of [`write_whole`].
pub fn convert_to(gaussians: &Gaussians, format: Format, path: &Path) -> Result<Written> {
    let file = prepare(gaussians, format).map_err(|reason| bad(path, reason))?;
    write_whole(path, |out| file.write(out))?;
    Ok(file.written())
}

/// A file that only has to be written; nothing but that can fail.
struct Prepared<'a> {
    gaussians: &'a Gaussians,
    format: Format,
    degree: usize,
    order: Vec<usize>,
    /// Everything for compressed formats, whose bytes are few; the others are written row by row.
    bytes: Vec<u8>,
}

fn prepare(gaussians: &Gaussians, format: Format) -> Result<Prepared<'_>, String> {
    refuse::check(gaussians, format)?;
    let degree = match format {
        Format::Sog => sog::degree(gaussians),
        _ => gaussians.sh.degree.min(most_degree(format)),
    };
    let as_they_are = || (0..gaussians.len()).collect();
    let (order, bytes) = match format {
        Format::Ply | Format::Ksplat | Format::Gltf | Format::Glb => (as_they_are(), Vec::new()),
        Format::Spz => (as_they_are(), spz::encode(gaussians)?),
        Format::CompressedPly => (morton(&gaussians.positions), Vec::new()),
        Format::Splat => (splat::order(gaussians)?, Vec::new()),
        Format::Sog => {
            let order = morton(&gaussians.positions);
            let bytes = sog::encode(gaussians, &order)?;
            (order, bytes)
        }
    };
    Ok(Prepared {
        gaussians,
        format,
        degree,
        order,
        bytes,
    })
}

/// Highest degree of spherical harmonics that files of a format have room for.
pub(crate) fn most_degree(format: Format) -> usize {
    match format {
        Format::Splat => 0,
        Format::Sog => 3,
        Format::Ksplat => crate::ksplat::MAX_DEGREE,
        Format::Gltf | Format::Glb => crate::gltf::primitive::MAX_DEGREE,
        Format::Ply | Format::CompressedPly | Format::Spz => crate::MAX_DEGREE,
    }
}

impl Prepared<'_> {
    fn write(&self, mut out: &mut dyn Write) -> io::Result<()> {
        match self.format {
            Format::Ply => ply::write_standard(self.gaussians, &self.gaussians.sh, &mut out),
            Format::CompressedPly => packed::write(self.gaussians, &self.order, out),
            Format::Splat => splat::write(self.gaussians, &self.order, out),
            Format::Ksplat => ksplat::write(self.gaussians, self.degree, out),
            Format::Gltf => gltf::write_text(self.gaussians, self.degree, out),
            Format::Glb => gltf::write_binary(self.gaussians, self.degree, out),
            Format::Spz | Format::Sog => out.write_all(&self.bytes),
        }
    }

    fn written(self) -> Written {
        Written {
            format: self.format,
            order: self.order,
            degree: self.degree,
        }
    }
}

#[cfg(test)]
pub(crate) mod tests;
