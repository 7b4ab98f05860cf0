//! How the rate of false positives is shared among the readings of one suspect.
//!
//! Most suspects are as they were given, and what was done to others can mostly be estimated; guesses come last, and many
//! at once. So half of the rate is for files as given, half of the rest for what differs from the original where that is at
//! hand, half of what is left then for the estimate, half of the rest for the next best ones, then for guesses about one
//! picture that the others follow, and all that is left for guesses about all pictures, alike within a kind. A reading with
//! one part in t of the rate pays as one of t hypotheses would: its tail times t. The shares depend on what was read and not
//! on any message, and together are no more than the rate (a weighted union bound, Holm 1979).
use crate::hypothesis::{Hypothesis, PhotometricCorrection};

/// Kinds of hypotheses, as they are shared with.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    AsGiven,
    Registered,
    Estimated,
    NextEstimate,
    Led,
    Guessed,
}

impl Kind {
    /// From what is likely beforehand to what is a guess.
    const ALL: [Self; 6] = [
        Self::AsGiven,
        Self::Registered,
        Self::Estimated,
        Self::NextEstimate,
        Self::Led,
        Self::Guessed,
    ];
}

fn kind(hypothesis: &Hypothesis) -> Kind {
    match *hypothesis {
        given if given == Hypothesis::default() => Kind::AsGiven,
        led if led.leader.is_some() => Kind::Led,
        other => match other.correction {
            PhotometricCorrection::Registered(_) | PhotometricCorrection::MatchedFilter => Kind::Registered,
            PhotometricCorrection::Estimated => Kind::Estimated,
            PhotometricCorrection::NextEstimate(_) => Kind::NextEstimate,
            _ => Kind::Guessed,
        },
    }
}

/// For each reading of a suspect, of how many equal parts of the rate it has one.
pub fn shares(hypotheses: &[Hypothesis]) -> Vec<u64> {
    let kinds: Vec<Kind> = hypotheses.iter().map(kind).collect();
    let count = |wanted| kinds.iter().filter(|kind| **kind == wanted).count() as u64;
    let there = Kind::ALL.map(|kind| (kind, count(kind)));
    let there: Vec<_> = there.into_iter().filter(|(_, count)| *count > 0).collect();
    let of = |wanted: Kind| {
        let place = there.iter().position(|(kind, _)| *kind == wanted).unwrap_or(0);
        // The last kind has as much as the one before it: all that is left.
        let halvings = (place + 1).min(there.len().saturating_sub(1));
        (1_u64 << halvings) * count(wanted)
    };
    kinds.iter().map(|kind| of(*kind)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hypothesis::{NEXT_ESTIMATES, RegisteredTones, Tone};

    fn guess(i: usize) -> Hypothesis {
        Hypothesis {
            correction: PhotometricCorrection::Tone(Tone::Brightness(0.5 + i as f32 / 100.0)),
            ..Hypothesis::default()
        }
    }

    fn led(i: usize) -> Hypothesis {
        Hypothesis {
            leader: Some(1 + i as u32 % 4),
            ..guess(i)
        }
    }

    #[test]
    fn the_whole_rate_is_shared_and_no_more() {
        let counts = [0, 1, 2, 7, 177];
        let each = |given: usize, estimates: usize, leads: usize, guesses: usize| {
            let all: Vec<_> = std::iter::repeat_n(Hypothesis::default(), given)
                .chain(std::iter::repeat_n(Hypothesis::estimated(), estimates))
                .chain((0..leads).map(led))
                .chain((0..guesses).map(guess))
                .collect();
            let shares = shares(&all);
            assert_eq!(shares.len(), all.len());
            let sum: f64 = shares.iter().map(|&tries| 1.0 / tries as f64).sum();
            assert!(
                all.is_empty() || (sum - 1.0).abs() < 1e-9,
                "{given} {estimates} {leads} {guesses}: {shares:?}"
            );
        };
        for (given, estimates) in [(0, 0), (0, 1), (1, 0), (1, 1), (1, 2)] {
            for leads in counts {
                counts
                    .iter()
                    .for_each(|guesses| each(given, estimates, leads, *guesses));
            }
        }
    }

    #[test]
    fn what_is_likely_pays_little() {
        let given = Hypothesis::default();
        assert_eq!(shares(&[given]), [1]);
        assert_eq!(shares(&[given, Hypothesis::estimated()]), [2, 2]);
        assert_eq!(
            shares(&[given, Hypothesis::estimated(), guess(1), guess(2)]),
            [2, 4, 8, 8]
        );
        assert_eq!(shares(&[guess(1), given, guess(2)]), [4, 2, 4]);
        let next = NEXT_ESTIMATES.map(Hypothesis::estimated_next);
        let alone = [given, Hypothesis::estimated()].into_iter().chain(next);
        assert_eq!(
            shares(&alone.chain([guess(1)]).collect::<Vec<_>>()),
            [2, 4, 24, 24, 24, 8]
        );
        assert_eq!(
            shares(&[given, Hypothesis::estimated(), led(1), led(2), guess(1)]),
            [2, 4, 16, 16, 8]
        );
        assert_eq!(shares(&[guess(1), guess(2), guess(3)]), [3, 3, 3]);
        let [as_they_are, fitted] = RegisteredTones::ALL.map(Hypothesis::registered);
        assert_eq!(
            shares(&[given, Hypothesis::estimated(), guess(1), as_they_are, fitted]),
            [2, 8, 8, 8, 8]
        );
        let matched = Hypothesis::matched_filter();
        assert_eq!(
            shares(&[given, Hypothesis::estimated(), as_they_are, fitted, matched]),
            [2, 4, 12, 12, 12]
        );
    }
}
