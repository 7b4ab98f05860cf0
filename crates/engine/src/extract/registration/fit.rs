//! How well a camera explains a picture, tones fitted along and what covers the scene left out.
use super::Original;
use super::drawn::Drawn;
use super::observed::Observed;
use super::tone::Tone;
use crate::error::Result;
use crate::view::Camera;

/// Rounds in which pixels that do not fit get less weight.
const ROUNDS: usize = 2;
/// Share of pixels that are taken to fit; twice what they leave, or this much, is where less weight begins (Huber).
const FITTING: f32 = 0.7;
const LEAST_LIMIT: f32 = 0.03;
/// Weight of no filter at all, for each pixel: a scene of one colour says little of others.
const NO_CHANGE: f64 = 1e-3;
/// Coverage from which on a pixel says something where nobody knows what is behind the scene.
const COVERED: f32 = 0.5;

/// A camera and what it explains.
#[derive(Clone, Debug)]
pub(super) struct Fit {
    pub camera: Camera,
    /// Mean squared difference a pixel, over all channels.
    pub cost: f64,
    /// Share of the variance of the pixels that count that is explained.
    pub explained: f64,
    /// Share of the picture that the original covers.
    pub covered: f64,
    /// Pixels that count.
    pixels: f64,
    on_ground: bool,
}

impl Fit {
    /// To choose among cameras; more is better. Over a ground all pixels count for all cameras alike. Else a camera that
    /// explains many must count more, but not in proportion: neighbouring pixels are alike.
    pub fn score(&self) -> f64 {
        match self.on_ground {
            true => -self.cost,
            false => -self.pixels.sqrt() * (1.0 - self.explained).max(1e-6).ln(),
        }
    }
}

/// A fit with all that is needed to better it.
pub(super) struct State {
    pub fit: Fit,
    tone: Tone<4>,
    /// What is left of each pixel.
    pub errors: Vec<[f32; 3]>,
    /// How much each counts.
    pub weights: Vec<f32>,
}

impl State {
    /// Draws the original as `camera` sees it, and compares.
    ///
    /// # Errors
    /// Those of [`Drawn::of`].
    pub fn of(original: &Original<'_>, observed: &Observed, camera: Camera) -> Result<Self> {
        let drawn = Drawn::of(original.engine, &original.geometry, &camera, observed.times)?;
        let counted: Vec<f32> = drawn
            .coverage
            .iter()
            .map(|coverage| counted(observed, *coverage))
            .collect();
        let mut weights = counted.clone();
        let mut tone = fitted(observed, &drawn, &weights);
        let mut errors = errors(observed, &drawn, &tone);
        for _ in 0..ROUNDS {
            let Some(limit) = limit(&errors, &counted) else { break };
            for ((weight, counted), error) in weights.iter_mut().zip(&counted).zip(&errors) {
                *weight = counted * (limit / norm(error).max(1e-6)).min(1.0);
            }
            tone = fitted(observed, &drawn, &weights);
            errors = self::errors(observed, &drawn, &tone);
        }
        let squares = errors.iter().map(|e| f64::from(norm(e)).powi(2)).zip(&weights);
        let left: f64 = squares.map(|(square, weight)| square * f64::from(*weight)).sum();
        let pixels: f64 = counted.iter().map(|c| f64::from(*c)).sum::<f64>().max(1e-9);
        let fit = Fit {
            camera,
            cost: left / pixels,
            explained: 1.0 - left / variance(observed, &counted).max(1e-9),
            covered: f64::from(drawn.coverage.iter().sum::<f32>()) / drawn.coverage.len() as f64,
            pixels,
            on_ground: observed.ground.is_some(),
        };
        Ok(Self {
            fit,
            tone,
            errors,
            weights,
        })
    }

    /// What another camera leaves of each pixel under the same tones.
    ///
    /// # Errors
    /// Those of [`Drawn::of`].
    pub fn errors_of(&self, original: &Original<'_>, observed: &Observed, camera: &Camera) -> Result<Vec<[f32; 3]>> {
        let drawn = Drawn::of(original.engine, &original.geometry, camera, observed.times)?;
        Ok(errors(observed, &drawn, &self.tone))
    }
}

/// How much a pixel counts of which the original covers this share.
fn counted(observed: &Observed, coverage: f32) -> f32 {
    match observed.ground {
        Some(_) => 1.0,
        None if coverage > COVERED => coverage,
        None => 0.0,
    }
}

fn terms(drawn: &Drawn, pixel: usize) -> [f64; 4] {
    let [r, g, b] = drawn.colours[pixel].map(f64::from);
    [r, g, b, f64::from(drawn.coverage[pixel])]
}

fn fitted(observed: &Observed, drawn: &Drawn, weights: &[f32]) -> Tone<4> {
    Tone::fitted(
        weights
            .iter()
            .enumerate()
            .filter(|(_, weight)| **weight > 0.0)
            .map(|(i, weight)| {
                let (seen, drawn_there) = (observed.without_ground(i, drawn.coverage[i]), drawn.colours[i]);
                let change = std::array::from_fn(|k| f64::from(seen[k] - drawn_there[k]));
                (f64::from(*weight), terms(drawn, i), change)
            }),
        NO_CHANGE,
    )
}

fn errors(observed: &Observed, drawn: &Drawn, tone: &Tone<4>) -> Vec<[f32; 3]> {
    let error = |i: usize| {
        let seen = observed.without_ground(i, drawn.coverage[i]);
        let change = tone.change(&terms(drawn, i));
        std::array::from_fn(|k| drawn.colours[i][k] + change[k] as f32 - seen[k])
    };
    (0..observed.pixels.len()).map(error).collect()
}

/// How much a pixel may leave before it counts less; `None` without pixels that count.
fn limit(errors: &[[f32; 3]], counted: &[f32]) -> Option<f32> {
    let pairs = errors.iter().zip(counted);
    let mut sizes: Vec<f32> = pairs
        .filter(|(_, counted)| **counted > 0.0)
        .map(|(error, _)| norm(error))
        .collect();
    let place = (sizes.len() as f32 * FITTING) as usize;
    (place < sizes.len()).then(|| (2.0 * *sizes.select_nth_unstable_by(place, f32::total_cmp).1).max(LEAST_LIMIT))
}

/// Sum of squared distances of the pixels that count from their mean.
fn variance(observed: &Observed, counted: &[f32]) -> f64 {
    let (mut total, mut sum, mut squares) = (0.0, [0.0; 3], 0.0);
    for (pixel, counted) in observed.pixels.iter().zip(counted) {
        let weight = f64::from(*counted);
        total += weight;
        for (sum, value) in sum.iter_mut().zip(pixel.map(f64::from)) {
            *sum += weight * value;
            squares += weight * value * value;
        }
    }
    squares - sum.iter().map(|s| s * s).sum::<f64>() / total.max(1e-9)
}

fn norm(error: &[f32; 3]) -> f32 {
    (error[0] * error[0] + error[1] * error[1] + error[2] * error[2]).sqrt()
}
