//! A picture in memory: the common currency of renderer, quality and extraction.

/// Pixels of a rendered or loaded picture, rows top to bottom, RGB innermost, nominally in [0, 1].
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `height * width * 3` values.
    pub pixels: Vec<f32>,
}

impl Picture {
    /// The picture as an 8-bit file holds it: clamped to [0, 1] and rounded to 1/255.
    pub fn to_8_bit(&self) -> Picture {
        let pixels = self
            .pixels
            .iter()
            .map(|v| (v.clamp(0.0, 1.0) * 255.0).round() / 255.0)
            .collect();
        Picture { pixels, ..*self }
    }
}
