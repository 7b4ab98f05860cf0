//! What wrong changes of tones read like, by how much brighter they make a picture: what a score is compared with.
//!
//! A picture made brighter has colours that lie further apart, and more of them cut at white; by that alone its logits may be
//! larger. In a room of plain walls a picture made twice as bright scored two deviations more than one left as it was, and
//! was believed. So a trend is fitted to the scores of all changes that are tried, of which nearly all are wrong, and what a
//! change scores beyond it counts.
use crate::extract::linear::solve;
use crate::extract::photometric::ToneChange;

/// Terms of the trend.
const TERMS: usize = 3;
/// Fewest scores that a trend is fitted to.
const LEAST: usize = 100;

/// How scores of wrong changes vary with their common gain: 0 for nothing done.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Trend {
    /// Of each term; what is constant is the same for all changes, and left out.
    slopes: [f64; TERMS],
    /// What wrong changes of this part score more than those of the part that was looked at first.
    pub level: f64,
}

impl Trend {
    /// Fitted by least squares to changes and their scores; none to few, or to those of one gain.
    pub fn of(scores: impl Iterator<Item = (ToneChange, f64)>) -> Self {
        let (mut products, mut sums, mut count) = (vec![0.0; TERMS * TERMS], vec![[0.0]; TERMS], 0);
        for (change, score) in scores {
            let terms = terms(&change);
            for (i, a) in terms.iter().enumerate() {
                sums[i][0] += a * score;
                terms
                    .iter()
                    .enumerate()
                    .for_each(|(j, b)| products[i * TERMS + j] += a * b);
            }
            count += 1;
        }
        let fitted = solve(products, sums, 1e-9).filter(|_| count >= LEAST);
        let slopes = fitted.map_or([0.0; TERMS], |fitted| [0.0, fitted[1][0], fitted[2][0]]);
        Self { slopes, level: 0.0 }
    }

    /// What a wrong change like this one scores more than nothing done in the part that was looked at first.
    pub fn at(&self, change: &ToneChange) -> f64 {
        let slopes = self.slopes.iter().zip(terms(change));
        self.level + slopes.map(|(slope, term)| slope * term).sum::<f64>()
    }
}

/// A constant, the common gain and its square. Of other coordinates too few changes are tried: a right one among them would
/// pass for a trend.
fn terms(change: &ToneChange) -> [f64; TERMS] {
    let gains = ToneChange::GAINS.map(|place| f64::from(change.coordinates[place]));
    let gain = gains.iter().sum::<f64>() / 3.0;
    [1.0, gain, gain * gain]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gain(steps: i16) -> ToneChange {
        ToneChange::of_gains([0.01 * f32::from(steps); 3])
    }

    #[test]
    fn what_brighter_pictures_score_is_taken_off_and_the_right_one_stays() {
        // A parabola with its bottom at 0.1, and the right change at 0.3.
        let score = |steps: i16| {
            let gain = 0.01 * f64::from(steps);
            1.2 + 2.0 * (gain - 0.1).powi(2) + if steps == 30 { 0.8 } else { 0.0 }
        };
        let trend = Trend::of((-70..50).map(|steps| (gain(steps), score(steps))));
        let beyond = |steps: i16| score(steps) - trend.at(&gain(steps));
        assert!((beyond(-70) - beyond(0)).abs() < 0.1, "{}", beyond(-70) - beyond(0));
        assert!(beyond(30) > beyond(-70) + 0.7);
        // As they were, the wrong one wins by far less.
        assert!(score(-70) > score(30) - 0.3);
    }

    #[test]
    fn a_part_whose_wrong_changes_score_more_has_that_taken_off() {
        let trend = Trend {
            level: 0.4,
            ..Trend::default()
        };
        assert_eq!((trend.at(&ToneChange::default()), trend.at(&gain(20))), (0.4, 0.4));
    }

    #[test]
    fn few_scores_or_those_of_one_gain_have_no_trend() {
        let few = Trend::of((0..50).map(|steps| (gain(steps), f64::from(steps))));
        let of_one = Trend::of((0..500).map(|steps| (gain(3), f64::from(steps))));
        assert_eq!((few, of_one), (Trend::default(), Trend::default()));
    }
}
