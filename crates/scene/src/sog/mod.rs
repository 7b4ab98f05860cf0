//! SOG files of PlayCanvas: a ZIP of `meta.json` and lossless WebP pictures, a pixel a Gaussian, of versions 1 and 2.
//!
//! A written file differs from the one read in nothing but the red, green and blue of the picture `sh0`: indices into
//! a table of 256 values a channel, which stays as it is. Higher bands are a palette that Gaussians share, and stay
//! as they are too. Every other entry of the ZIP keeps its bytes.
mod archive;
pub(crate) mod budget;
pub(crate) mod codebook;
pub(crate) mod decode;
mod folder;
mod index;
mod json;
mod level;
pub(crate) mod meta;
pub(crate) mod palette;
pub(crate) mod picture;
mod streamed;

pub(crate) use folder::read as read_folder;
pub(crate) use streamed::INDEX;
pub use streamed::StreamedSog;

use crate::container::{Container, Format};
use crate::error::bad;
use crate::gaussians::{Gaussians, Sh};
use crate::ignored::{BadRows, Ignored, RowFilter};
use crate::{Error, Result};
use archive::Archive;
use budget::Budget;
use codebook::Codebook;
use meta::{Meta, Role};
use palette::Palette;
use picture::Picture;
use std::io::{self, BufReader, Read, Write};
use std::path::Path;
use std::sync::Arc;

/// How a ZIP starts whose first entry starts with its first byte.
const ZIP: &[u8] = b"PK\x03\x04";

/// Largest `meta.json`: four tables of 256 numbers are 40 KiB at most.
const MAX_META: u64 = 1 << 20;

/// A SOG as it was read.
#[derive(Debug)]
struct Sog {
    /// The ZIP.
    file: Vec<u8>,
    /// Name of the entry of the picture of colours.
    sh0: String,
    /// That picture: three indices of [`Sog::dc`], and opacity.
    colours: Picture,
    /// What the indices stand for.
    dc: [Codebook; 3],
    /// Higher bands.
    palette: Option<Palette>,
    ignored: Ignored,
}

/// Whether a file that starts so is a SOG, or the `meta.json` of one that is a folder, which [`read`] explains.
pub(crate) fn detect(first: &[u8]) -> bool {
    first.starts_with(ZIP) || loose(first)
}

/// Whether a file that starts so is a `meta.json` without its pictures, or the index of a streamed SOG.
fn loose(first: &[u8]) -> bool {
    let has = |word: &[u8]| first.windows(word.len()).any(|part| part == word);
    first.trim_ascii_start().starts_with(b"{") && (has(b"\"means\"") || has(b"\"lodLevels\""))
}

/// Reads a SOG of `size` bytes from its first byte, with `memory` bytes for it and what is in it; `path` is for messages.
pub(crate) fn read(
    path: &Path,
    source: &mut BufReader<impl Read>,
    size: u64,
    bad_rows: BadRows,
    memory: u64,
) -> Result<(Gaussians, Arc<dyn Container>)> {
    let does_not_fit = || Error::DoesNotFit {
        path: path.into(),
        memory,
    };
    if size > memory {
        return Err(does_not_fit());
    }
    let mut file = Vec::new();
    usize::try_from(size)
        .ok()
        .and_then(|size| file.try_reserve_exact(size).ok())
        .ok_or_else(|| bad(path, format!("{size} bytes do not fit in memory")))?;
    source.take(size).read_to_end(&mut file).map_err(Error::io(path))?;
    let mut budget = Budget::within(file.len() as u64, memory);
    let (gaussians, sog) = parse(file, bad_rows, &mut budget).map_err(|reason| match budget.lacks_memory() {
        true => does_not_fit(),
        false => bad(path, reason),
    })?;
    Ok((gaussians, Arc::new(sog)))
}

fn parse(file: Vec<u8>, bad_rows: BadRows, budget: &mut Budget) -> Result<(Gaussians, Sog), String> {
    if !file.starts_with(ZIP) {
        return Err(match streamed::announced(&file) {
            true => "the lod-meta.json of a streamed SOG without its files; only the worker's commands take it, or its folder",
            false => "the meta.json of an SOG without its pictures; give its folder, or bundle it into one .sog file",
        }
        .into());
    }
    let mut archive = Archive::open(&file)?;
    let meta = archive.unpack("meta.json", "meta.json", MAX_META, budget)?;
    let meta = meta::parse(&meta).map_err(|reason| format!("meta.json: {reason}"))?;
    let mut sieve = RowFilter::new(bad_rows);
    let mut size = None;
    let mut picture = |role: Role, name: &str, budget: &mut Budget| -> Result<Picture, String> {
        let webp = archive.unpack(name, role.name(), u64::MAX, budget)?;
        let picture = Picture::decode(webp, |this| {
            if role != Role::Centroids {
                role.check_size(this, *size.get_or_insert(this), meta.count)?;
            }
            budget.spend(this.bytes())
        });
        picture.map_err(|reason| format!("picture {}: {reason}", role.name()))
    };
    let palette = match &meta.rest {
        None => None,
        Some(rest) => {
            let labels = picture(Role::Labels, &rest.labels, budget)?;
            let centroids = picture(Role::Centroids, &rest.centroids, budget)?;
            Palette::decode(rest, &labels, &centroids, meta.count as usize, &mut sieve)?
        }
    };
    let degree = palette.as_ref().map_or(0, Palette::degree);
    budget.spend(meta.count.saturating_mul(decode::bytes_per_gaussian(degree)))?;
    let count = meta.count as usize;
    let positions = decode::positions(
        &picture(Role::Lower, &meta.lower, budget)?,
        &picture(Role::Upper, &meta.upper, budget)?,
        &meta.ranges,
        count,
    );
    let quats = picture(Role::Quats, &meta.quats, budget)?;
    let rotations = decode::rotations(&quats, count, &mut sieve)?;
    let scales = picture(Role::Scales, &meta.scales, budget)?;
    let log_scales = decode::log_scales(&scales, &meta.sizes, count, &mut sieve)?;
    let colours = picture(Role::Sh0, &meta.sh0, budget)?;
    let mut gaussians = Gaussians {
        positions,
        rotations,
        log_scales,
        opacity_logits: decode::opacity_logits(&colours, &meta.opacity, count),
        sh: decode::sh(&colours, &meta.dc, palette.as_ref(), count, &mut sieve)?,
    };
    let ignored = sieve.finish();
    ignored.take_from(&mut gaussians);
    let Meta { sh0, dc, .. } = meta;
    // What cannot be written again is refused now, not when its marks are to be saved.
    archive::replace(&file, &sh0, b"")?;
    let sog = Sog {
        file,
        sh0,
        colours,
        dc,
        palette,
        ignored,
    };
    Ok((gaussians, sog))
}

impl Container for Sog {
    fn format(&self) -> Format {
        Format::Sog
    }

    fn bytes(&self) -> usize {
        // The palette is what else is kept; it is small beside the pictures.
        self.file.len() + self.colours.bytes()
    }

    fn exact(&self) -> bool {
        false
    }

    /// Constant colour only: Gaussians share the palette of higher bands.
    fn learnable_degree(&self, _scene: usize) -> usize {
        0
    }

    fn quantize_colors(&self, row: usize, coefficients: &mut [f32]) {
        let row = self.ignored.file_row(row);
        let texel = self.colours.texel(row);
        for ((value, byte), table) in coefficients.iter_mut().zip(texel).zip(&self.dc) {
            *value = table.value(table.nearest(byte, *value));
        }
        if let Some(palette) = &self.palette {
            // Bands that only ignored rows use are in the palette and not in the scene.
            for (value, own) in coefficients[3..].iter_mut().zip(palette.row(row)) {
                *value = *own;
            }
        }
    }

    fn ignored(&self) -> Option<&Ignored> {
        self.ignored.if_any()
    }

    fn write(&self, sh: &Sh, out: &mut dyn Write) -> io::Result<()> {
        let mut colours = self.colours.clone();
        let rows = self.ignored.spread(sh).enumerate();
        for (row, coefficients) in rows.filter_map(|(row, colour)| Some((row, colour?))) {
            let texel = colours.texel_mut(row);
            for ((byte, value), table) in texel.iter_mut().zip(coefficients).zip(&self.dc) {
                *byte = table.nearest(*byte, *value);
            }
        }
        if colours == self.colours {
            return out.write_all(&self.file);
        }
        let webp = colours.encode()?;
        let file = archive::replace(&self.file, &self.sh0, &webp).map_err(io::Error::other)?;
        out.write_all(&file)
    }
}

#[cfg(test)]
mod tests;
