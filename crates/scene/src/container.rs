//! What a file is besides its Gaussians: how it is written again with other colours, and which colours it can keep.
use crate::atomic_write::write_whole;
use crate::{Ignored, Result, Sh};
use std::fmt::Debug;
use std::io::{self, Write};
use std::path::Path;

/// The file formats of scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// The PLY of the reference implementation: ASCII or binary of either byte order.
    Ply,
    /// SuperSplat's PLY of chunks and packed integers.
    CompressedPly,
    /// Niantic's SPZ.
    Spz,
    /// 32 bytes a Gaussian without a header.
    Splat,
    /// mkkellogg's sections of rows, with or without harmonics.
    Ksplat,
    /// PlayCanvas' pictures in a ZIP.
    Sog,
    /// glTF with KHR_gaussian_splatting, as JSON.
    Gltf,
    /// The same in one binary file.
    Glb,
}

impl Format {
    /// What files of the format end in, after the last dot of the name that is the user's.
    pub fn extension(self) -> &'static str {
        match self {
            Format::Ply => "ply",
            Format::CompressedPly => "compressed.ply",
            Format::Spz => "spz",
            Format::Splat => "splat",
            Format::Ksplat => "ksplat",
            Format::Sog => "sog",
            Format::Gltf => "gltf",
            Format::Glb => "glb",
        }
    }
}

/// A file as it was read.
///
/// What `keep` says is what comes back: reading what [`write`](Self::write) wrote gives the coefficients of the
/// scene after [`keep`](Self::keep), bit by bit, and everything else as it was. Colours that are all as they were read
/// are written as they were, even where `keep` says otherwise: a format may have other steps for a scene as soon as
/// one of its colours changes.
pub(crate) trait Container: Debug + Send + Sync {
    /// Which format.
    fn format(&self) -> Format;

    /// Bytes of the file that are in memory.
    fn bytes(&self) -> usize;

    /// Whether [`keep`](Self::keep) leaves every finite coefficient as it is.
    fn exact(&self) -> bool {
        true
    }

    /// Highest degree whose coefficients can be changed for each Gaussian by itself, at most that of the scene.
    fn learnable_degree(&self, scene: usize) -> usize {
        scene
    }

    /// Replaces the coefficients of Gaussian `row`, laid out as a row of [`Sh`], by what the file keeps of them.
    fn quantize_colors(&self, row: usize, coefficients: &mut [f32]) {
        let _ = (row, coefficients);
    }

    /// Rows of the file that are no Gaussians of the scene, where some were ignored. They are written as they were.
    fn ignored(&self) -> Option<&Ignored> {
        None
    }

    /// Whether everything is in one file; others can't be written by [`write`](Self::write).
    fn is_one_file(&self) -> bool {
        true
    }

    /// Writes the file at `path` with the colours `sh`, whole or not at all, and those that it refers to beside it.
    fn write_at(&self, sh: &Sh, path: &Path) -> Result<()> {
        write_whole(path, |out| self.write(sh, out))
    }

    /// Writes the file with the colours `sh`: finite, of the degree and the rows of the scene that was read.
    fn write(&self, sh: &Sh, out: &mut dyn Write) -> io::Result<()>;
}
