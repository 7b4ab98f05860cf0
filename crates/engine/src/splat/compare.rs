//! How far a rasteriser is from [`reference`]: its pictures pixel by pixel, its gradients by four measures that must hold
//! together, because each alone can be fooled. For tests.
use super::{Learnable, Rasterizer, WeightCache, prepare, reference, sh};
use crate::error::Result;
use crate::scene::Gaussians;
use crate::view::Camera;

/// Most that a pixel may be off where no decision hangs on the last digits, and a gradient by each of its measures.
const LIMIT: f64 = 1e-4;
/// Most that a pixel may be off where one does: 1/255 a decision, of which there may be a few.
const UNCERTAIN_LIMIT: f64 = 0.02;
/// Largest share of pixels where one may.
const MOST_UNCERTAIN: f64 = 0.05;

/// Distance of one view of a scene, and of the gradient through it, from the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agreement {
    /// Largest difference of a value of the picture where no decision hangs on the last digits; infinite if any value is
    /// not finite.
    pub worst: f64,
    /// The same where one does ([`reference::Rendering::uncertain`]).
    pub worst_uncertain: f64,
    /// Share of pixels where one does.
    pub uncertain: f64,
    /// Of the gradient to all coefficients, for a gradient to the picture that is 0 at uncertain pixels.
    pub gradient: GradientError,
}

impl Agreement {
    /// Draws `gaussians` with `rasterizer` and with the reference.
    ///
    /// # Errors
    /// Those of [`prepare`] and of the rasteriser.
    pub fn of(
        rasterizer: &dyn Rasterizer,
        cache: WeightCache,
        gaussians: &Gaussians,
        camera: &Camera,
        background: [f32; 3],
    ) -> Result<Self> {
        let view = prepare(gaussians, camera, cache)?;
        let colours = sh::colours(&gaussians.sh, None, &view);
        let picture = rasterizer.render(&view, &colours, background)?;
        let want = reference::render(gaussians, camera, background.map(f64::from));
        let (mut worst, mut worst_uncertain) = (0.0f64, 0.0f64);
        for (i, (got, want_value)) in picture.pixels.iter().zip(&want.pixels).enumerate() {
            let error = (f64::from(*got) - want_value).abs();
            let error = if error.is_finite() { error } else { f64::INFINITY };
            let worst = if want.uncertain[i / 3] {
                &mut worst_uncertain
            } else {
                &mut worst
            };
            *worst = worst.max(error);
        }
        // Numbers of both signs that repeat in no simple way; not 0 in the mean, so that little cancels.
        let picture_gradient: Vec<f32> = (0..want.pixels.len())
            .map(|i| match want.uncertain[i / 3] {
                true => 0.0,
                false => (i as f32 * 0.61).sin() + 0.3,
            })
            .collect();
        let double: Vec<f64> = picture_gradient.iter().map(|v| f64::from(*v)).collect();
        let colour_gradient = rasterizer.backward(&view, &picture_gradient)?;
        let mut got = vec![0.0; gaussians.sh.coefficients.len()];
        sh::backward(
            &Learnable::all(gaussians),
            sh::ColourGradient {
                view: &view,
                colours: &colours,
                gradient: &colour_gradient,
            },
            &mut got,
        );
        Ok(Self {
            worst,
            worst_uncertain,
            uncertain: want.uncertain.iter().filter(|u| **u).count() as f64 / want.uncertain.len().max(1) as f64,
            gradient: GradientError::new(&got, &reference::gradient(gaussians, camera, &double)),
        })
    }

    /// Whether it is near enough for a scene whose colours are of the order of 1: pixels within 1e-4, those where a
    /// decision hangs on the last digits few and within a few decisions, the gradient within 1e-4 by all measures.
    pub fn holds(&self) -> bool {
        self.worst <= LIMIT
            && self.worst_uncertain <= UNCERTAIN_LIMIT
            && self.uncertain <= MOST_UNCERTAIN
            && self.gradient.within(LIMIT)
    }
}

impl std::fmt::Display for Agreement {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let GradientError { l1, l2, angle, bias } = self.gradient;
        write!(
            f,
            "pixels {:.1e} ({:.2} % uncertain: {:.1e}), gradient L1 {l1:.1e}, L2 {l2:.1e}, angle {angle:.1e}, bias {bias:.1e}",
            self.worst,
            100.0 * self.uncertain,
            self.worst_uncertain
        )
    }
}

/// Distance of a gradient from the one it should be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GradientError {
    /// `sum |got - want| / sum |want|`.
    pub l1: f64,
    /// `|got - want|_2 / |want|_2`: finds single large errors.
    pub l2: f64,
    /// One minus the cosine of the angle between them: finds wrong directions.
    pub angle: f64,
    /// `sum (got - want) sign(want) / sum |want|`: finds gradients that are a little too small everywhere.
    pub bias: f64,
}

impl GradientError {
    /// Compares two gradients. Two zero gradients are equal; NaN anywhere, or different lengths, make every measure NaN.
    pub fn new(got: &[f32], want: &[f64]) -> Self {
        if got.len() != want.len() {
            let [l1, l2, angle, bias] = [f64::NAN; 4];
            return GradientError { l1, l2, angle, bias };
        }
        let [mut sum, mut square, mut got_square, mut dot, mut d1, mut d2, mut signed] = [0.0f64; 7];
        for (g, w) in got.iter().zip(want) {
            let (g, d) = (f64::from(*g), f64::from(*g) - w);
            sum += w.abs();
            square += w * w;
            got_square += g * g;
            dot += g * w;
            d1 += d.abs();
            d2 += d * d;
            signed += d * if *w == 0.0 { 0.0 } else { w.signum() };
        }
        let ratio = |a: f64, b: f64| if a == 0.0 { 0.0 } else { a / b };
        let angle = if square == 0.0 && got_square == 0.0 {
            0.0
        } else {
            1.0 - dot / (square * got_square).sqrt()
        };
        GradientError {
            l1: ratio(d1, sum),
            l2: ratio(d2.sqrt(), square.sqrt()),
            angle,
            bias: ratio(signed, sum),
        }
    }

    /// Whether all four are within the limit; the angle, being quadratic in the error, within its square.
    pub fn within(&self, limit: f64) -> bool {
        self.l1 <= limit && self.l2 <= limit && self.angle <= limit * limit && self.bias.abs() <= 0.5 * limit
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(change: impl Fn(usize, f64) -> f64) -> GradientError {
        let want: Vec<f64> = (0..1000).map(|i| (i as f64 * 0.37).sin()).collect();
        let got: Vec<f32> = want.iter().enumerate().map(|(i, w)| change(i, *w) as f32).collect();
        GradientError::new(&got, &want)
    }

    #[test]
    fn rounding_passes() {
        assert!(error(|_, w| w).within(1e-6));
    }

    #[test]
    fn each_kind_of_error_is_found() {
        assert!(!error(|_, w| 0.999 * w).within(1e-3), "scaled: seen by the bias");
        assert!(error(|_, w| 0.999 * w).angle < 1e-12, "but not by the cosine");
        assert!(
            !error(|i, w| if i == 3 { w + 0.1 } else { w }).within(1e-3),
            "one outlier: seen by L2"
        );
        assert!(
            error(|i, w| if i == 3 { w + 0.1 } else { w }).l1 < 1e-3,
            "but not by L1"
        );
        assert!(
            !error(|i, w| if i % 2 == 0 { 0.0 } else { w }).within(1e-1),
            "half missing"
        );
        assert!(!error(|_, w| -w).within(1.0), "wrong sign");
        assert!(
            !error(|i, w| if i == 5 { f64::NAN } else { w }).within(1e9),
            "not a number"
        );
        assert!(!error(|_, _| 0.0).within(0.5), "all zero");
    }

    #[test]
    fn zero_gradients_are_equal() {
        assert!(GradientError::new(&[0.0; 3], &[0.0; 3]).within(0.0));
        assert!(!GradientError::new(&[0.0, 1e-9], &[0.0; 2]).within(0.1));
        assert!(!GradientError::new(&[0.0; 3], &[0.0; 2]).within(0.1));
    }
}
