//! Lossless WebP pictures: four bytes a pixel, rows from the top.
use super::meta::Role;
use image_webp::{ColorType, EncoderParams, WebPDecoder, WebPEncoder};
use std::io::{self, Cursor};

/// Width and height in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Size {
    fn pixels(self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// Bytes of the pixels.
    pub fn bytes(self) -> u64 {
        4 * self.pixels()
    }
}

impl Role {
    /// Whether a picture of a pixel a Gaussian may have the size `this`, the first such having had the size `first`.
    pub fn check_size(self, this: Size, first: Size, count: u64) -> Result<(), String> {
        let Size { width, height } = this;
        if this.pixels() < count {
            return Err(format!("{width} x {height} pixels are too few for {count} Gaussians"));
        }
        if this != first {
            let (x, y) = (first.width, first.height);
            return Err(format!("{width} x {height} pixels, others {x} x {y}"));
        }
        Ok(())
    }
}

/// A decoded picture.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Picture {
    size: Size,
    rgba: Vec<u8>,
}

impl Picture {
    /// A picture of these pixels, four bytes each and as many as `size` says.
    pub fn new(size: Size, rgba: Vec<u8>) -> Picture {
        debug_assert_eq!(size.bytes(), rgba.len() as u64);
        Picture { size, rgba }
    }

    /// Memory of its pixels.
    pub fn bytes(&self) -> usize {
        self.rgba.len()
    }

    /// Decodes a WebP; `allow` sees its size before there is memory for it. `Err` says what is wrong.
    pub fn decode(mut webp: Vec<u8>, allow: impl FnOnce(Size) -> Result<(), String>) -> Result<Picture, String> {
        claim_alpha(&mut webp);
        let broken = |e| format!("not a readable WebP: {e}");
        let mut decoder = WebPDecoder::new(Cursor::new(&webp)).map_err(broken)?;
        if decoder.is_lossy() || decoder.is_animated() {
            return Err("a lossy or animated WebP; numbers survive in lossless ones only".into());
        }
        let (width, height) = decoder.dimensions();
        let size = Size { width, height };
        allow(size)?;
        let mut rgba = vec![0; size.bytes() as usize];
        decoder.read_image(&mut rgba).map_err(broken)?;
        Ok(Picture { size, rgba })
    }

    /// The picture as a WebP.
    pub fn encode(&self) -> io::Result<Vec<u8>> {
        let mut webp = Vec::new();
        let mut encoder = WebPEncoder::new(&mut webp);
        // Indices of neighbours are no gradients: predicted from each other they need 8 % more.
        let mut params = EncoderParams::default();
        params.use_predictor_transform = false;
        encoder.set_params(params);
        let Size { width, height } = self.size;
        encoder
            .encode(&self.rgba, width, height, ColorType::Rgba8)
            .map_err(io::Error::other)?;
        Ok(webp)
    }

    /// Width and height.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Red, green, blue and alpha of pixel `i`.
    pub fn texel(&self, i: usize) -> [u8; 4] {
        let at = |channel| self.rgba[4 * i + channel];
        [at(0), at(1), at(2), at(3)]
    }

    /// The same to be changed.
    pub fn texel_mut(&mut self, i: usize) -> &mut [u8] {
        &mut self.rgba[4 * i..4 * i + 4]
    }
}

/// Sets the bit by which a file says that some pixel is not opaque.
///
/// It is a hint that must not change what is decoded, but our decoder skips the alpha of files without it.
fn claim_alpha(webp: &mut [u8]) {
    let at = match webp.get(12..16) {
        Some(b"VP8L") => 24,
        Some(b"VP8X") => 20,
        _ => return,
    };
    if let Some(byte) = webp.get_mut(at) {
        *byte |= 0x10;
    }
}
