//! Fisher's linear discriminant on some of the features.
use super::cholesky;

/// Added to the diagonal of the scatter of features of variance 1: so that there is a direction with fewer pictures than
/// features too, and noise in the features weighs less.
const RIDGE: f64 = 0.01;

/// A direction in the space of some features, and where on it the classes part.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Discriminant {
    /// Which features, ascending.
    features: Vec<usize>,
    /// Their weights, such that each class has a standard deviation of 1 on the direction.
    weights: Vec<f64>,
    /// Middle of the means of the classes on the direction.
    middle: f64,
}

impl Discriminant {
    /// `w = (S + λ)⁻¹ (m1 - m0)`, with `S` the mean scatter within the classes and `m` their means. `rows` are the pairs
    /// it is trained on, some more than once; rows of `clean` and `marked` have all the features, standardised.
    pub(super) fn train(clean: &[Vec<f64>], marked: &[Vec<f64>], rows: &[usize], features: Vec<usize>) -> Self {
        let n = features.len();
        let classes = [clean, marked].map(|class| Class::of(class, rows, &features));
        let difference: Vec<f64> = classes[1]
            .mean
            .iter()
            .zip(&classes[0].mean)
            .map(|(b, a)| b - a)
            .collect();
        let mut scatter: Vec<f64> = classes[0]
            .scatter
            .iter()
            .zip(&classes[1].scatter)
            .map(|(a, b)| f64::midpoint(*a, *b))
            .collect();
        for i in 0..n {
            scatter[i * n + i] += RIDGE;
        }
        let mut weights = difference.clone();
        // wᵀ (S + λ) w, which is the square of the standard deviation, is the product of what is solved for and solution.
        let solved = cholesky::solve(&mut scatter, &mut weights);
        let variance: f64 = weights.iter().zip(&difference).map(|(w, d)| w * d).sum();
        if solved && variance > 0.0 && variance.is_finite() {
            let deviation = variance.sqrt();
            weights.iter_mut().for_each(|weight| *weight /= deviation);
        } else {
            // The classes are the same in these features, so they have no say.
            weights.fill(0.0);
        }
        let middles = classes[0]
            .mean
            .iter()
            .zip(&classes[1].mean)
            .map(|(a, b)| f64::midpoint(*a, *b));
        let middle = weights
            .iter()
            .zip(middles)
            .map(|(weight, middle)| weight * middle)
            .sum();
        Self {
            features,
            weights,
            middle,
        }
    }

    /// Place on the direction, 0 in the middle between the classes, above it on the side of the marked one.
    pub(super) fn project(&self, picture: &[f64]) -> f64 {
        let values = self.features.iter().map(|feature| picture[*feature]);
        values
            .zip(&self.weights)
            .map(|(value, weight)| value * weight)
            .sum::<f64>()
            - self.middle
    }
}

/// Mean and scatter around it of one class.
struct Class {
    mean: Vec<f64>,
    /// `[n][n]`, on and above the diagonal.
    scatter: Vec<f64>,
}

impl Class {
    fn of(pictures: &[Vec<f64>], rows: &[usize], features: &[usize]) -> Self {
        let n = features.len();
        let select = |row: &usize| -> Vec<f64> { features.iter().map(|feature| pictures[*row][*feature]).collect() };
        let mut mean = vec![0.0; n];
        for row in rows {
            mean.iter_mut()
                .zip(select(row))
                .for_each(|(mean, value)| *mean += value);
        }
        mean.iter_mut().for_each(|mean| *mean /= rows.len() as f64);
        let mut scatter = vec![0.0; n * n];
        for row in rows {
            let mut values = select(row);
            values.iter_mut().zip(&mean).for_each(|(value, mean)| *value -= mean);
            for i in 0..n {
                let factor = values[i];
                for (sum, value) in scatter[i * n + i..(i + 1) * n].iter_mut().zip(&values[i..]) {
                    *sum += factor * value;
                }
            }
        }
        scatter.iter_mut().for_each(|sum| *sum /= rows.len() as f64);
        Self { mean, scatter }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two features of equal variance, of which the second tells the classes apart.
    #[test]
    fn weighs_what_differs() {
        let clean: Vec<Vec<f64>> = [(-1.0, -1.0), (1.0, -1.0), (-1.0, -3.0), (1.0, -3.0)]
            .map(|(a, b)| vec![a, 9.0, b])
            .to_vec();
        let marked: Vec<Vec<f64>> = clean.iter().map(|row| vec![row[0], 9.0, row[2] + 4.0]).collect();
        let discriminant = Discriminant::train(&clean, &marked, &[0, 1, 2, 3], vec![0, 2]);
        assert_eq!((discriminant.weights[0], discriminant.middle), (0.0, 0.0));
        // Scatter 1 + λ in both: a distance of 4 is 4 / √(1 + λ) standard deviations.
        let apart = discriminant.project(&[0.0, 9.0, 2.0]) - discriminant.project(&[0.0, 9.0, -2.0]);
        assert!((apart - 4.0 / (1.0 + RIDGE).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn equal_classes_have_no_say() {
        let same = vec![vec![1.0, 2.0]; 5];
        let discriminant = Discriminant::train(&same, &same, &[0, 0, 4], vec![0, 1]);
        assert_eq!(discriminant.project(&[7.0, 8.0]), 0.0);
    }
}
