//! How much logits look like those of a mark, whatever it says.
//!
//! A mark pushes all bits of a picture away from 0, about equally far. Logits of an unmarked picture, or of one whose tones
//! are wrong, spread around 0: fewer are large, and some are small. Nothing here knows a message, so that a reading may be
//! chosen by it without being paid for.
/// Deviations above the middle of all that was tried from which on a reading is clearly a mark's: what is tried a few hundred
/// times reaches two to three.
const CLEAR: f64 = 3.0;
/// Deviations from which on it is certain.
const CERTAIN: f64 = 4.5;

/// How much it counts that all logits are of one size, besides what that size is. Plain colours make large logits, too.
const EVEN: f64 = 1.0;

/// The logarithm of the size of logits: of the mean of their roots, squared, which is largest where all are alike; and of
/// its ratio to their root mean square. Not finite where one isn't.
pub(super) fn of_logits(logits: &[f32]) -> f64 {
    let count = logits.len().max(1) as f64;
    let roots: f64 = logits.iter().map(|v| f64::from(v.abs()).sqrt()).sum();
    let squares: f64 = logits.iter().map(|v| f64::from(*v).powi(2)).sum();
    let size = 2.0 * (roots / count).ln();
    size + EVEN * (size - 0.5 * (squares / count).ln())
}

/// How scores of readings are spread that are nearly all wrong.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spread {
    middle: f64,
    deviation: f64,
}

impl Spread {
    /// That of these; `None` of too few.
    pub fn of(scores: impl Iterator<Item = f64>) -> Option<Self> {
        let mut scores: Vec<f64> = scores.collect();
        if scores.len() < 20 {
            return None;
        }
        scores.sort_by(f64::total_cmp);
        let at = |share: f64| scores[(share * (scores.len() - 1) as f64) as usize];
        Some(Self {
            middle: at(0.5),
            // The middle half of a normal distribution is 1.349 deviations wide.
            deviation: (at(0.75) - at(0.25)) / 1.349,
        })
    }

    /// Whether a score is so far above that it is hardly one of these.
    pub fn is_clear(&self, score: f64) -> bool {
        score > self.middle + CLEAR * self.deviation
    }

    /// Whether it is so far above that the best of all that was tried and refined would not be.
    pub fn is_certain(&self, score: f64) -> bool {
        score > self.middle + CERTAIN * self.deviation
    }
}
