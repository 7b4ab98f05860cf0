//! What makes a scene hard to mark: little to see, dark or without colours, no room left to change a colour, thin.
use serde::Serialize;

use super::cover::{covered, share};
use crate::error::Result;
use crate::picture::Picture;

/// Values this near to black or white can be changed one way only.
const AT_END: f32 = 0.04;

/// Means over views; all figures but the first are of covered pixels. Shares, lightness and saturation are 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Difficulty {
    /// Share of the picture that the scene covers.
    pub covered: f64,
    /// Mean luma (Rec. 601).
    pub lightness: f64,
    /// Spread of colours: root mean square distance of the two chroma values (Rec. 601) from their mean.
    pub chroma_spread: f64,
    /// Mean saturation: what the least channel lacks to the largest, of the largest.
    pub saturation: f64,
    /// Share of values so near to black or white that they can be changed one way only.
    pub at_ends: f64,
    /// Spread of luma between neighbouring pixels, root mean square: texture hides a mark.
    pub texture: f64,
    /// Share of covered pixels with a neighbour that is not: 1 for lines, near 0 for a filled picture.
    pub thinness: f64,
}

impl Difficulty {
    /// Measures views, each over white and over black.
    ///
    /// # Errors
    /// [`Error::BadOption`](crate::Error::BadOption) for a view of two sizes.
    pub fn of(views: &[[Picture; 2]]) -> Result<Self> {
        let mut sums = Sums::default();
        let mut cover = 0.0;
        for [white, black] in views {
            let mask = covered(white, black)?;
            cover += share(&mask);
            sums.add(white, &mask);
        }
        let per = |sum: f64, count: f64| if count > 0.0 { sum / count } else { 0.0 };
        let mean = |sum: f64| per(sum, sums.pixels);
        let chroma = sums.chroma.map(mean);
        let variance = mean(sums.chroma_squares) - chroma.iter().map(|c| c * c).sum::<f64>();
        Ok(Self {
            covered: per(cover, views.len() as f64),
            lightness: mean(sums.luma),
            chroma_spread: variance.max(0.0).sqrt(),
            saturation: mean(sums.saturation),
            at_ends: mean(sums.at_ends) / 3.0,
            texture: per(sums.steps, sums.neighbours).sqrt(),
            thinness: mean(sums.border),
        })
    }
}

/// Sums over covered pixels.
#[derive(Default)]
struct Sums {
    pixels: f64,
    luma: f64,
    chroma: [f64; 2],
    chroma_squares: f64,
    saturation: f64,
    at_ends: f64,
    border: f64,
    steps: f64,
    neighbours: f64,
}

impl Sums {
    fn add(&mut self, picture: &Picture, mask: &[bool]) {
        let (width, height) = (picture.width as usize, picture.height as usize);
        let luma = |pixel: usize| {
            let [r, g, b] = [0, 1, 2].map(|c| f64::from(picture.pixels[3 * pixel + c]));
            0.299 * r + 0.587 * g + 0.114 * b
        };
        for pixel in (0..mask.len()).filter(|pixel| mask[*pixel]) {
            let rgb = [0, 1, 2].map(|c| picture.pixels[3 * pixel + c]);
            let light = luma(pixel);
            let chroma = [(f64::from(rgb[2]) - light) / 1.772, (f64::from(rgb[0]) - light) / 1.402];
            let (least, most) = rgb
                .iter()
                .fold((f32::INFINITY, 0.0f32), |(a, b), v| (a.min(*v), b.max(*v)));
            self.pixels += 1.0;
            self.luma += light;
            for (sum, value) in self.chroma.iter_mut().zip(chroma) {
                *sum += value;
                self.chroma_squares += value * value;
            }
            self.saturation += if most > 0.0 {
                f64::from((most - least) / most)
            } else {
                0.0
            };
            self.at_ends += rgb.iter().filter(|v| !(AT_END..=1.0 - AT_END).contains(*v)).count() as f64;
            let (x, y) = (pixel % width, pixel / width);
            let around = [
                (x > 0).then(|| pixel - 1),
                (x + 1 < width).then_some(pixel + 1),
                (y > 0).then(|| pixel - width),
                (y + 1 < height).then_some(pixel + width),
            ];
            // The end of the picture is no end of the scene.
            self.border += f64::from(around.iter().flatten().any(|neighbour| !mask[*neighbour]));
            for neighbour in around.into_iter().flatten().filter(|neighbour| mask[*neighbour]) {
                self.steps += (luma(neighbour) - light).powi(2);
                self.neighbours += 1.0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A view of a block of colours in the middle of 8 by 8 pixels, so many pixels wide and high.
    fn view(wide: usize, high: usize, colour: impl Fn(usize) -> [f32; 3]) -> [Picture; 2] {
        [1.0, 0.0].map(|ground| Picture {
            width: 8,
            height: 8,
            pixels: (0..64)
                .flat_map(|i| {
                    if i % 8 < wide && i / 8 < high {
                        colour(i)
                    } else {
                        [ground; 3]
                    }
                })
                .collect(),
        })
    }

    #[test]
    fn a_dark_grey_thing_that_fills_little_is_told() {
        let found = Difficulty::of(&[view(8, 4, |_| [0.1; 3])]).unwrap();
        assert!((found.covered - 0.5).abs() < 1e-9 && (found.lightness - 0.1).abs() < 1e-6);
        assert!(found.chroma_spread < 1e-6 && found.saturation == 0.0 && found.texture < 1e-6);
        // One row of four touches what is not covered.
        assert!((found.thinness - 0.25).abs() < 1e-9);
        assert_eq!(found.at_ends, 0.0);
        let line = Difficulty::of(&[view(8, 1, |_| [0.01, 0.5, 0.99])]).unwrap();
        assert_eq!(line.thinness, 1.0);
        assert!((line.at_ends - 2.0 / 3.0).abs() < 1e-9 && line.saturation > 0.9);
    }

    #[test]
    fn many_colours_spread_and_stripes_have_texture() {
        let two = |i: usize| {
            if i.is_multiple_of(2) {
                [0.8, 0.2, 0.2]
            } else {
                [0.2, 0.2, 0.8]
            }
        };
        let found = Difficulty::of(&[view(8, 8, two)]).unwrap();
        // Half of the way between the two, of 0.401 in Cb and 0.349 in Cr.
        assert!((found.chroma_spread - 0.266).abs() < 1e-3, "{found:?}");
        assert!(found.texture > 0.05 && found.thinness == 0.0, "{found:?}");
        assert_eq!(Difficulty::of(&[]).unwrap(), Difficulty::default());
        assert_eq!(Difficulty::of(&[view(0, 0, two)]).unwrap(), Difficulty::default());
    }
}
