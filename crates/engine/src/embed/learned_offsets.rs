//! The learned offsets: changes of the spherical harmonics of Gaussians that views show, quantized as the file keeps them.
use rayon::prelude::*;

use crate::scene::{Scene, Sh};
use crate::splat::{Changes, Learnable};

/// Slots that one task quantises.
const CHUNK: usize = 512;

/// Learned changes of a scene's colours.
#[derive(Clone, Debug, PartialEq)]
pub struct LearnedOffsets {
    /// Which coefficients they are for.
    pub learnable: Learnable,
    /// The changes as the optimiser has them, `[slots][columns]`.
    pub values: Vec<f32>,
    /// The changes as the scene's file keeps them, where it does not keep them as they are.
    kept: Option<Vec<f32>>,
}

impl LearnedOffsets {
    /// No changes yet.
    pub fn new(scene: &Scene, learnable: Learnable) -> Self {
        let values = vec![0.0; learnable.len()];
        let mut learned = Self {
            kept: (!scene.exact()).then(|| values.clone()),
            values,
            learnable,
        };
        learned.quantize(scene);
        learned
    }

    /// The changes that pictures of the written file will show. What the file would round away is not learned from:
    /// the gradient is taken at what it keeps, and moves what the optimiser has (a straight-through estimator).
    pub fn changes(&self) -> Changes<'_> {
        Changes {
            learnable: &self.learnable,
            values: self.kept.as_ref().unwrap_or(&self.values),
        }
    }

    /// Makes all changes smaller or larger by a factor.
    pub fn scale(&mut self, factor: f32, scene: &Scene) {
        self.values.iter_mut().for_each(|v| *v *= factor);
        self.quantize(scene);
    }

    /// To be called after the values have changed: works out anew what the file keeps of them.
    pub fn quantize(&mut self, scene: &Scene) {
        let Some(kept) = &mut self.kept else {
            return;
        };
        let (columns, stride) = (self.learnable.columns(), scene.gaussians.sh.per_gaussian());
        let tasks = kept
            .par_chunks_mut(CHUNK * columns)
            .zip(self.values.par_chunks(CHUNK * columns))
            .zip(self.learnable.rows().par_chunks(CHUNK));
        tasks.for_each(|((kept, values), rows)| {
            let mut colour = vec![0.0; stride];
            let slots = kept.chunks_exact_mut(columns).zip(values.chunks_exact(columns));
            for ((kept, values), &row) in slots.zip(rows) {
                let at = row as usize * stride;
                let original = &scene.gaussians.sh.coefficients[at..at + stride];
                colour.copy_from_slice(original);
                colour.iter_mut().zip(values).for_each(|(c, v)| *c += v);
                scene.quantize_colors(row as usize, &mut colour);
                for (kept, (now, before)) in kept.iter_mut().zip(colour.iter().zip(original)) {
                    *kept = now - before;
                }
            }
        });
    }

    /// The scene's colours with the changes on them, as the optimiser has them: what [`Scene::write`] is to be given.
    pub fn colours(&self, original: &Sh) -> Sh {
        self.with(original, &self.values)
    }

    fn with(&self, original: &Sh, values: &[f32]) -> Sh {
        let mut colours = original.clone();
        let (columns, stride) = (self.learnable.columns(), original.per_gaussian());
        for (values, &row) in values.chunks_exact(columns).zip(self.learnable.rows()) {
            let at = row as usize * stride;
            let changed = &mut colours.coefficients[at..at + columns];
            changed.iter_mut().zip(values).for_each(|(c, v)| *c += v);
        }
        colours
    }

    /// The scene's colours as the written file will show them.
    pub fn kept_colours(&self, original: &Sh) -> Sh {
        self.with(original, self.changes().values)
    }

    /// Gaussians that the written file shows in other colours than before. A change that is lost in the rounding of a
    /// much larger coefficient is none.
    pub fn changed(&self, original: &Sh) -> usize {
        let (columns, stride) = (self.learnable.columns(), original.per_gaussian());
        let slots = self.changes().values.chunks_exact(columns).zip(self.learnable.rows());
        let differs = |(values, row): &(&[f32], &u32)| {
            let coefficients = &original.coefficients[**row as usize * stride..];
            values.iter().zip(coefficients).any(|(v, c)| c + v != *c)
        };
        slots.filter(differs).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::sample;

    #[test]
    fn only_learned_rows_and_degrees_change() {
        let scene = sample(4, 1, 1).unwrap();
        let mut learned = LearnedOffsets::new(&scene, Learnable::new(&[false, true, false, true], 0));
        assert_eq!(learned.values.len(), 6);
        learned.values.copy_from_slice(&[0.5, 0.0, 0.0, 0.0, 0.0, 0.0]);
        learned.quantize(&scene);
        let original = &scene.gaussians.sh;
        let colours = learned.colours(original);
        let different: Vec<usize> = (0..48)
            .filter(|i| colours.coefficients[*i] != original.coefficients[*i])
            .collect();
        assert_eq!(different, [12]);
        assert_eq!(colours.coefficients[12], original.coefficients[12] + 0.5);
        assert_eq!(learned.changed(original), 1);
        // Lost beside a coefficient of usual size.
        learned.values[3] = original.coefficients[36].abs() * 1e-9;
        assert!(learned.values[3] > 0.0);
        assert_eq!(learned.changed(original), 1);
        assert_eq!(learned.changes().values, learned.values);
    }
}
