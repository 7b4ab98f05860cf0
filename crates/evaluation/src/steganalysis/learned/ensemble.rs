//! Many discriminants, each of which sees some of the features and some of the pictures.
//!
//! After Kodovsky, Fridrich, Holub (2012): each is trained on a random subspace and on a bootstrap sample of the pairs, and
//! the dimension of the subspaces is the one with the least error on the pairs that were not drawn. Instead of votes the
//! projections are averaged, which orders pictures more finely (Cogranne, Fridrich, "Modeling and extending the ensemble
//! classifier for steganalysis of digital images using hypothesis testing theory", IEEE TIFS 10, 2015).
use super::discriminant::Discriminant;
use rand::seq::index;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// How many discriminants.
const MEMBERS: usize = 101;
/// Dimensions of subspaces that are tried.
const DIMENSIONS: [usize; 4] = [50, 100, 200, 400];

/// What [`train`](Self::train) found.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Ensemble {
    scale: Scale,
    members: Vec<Discriminant>,
    out_of_bag_error: f64,
}

impl Ensemble {
    /// From the features of pairs, as many of each and at least one, all rows of one length.
    pub(super) fn train(clean: &[Vec<f64>], marked: &[Vec<f64>], seed: u64) -> Self {
        let scale = Scale::of(clean, marked);
        let standardise = |rows: &[Vec<f64>]| -> Vec<Vec<f64>> { rows.iter().map(|row| scale.apply(row)).collect() };
        let (clean, marked) = (standardise(clean), standardise(marked));
        let mut best: Option<(f64, Vec<Discriminant>)> = None;
        for dimension in DIMENSIONS {
            let (error, members) = train_members(&clean, &marked, &scale.varying, dimension, seed);
            // As in the paper, the search ends where the error is no longer less.
            if best.as_ref().is_some_and(|(least, _)| error >= *least) {
                break;
            }
            best = Some((error, members));
            if dimension >= scale.varying.len() {
                break;
            }
        }
        let (out_of_bag_error, members) = best.unwrap_or((0.5, Vec::new()));
        Self {
            scale,
            members,
            out_of_bag_error,
        }
    }

    /// Mean of the projections of a picture's features.
    pub(super) fn score(&self, features: &[f64]) -> f64 {
        let features = self.scale.apply(features);
        mean(self.members.iter().map(|member| member.project(&features)))
    }

    /// See [`Classifier`](super::Classifier::out_of_bag_error).
    pub(super) fn out_of_bag_error(&self) -> f64 {
        self.out_of_bag_error
    }
}

/// Members with subspaces of one dimension, and their error on pairs that they were not trained on.
fn train_members(
    clean: &[Vec<f64>],
    marked: &[Vec<f64>],
    varying: &[usize],
    dimension: usize,
    seed: u64,
) -> (f64, Vec<Discriminant>) {
    let train = |member: usize| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(member as u64);
        let mut chosen = index::sample(&mut rng, varying.len(), dimension.min(varying.len())).into_vec();
        chosen.sort_unstable();
        let features = chosen.into_iter().map(|place| varying[place]).collect();
        let rows: Vec<usize> = (0..clean.len()).map(|_| rng.random_range(0..clean.len())).collect();
        (Discriminant::train(clean, marked, &rows, features), rows)
    };
    let members: Vec<(Discriminant, Vec<usize>)> = (0..MEMBERS).into_par_iter().map(train).collect();
    let error = out_of_bag_error(clean, marked, &members);
    (error, members.into_iter().map(|(member, _)| member).collect())
}

/// Share of pictures on the wrong side of 0, judged by the members whose sample lacks their pair; 0 is on no side.
fn out_of_bag_error(clean: &[Vec<f64>], marked: &[Vec<f64>], members: &[(Discriminant, Vec<usize>)]) -> f64 {
    let mut seen = vec![vec![false; members.len()]; clean.len()];
    for (member, (_, rows)) in members.iter().enumerate() {
        for row in rows {
            seen[*row][member] = true;
        }
    }
    let errors = |row: usize| {
        let judges = || {
            members
                .iter()
                .zip(&seen[row])
                .filter(|(_, seen)| !**seen)
                .map(|((member, _), _)| member)
        };
        let score = |picture: &[f64]| mean(judges().map(|member| member.project(picture)));
        let wrong = |score: f64| {
            if score > 0.0 {
                1.0
            } else if score < 0.0 {
                0.0
            } else {
                0.5
            }
        };
        f64::midpoint(wrong(score(&clean[row])), wrong(-score(&marked[row])))
    };
    mean((0..clean.len()).map(errors))
}

/// Mean, 0 of nothing.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = values.fold((0_usize, 0.0), |(count, sum), value| (count + 1, sum + value));
    if count == 0 { 0.0 } else { sum / count as f64 }
}

/// Mean 0 and variance 1 for every feature of the training set.
#[derive(Clone, Debug, PartialEq)]
struct Scale {
    mean: Vec<f64>,
    /// 0 of features that are the same in all pictures.
    factor: Vec<f64>,
    /// The other features, ascending.
    varying: Vec<usize>,
}

impl Scale {
    fn of(clean: &[Vec<f64>], marked: &[Vec<f64>]) -> Self {
        let rows = || clean.iter().chain(marked);
        let features = rows().next().map_or(0, Vec::len);
        let means = |value: &dyn Fn(usize, f64) -> f64| -> Vec<f64> {
            (0..features)
                .map(|feature| mean(rows().map(|row| value(feature, row[feature]))))
                .collect()
        };
        let centre = means(&|_, value| value);
        let variance = means(&|feature, value| (value - centre[feature]).powi(2));
        // Features are shares: what varies less than this varies by rounding only.
        let factor: Vec<f64> = variance
            .iter()
            .map(|v| if *v > 1e-20 { v.sqrt().recip() } else { 0.0 })
            .collect();
        let varying = (0..features).filter(|feature| factor[*feature] > 0.0).collect();
        Self {
            mean: centre,
            factor,
            varying,
        }
    }

    fn apply(&self, features: &[f64]) -> Vec<f64> {
        let parameters = self.mean.iter().zip(&self.factor);
        features
            .iter()
            .zip(parameters)
            .map(|(value, (mean, factor))| (value - mean) * factor)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(rows: usize, shift: f64, seed: u64) -> Vec<Vec<f64>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let value = |i: usize, noise: f64| {
            if i == 60 {
                0.5
            } else {
                noise + if i < 3 { shift } else { 0.0 }
            }
        };
        (0..rows)
            .map(|_| (0..80).map(|i| value(i, rng.random())).collect())
            .collect()
    }

    #[test]
    fn finds_the_features_that_differ() {
        let ensemble = Ensemble::train(&noise(300, 0.0, 1), &noise(300, 0.4, 2), 3);
        let error =
            |rows: &[Vec<f64>], sign: f64| mean(rows.iter().map(|row| f64::from(sign * ensemble.score(row) < 0.0)));
        let fresh = f64::midpoint(error(&noise(400, 0.0, 4), -1.0), error(&noise(400, 0.4, 5), 1.0));
        // The best that can be done with three uniform features that are shifted by 0.4 is about 0.11.
        assert!(fresh < 0.18, "{fresh}");
        assert!(
            (ensemble.out_of_bag_error() - fresh).abs() < 0.08,
            "{}",
            ensemble.out_of_bag_error()
        );
    }

    #[test]
    fn finds_nothing_in_nothing() {
        let ensemble = Ensemble::train(&noise(100, 0.0, 1), &noise(100, 0.0, 2), 3);
        assert!(
            (ensemble.out_of_bag_error() - 0.5).abs() < 0.15,
            "{}",
            ensemble.out_of_bag_error()
        );
    }

    #[test]
    fn pictures_without_differences_score_zero() {
        let rows = vec![vec![0.25; 30]; 10];
        let ensemble = Ensemble::train(&rows, &rows, 1);
        assert_eq!((ensemble.score(&[0.9; 30]), ensemble.out_of_bag_error()), (0.0, 0.5));
    }
}
