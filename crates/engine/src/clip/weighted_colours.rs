//! Colours that stand for many pixels of a picture each.
use super::config::Normalization;

/// A histogram whose bins have the means of what is in them: colours, and how often each is there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WeightedColours {
    /// Red, green and blue in [0, 1].
    pub colours: Vec<[f32; 3]>,
    /// How many pixels each stands for.
    pub counts: Vec<f32>,
}

impl WeightedColours {
    /// Planes `[3][n]`, from which mean and deviation were removed.
    pub(super) fn normalized(&self, normalization: &Normalization) -> Vec<f32> {
        let Normalization { mean, std } = normalization;
        let plane = |c: usize| self.colours.iter().map(move |colour| (colour[c] - mean[c]) / std[c]);
        (0..3).flat_map(plane).collect()
    }
}
