//! Highlights in spherical harmonics: a Phong lobe, fitted by least squares over directions.
//!
//! The fit is linear in the lobe's values at fixed directions, so its matrix is inverted once: with `B` the basis at
//! the directions, the coefficients are `(B^T B)^-1 B^T lobe`.
use crate::splat::sh::basis;
use crate::view::vector::{dot, unit};

/// Directions of the fit; several times the 25 unknowns of degree 4.
const DIRECTIONS: usize = 256;
/// Exponent of the lobe, about as sharp as degree 4 can follow.
const SHARPNESS: i32 = 10;

/// The fit of one degree.
pub(super) struct Highlight {
    directions: Vec<[f32; 3]>,
    /// `[coefficients][directions]`: the pseudo-inverse of the basis.
    inverse: Vec<Vec<f64>>,
}

impl Highlight {
    /// Prepares the fit for a degree of 0 to 4.
    pub fn new(degree: usize) -> Highlight {
        let n = DIRECTIONS as f32;
        let directions: Vec<[f32; 3]> = (0..DIRECTIONS)
            .map(|i| {
                let z = 1.0 - (2.0 * i as f32 + 1.0) / n;
                let (sine, cosine) = (i as f32 * 2.399_963_2).sin_cos();
                let level = (1.0 - z * z).sqrt();
                unit([level * cosine, level * sine, z]).unwrap_or([0.0, 0.0, 1.0])
            })
            .collect();
        let k = (degree + 1) * (degree + 1);
        // Rows of the normal equations, with the right-hand sides of all directions appended.
        let bases: Vec<[f32; 25]> = directions.iter().map(|d| basis(degree, *d)).collect();
        let mut rows: Vec<Vec<f64>> = (0..k)
            .map(|i| {
                let product = |j: usize| bases.iter().map(|b| f64::from(b[i]) * f64::from(b[j])).sum::<f64>();
                (0..k)
                    .map(product)
                    .chain(bases.iter().map(|b| f64::from(b[i])))
                    .collect()
            })
            .collect();
        // Gauss-Jordan without pivoting: the matrix is positive definite, close to a multiple of the identity.
        for pivot in 0..k {
            let scale = 1.0 / rows[pivot][pivot];
            rows[pivot].iter_mut().for_each(|v| *v *= scale);
            let head = rows[pivot].clone();
            for (i, row) in rows.iter_mut().enumerate() {
                let factor = row[pivot];
                if i != pivot {
                    row.iter_mut().zip(&head).for_each(|(v, h)| *v -= factor * h);
                }
            }
        }
        Highlight {
            directions,
            inverse: rows.into_iter().map(|row| row[k..].to_vec()).collect(),
        }
    }

    /// Coefficients `[(degree + 1)^2][3]` of a white highlight around `towards`, as strong as `gloss`.
    ///
    /// Directions run from the camera to the Gaussian, so the lobe is bright where they oppose `towards`. Without a
    /// direction, or at degree 0, which cannot hold one, there is no highlight.
    pub fn fitted(&self, towards: Option<[f32; 3]>, gloss: f32) -> Vec<f32> {
        let k = self.inverse.len();
        let mut out = vec![0.0; 3 * k];
        let Some(towards) = towards else { return out };
        if k == 1 || gloss == 0.0 {
            return out;
        }
        let lobe: Vec<f64> = self
            .directions
            .iter()
            .map(|d| f64::from(gloss * (-dot(*d, towards)).max(0.0).powi(SHARPNESS)))
            .collect();
        for (i, row) in self.inverse.iter().enumerate() {
            let value: f64 = row.iter().zip(&lobe).map(|(a, b)| a * b).sum();
            out[3 * i..3 * i + 3].fill(value as f32);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lobe_is_bright_towards_its_direction_and_sharper_with_the_degree() {
        let towards = unit([0.3, -0.8, 0.5]).unwrap();
        let mut last = 0.0;
        for degree in 1..=4 {
            let coefficients = Highlight::new(degree).fitted(Some(towards), 1.0);
            let at = |d: [f32; 3]| -> f32 {
                let b = basis(degree, d);
                coefficients.iter().step_by(3).zip(b).map(|(c, b)| c * b).sum()
            };
            let peak = at(towards.map(|x| -x));
            assert!(peak > last + 0.05, "degree {degree}: {peak} after {last}");
            assert!(at(towards).abs() < 0.12, "degree {degree}: {}", at(towards));
            last = peak;
        }
        assert!(last > 0.7 && last < 1.1, "{last}");
        assert!(Highlight::new(0).fitted(Some(towards), 1.0).iter().all(|c| *c == 0.0));
    }
}
