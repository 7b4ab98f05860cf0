//! The Gaussians of a scene, as the engine computes with them: one array a property, rows in file order.

/// Largest degree of spherical harmonics that a scene may have.
pub const MAX_DEGREE: usize = 4;

/// Limit that viewers put on opacity logits; beyond it the sigmoid is 0 or 1 to single precision.
const OPACITY_LOGIT_LIMIT: f32 = 20.0;

/// Geometry, opacity and colour of `n` Gaussians; row `i` of every array is Gaussian `i` of the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gaussians {
    /// Centres in world units, finite.
    pub positions: Vec<[f32; 3]>,
    /// Quaternions w, x, y, z as stored: not normalised, possibly all zero.
    pub rotations: Vec<[f32; 4]>,
    /// Natural logarithms of the standard deviations along the three axes; minus infinity is a flat axis.
    pub log_scales: Vec<[f32; 3]>,
    /// Logits of the opacity as stored, possibly infinite: use [`Gaussians::opacity`].
    pub opacity_logits: Vec<f32>,
    /// Colour.
    pub sh: Sh,
}

/// Spherical harmonics coefficients of all Gaussians.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sh {
    /// 0 to [`MAX_DEGREE`].
    pub degree: usize,
    /// `[n][(degree + 1)^2][3]`, RGB innermost; index 0 of the middle axis is the constant (DC) term.
    pub coefficients: Vec<f32>,
}

impl Sh {
    /// Coefficients of one Gaussian, all channels: `3 (degree + 1)^2`.
    pub fn per_gaussian(&self) -> usize {
        3 * (self.degree + 1) * (self.degree + 1)
    }

    /// Drops the bands in which no Gaussian has anything but 0.
    pub fn trim(&mut self) {
        let stored = self.per_gaussian();
        let used = |row: &[f32]| row.iter().rposition(|v| *v != 0.0).map_or(0, |last| (last / 3).isqrt());
        self.degree = self.coefficients.chunks_exact(stored).map(used).max().unwrap_or(0);
        let kept = self.per_gaussian();
        if kept == stored {
            return;
        }
        for row in 0..self.coefficients.len() / stored {
            self.coefficients
                .copy_within(row * stored..row * stored + kept, row * kept);
        }
        self.coefficients.truncate(self.coefficients.len() / stored * kept);
        self.coefficients.shrink_to_fit();
    }
}

impl Gaussians {
    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// Opacity of Gaussian `row` in (0, 1): sigmoid of the logit clamped to +-20, as viewers do.
    pub fn opacity(&self, row: usize) -> f32 {
        let logit = self.opacity_logits[row].clamp(-OPACITY_LOGIT_LIMIT, OPACITY_LOGIT_LIMIT);
        1.0 / (1.0 + (-logit).exp())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opacity_of_infinite_logits_is_a_probability() {
        let gaussians = Gaussians {
            opacity_logits: vec![f32::INFINITY, f32::NEG_INFINITY, 0.0],
            ..Gaussians::default()
        };
        assert!(gaussians.opacity(0) > 0.999_999);
        assert!(gaussians.opacity(1) > 0.0 && gaussians.opacity(1) < 1e-8);
        assert_eq!(gaussians.opacity(2), 0.5);
    }

    #[test]
    fn bands_of_zeros_are_dropped() {
        let mut sh = Sh {
            degree: 2,
            coefficients: vec![0.0; 54],
        };
        sh.coefficients[27 + 11] = 3.0; // the last of the first band
        sh.coefficients[27] = 1.0;
        sh.trim();
        assert_eq!((sh.degree, sh.coefficients.len()), (1, 24));
        assert_eq!((sh.coefficients[12], sh.coefficients[23]), (1.0, 3.0));
        sh.coefficients.fill(0.0);
        sh.trim();
        assert_eq!((sh.degree, sh.coefficients.len()), (0, 6));
        let mut none = Sh {
            degree: 3,
            coefficients: Vec::new(),
        };
        none.trim();
        assert_eq!(none.degree, 0);
    }

    #[test]
    fn coefficients_a_gaussian() {
        let counts = [3, 12, 27, 48, 75];
        for (degree, count) in counts.into_iter().enumerate() {
            assert_eq!(
                Sh {
                    degree,
                    coefficients: Vec::new()
                }
                .per_gaussian(),
                count
            );
        }
    }
}
