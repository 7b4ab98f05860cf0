//! Registered pictures read by a matched filter (Kay, Fundamentals of Statistical Signal Processing II, section 4.4): how much
//! of each bit's change there is in what they show otherwise than the original.
//!
//! The tower turns colours by several radians, so what compression or a filter does to them by a few hundredths it reads as
//! another mark. Here nothing turns: errors of thousands of pixels average out, at the price that only the part of a mark
//! counts that its first step has in common with it, a few hundredths a bit.
use super::bit_changes::{BitChanges, energies_of};
use super::drawn::Drawn;
use super::least_squares::{Evidence, Observations, solved};
use super::observed::Observed;
use super::reading::without_behind;
use super::tone::quadratic;
use super::{Original, Registration};
use crate::error::Result;
use crate::picture::Picture;
use crate::splat::{PreparedView, WeightCache};
use crate::view::Camera;

/// Longer side of the pictures that are compared: what is finer compression takes first.
const SIDE: u32 = 200;
/// Coverage from which on a pixel is compared.
const COVERED: f32 = 0.85;
/// Variance of a value of a plain area after compression, and what is added where the original is rough, as a share of the
/// mean square by which neighbours differ.
const PLAIN: f32 = 2.5e-4;
const ROUGH: f32 = 0.15;
/// A value this near to black or white may have been cut.
const CUT: f32 = 0.005;
/// Explanations of a difference that say nothing of bits: ten of tones and one of blur for each channel, and six of a camera
/// that is not quite right.
const NUISANCES: usize = 3 * (10 + 1) + 6;

/// A picture that was registered, as far as the filter needs it.
pub struct RegisteredPicture {
    observed: Observed,
    camera: Camera,
}

impl RegisteredPicture {
    /// Keeps a small copy.
    ///
    /// # Errors
    /// A picture without pixels.
    pub fn of(picture: &Picture, registration: &Registration) -> Result<Self> {
        let observed = Observed::of(picture, SIDE)?;
        let camera = observed.camera(&registration.camera);
        Ok(Self { observed, camera })
    }
}

impl Original<'_> {
    /// Logits of each registered picture by the matched filter; their sum is what all say together. `None` where the
    /// extractor does not read exact colours, or pictures say nothing: the first step of a mark is most of it only where
    /// colours alone are read.
    ///
    /// # Errors
    /// A failing device, or [`Error::Stopped`](crate::Error::Stopped).
    pub fn read_matched(&self, pictures: &[RegisteredPicture]) -> Result<Option<Vec<Vec<f32>>>> {
        if pictures.is_empty() || !self.engine.extractor.reads_exact_colours() {
            return Ok(None);
        }
        let mut shown = vec![0.0; self.geometry.len()];
        for picture in pictures {
            let view = self.view(picture)?;
            for (row, energy) in view.visible.iter().zip(energies_of(self.engine, &view)?) {
                shown[*row as usize] += energy;
            }
        }
        let changes = BitChanges::of(self, &shown)?;
        let mut evidence: Vec<Option<Evidence>> = Vec::with_capacity(pictures.len());
        for picture in pictures {
            evidence.push(self.observations(picture, &changes)?.evidence());
        }
        Ok(evidence
            .into_iter()
            .collect::<Option<Vec<_>>>()
            .and_then(|all| solved(&all)))
    }

    fn view(&self, picture: &RegisteredPicture) -> Result<PreparedView> {
        self.engine.stop.check()?;
        let times = picture.observed.times;
        self.geometry
            .prepare_averaged(&picture.camera, times, WeightCache::Weights)
    }

    /// What a picture shows otherwise, and what may explain it, for each value that is compared.
    fn observations(&self, picture: &RegisteredPicture, changes: &BitChanges) -> Result<Observations> {
        let observed = &picture.observed;
        let drawn = Drawn::of(self.engine, &self.geometry, &picture.camera, observed.times)?;
        let asked = changes.pictures(self.engine, &self.view(picture)?)?;
        let seen = without_behind(&observed.pixels, &drawn.coverage);
        let neighbourhood = Neighbourhood {
            colours: &drawn.colours,
            width: observed.width,
        };
        let columns = NUISANCES + asked.len() + 1;
        let (mut values, mut weights) = (Vec::new(), Vec::new());
        for pixel in (0..seen.len()).filter(|i| drawn.coverage[*i] >= COVERED) {
            let (coverage, colour) = (drawn.coverage[pixel], drawn.colours[pixel]);
            let tones = quadratic(colour.map(|v| f64::from(v / coverage)));
            // From -1 to 1, as far as sides are alike.
            let place = |i: usize, side: usize| 2.0 * i as f32 / side.max(1) as f32 - 1.0;
            let (x, y) = (pixel % observed.width, pixel / observed.width);
            let (x, y) = (place(x, observed.width), place(y, observed.height));
            let Some([across, down, blur, rough]) = neighbourhood.of(pixel) else {
                continue;
            };
            for k in 0..3 {
                if !(CUT..=1.0 - CUT).contains(&observed.pixels[pixel][k]) {
                    continue;
                }
                let first = values.len();
                values.resize(first + columns, 0.0);
                let row = &mut values[first..];
                for (value, term) in row[11 * k..].iter_mut().zip(tones) {
                    *value = term as f32;
                }
                row[11 * k + 10] = blur[k];
                let moved = [across[k], down[k]]
                    .into_iter()
                    .flat_map(|slope| [slope, slope * x, slope * y]);
                for (value, moved) in row[33..].iter_mut().zip(moved) {
                    *value = moved;
                }
                for (value, picture) in row[NUISANCES..].iter_mut().zip(&asked) {
                    *value = picture.pixels[3 * pixel + k];
                }
                row[columns - 1] = coverage * seen[pixel][k] - colour[k];
                weights.push((PLAIN + ROUGH * rough[k]).recip());
            }
        }
        Ok(Observations {
            nuisances: NUISANCES,
            columns,
            values,
            weights,
        })
    }
}

/// The original around a pixel.
struct Neighbourhood<'a> {
    colours: &'a [[f32; 3]],
    width: usize,
}

impl Neighbourhood<'_> {
    /// By how much each channel rises across and down, by how much neighbours differ in the mean, and in the mean square;
    /// `None` within two pixels of the border.
    fn of(&self, pixel: usize) -> Option<[[f32; 3]; 4]> {
        let (width, height) = (self.width, self.colours.len() / self.width.max(1));
        let (x, y) = (pixel % width, pixel / width);
        let inside = x >= 2 && y >= 2 && x + 2 < width && y + 2 < height;
        let at = |x: usize, y: usize| self.colours[y * width + x];
        inside.then(|| {
            let here = at(x, y);
            let near = [at(x + 1, y), at(x - 1, y), at(x, y + 1), at(x, y - 1)];
            let far = [at(x + 2, y), at(x - 2, y), at(x, y + 2), at(x, y - 2)];
            let each = |of: &dyn Fn(usize) -> f32| std::array::from_fn(of);
            let mean = |of: &dyn Fn(f32) -> f32, k: usize, all: &mut dyn Iterator<Item = &[f32; 3]>| {
                let (mut sum, mut count) = (0.0, 0.0);
                for colour in all {
                    sum += of(colour[k] - here[k]);
                    count += 1.0;
                }
                sum / count
            };
            [
                each(&|k| (near[0][k] - near[1][k]) / 2.0),
                each(&|k| (near[2][k] - near[3][k]) / 2.0),
                each(&|k| mean(&|d| d, k, &mut near.iter())),
                each(&|k| mean(&|d| d * d, k, &mut near.iter().chain(&far))),
            ]
        })
    }
}
