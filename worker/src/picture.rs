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

    /// The picture at one `times`-th of its size, each pixel the mean of a square of them; rows and columns that fill no
    /// square are left out.
    pub fn shrunk(&self, times: u32) -> Picture {
        if times == 1 {
            return self.clone();
        }
        let (width, height) = (self.width / times, self.height / times);
        let [n, from, to] = [times, self.width, width].map(|v| v as usize);
        let mut pixels = vec![0.0_f32; to * height as usize * 3];
        for (y, row) in self.pixels.chunks_exact(from * 3).take(n * height as usize).enumerate() {
            let out = &mut pixels[y / n * to * 3..][..to * 3];
            for (square, out) in row.chunks_exact(n * 3).zip(out.chunks_exact_mut(3)) {
                for pixel in square.chunks_exact(3) {
                    out.iter_mut().zip(pixel).for_each(|(o, p)| *o += p);
                }
            }
        }
        let share = ((n * n) as f32).recip();
        pixels.iter_mut().for_each(|p| *p *= share);
        Picture { width, height, pixels }
    }

    /// The transpose of [`Picture::shrunk`]: takes a gradient to the small picture back to one of `times` its size.
    pub fn spread(&self, times: u32) -> Picture {
        if times == 1 {
            return self.clone();
        }
        let (width, height) = (self.width * times, self.height * times);
        let n = times as usize;
        let share = ((n * n) as f32).recip();
        let mut pixels = Vec::with_capacity(self.pixels.len() * n * n);
        for row in self.pixels.chunks_exact(self.width as usize * 3) {
            let wide: Vec<f32> = row
                .chunks_exact(3)
                .flat_map(|pixel| std::iter::repeat_n(pixel, n).flatten())
                .map(|v| v * share)
                .collect();
            (0..n).for_each(|_| pixels.extend_from_slice(&wide));
        }
        Picture { width, height, pixels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: u32, height: u32, value: impl Fn(usize) -> f32) -> Picture {
        let pixels = (0..(width * height * 3) as usize).map(value).collect();
        Picture { width, height, pixels }
    }

    #[test]
    fn shrinking_averages_squares_and_spreading_is_its_transpose() {
        // Red is x, green is y, blue is 1; of 7 columns the last has no square.
        let large = picture(7, 6, |i| [(i / 3 % 7) as f32, (i / 21) as f32, 1.0][i % 3]);
        let small = large.shrunk(3);
        assert_eq!((small.width, small.height), (2, 2));
        let expected = [1.0, 1.0, 1.0, 4.0, 1.0, 1.0, 1.0, 4.0, 1.0, 4.0, 4.0, 1.0];
        for (found, expected) in small.pixels.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
        let dot = |a: &Picture, b: &Picture| -> f64 {
            let pairs = a.pixels.iter().zip(&b.pixels);
            pairs.map(|(a, b)| f64::from(*a) * f64::from(*b)).sum()
        };
        let large = picture(8, 6, |i| (i as f32 * 0.7).sin());
        let gradient = picture(4, 3, |i| (i as f32 * 1.3).cos());
        let (there, back) = (dot(&large.shrunk(2), &gradient), dot(&large, &gradient.spread(2)));
        assert!((there - back).abs() < 1e-5, "{there} {back}");
        assert_eq!(large.shrunk(1), large);
        assert_eq!(large.spread(1), large);
    }
}
