//! The 16 bytes that headers of all versions begin with, and the sizes of the sections that follow from them.
use crate::gaussians::MAX_DEGREE;

/// The first bytes of every header.
pub(crate) const MAGIC: [u8; 4] = *b"NGSP";
/// Bytes of the header of versions 2 and 3, and of the part of it that version 4 begins with.
pub(crate) const HEADER: usize = 16;
/// More bits after the point than the 24 that a coordinate has make no sense.
const MAX_FRACTIONAL_BITS: u8 = 24;
/// Sections in the order of all versions.
pub(super) const SECTIONS: [&str; 6] = ["positions", "alphas", "colours", "scales", "rotations", "harmonics"];
/// Index of the colours in [`SECTIONS`].
pub(super) const COLOURS: usize = 2;
/// Index of the spherical harmonics in [`SECTIONS`].
pub(super) const HARMONICS: usize = 5;

/// What a header says of the Gaussians.
#[derive(Clone, Copy, Debug)]
pub(super) struct Header {
    /// 2, 3 or 4.
    pub version: u32,
    /// Gaussians promised; compare [`Header::sections`] with the file before believing it.
    pub points: usize,
    /// Degree of the spherical harmonics, 0 to [`MAX_DEGREE`].
    pub degree: usize,
    /// Binary digits of a coordinate that are after its point.
    pub fractional_bits: u8,
}

impl Header {
    /// Understands the beginning of a header: of one of `versions` in a container of that `kind`. `Err` is the reason.
    pub fn parse(bytes: &[u8; HEADER], versions: &[u32], kind: &str) -> Result<Header, String> {
        if !bytes.starts_with(&MAGIC) {
            return Err(format!(
                "not an SPZ scene: {kind} that begins with {:?} instead of \"NGSP\"",
                String::from_utf8_lossy(&bytes[..4])
            ));
        }
        let version = word(bytes, 4);
        if !versions.contains(&version) {
            return Err(format!(
                "SPZ version {version} in {kind}; versions 2 and 3 are read from gzip streams, version 4 from zstd streams"
            ));
        }
        let [degree, fractional_bits] = [bytes[12], bytes[13]];
        if usize::from(degree) > MAX_DEGREE {
            return Err(format!(
                "spherical harmonics of degree {degree}; the limit is {MAX_DEGREE}"
            ));
        }
        if fractional_bits > MAX_FRACTIONAL_BITS {
            return Err(format!(
                "coordinates with {fractional_bits} fractional bits; the limit is {MAX_FRACTIONAL_BITS}"
            ));
        }
        Ok(Header {
            version,
            points: word(bytes, 8) as usize,
            degree: degree.into(),
            fractional_bits,
        })
    }

    /// Bytes of a rotation.
    pub fn rotation_bytes(&self) -> usize {
        if self.version == 2 { 3 } else { 4 }
    }

    /// Bytes of the spherical harmonics of one Gaussian.
    pub fn harmonics_bytes(&self) -> usize {
        3 * ((self.degree + 1) * (self.degree + 1) - 1)
    }

    /// Bytes of the sections, in the order of [`SECTIONS`].
    pub fn sections(&self) -> [u64; 6] {
        [9, 1, 3, 3, self.rotation_bytes(), self.harmonics_bytes()].map(|bytes| bytes as u64 * self.points as u64)
    }

    /// Cuts `content`, which is as long as all sections together, into them.
    pub fn cut<'a>(&self, mut content: &'a [u8]) -> [&'a [u8]; 6] {
        self.sections().map(|bytes| {
            let (section, rest) = content.split_at(bytes as usize);
            content = rest;
            section
        })
    }
}

/// The little-endian 32 bits at `place`.
pub(super) fn word(bytes: &[u8], place: usize) -> u32 {
    u32::from_le_bytes(std::array::from_fn(|i| bytes[place + i]))
}
