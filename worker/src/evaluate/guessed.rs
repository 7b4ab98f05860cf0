//! What is read of a picture whose tones may have been changed, without counting matches that were searched for.
//!
//! A claim takes the guess at what was done under which most bits match, and counts every guess in its p-value. The share
//! of right bits under that guess would be too good: it was searched for. So each bit is read under the guess that all
//! *other* bits prefer; no bit has a say in how it is read.
use guardsplat_codeword::Message;

/// How much better than the picture as it is a guess must match: 1 is all bits against half of them.
const BETTER: f64 = 0.25;

/// Logits of a picture, each bit under the guess that the others prefer. `guesses` has the logits of every guess, nothing
/// done first.
pub(super) fn cross_chosen(guesses: &[Vec<f32>], message: &Message) -> Vec<f32> {
    let all: Vec<Agreement> = guesses.iter().map(|logits| Agreement::of(logits, message)).collect();
    let read = message.bits().enumerate().map(|(bit, right)| {
        let scores = guesses
            .iter()
            .zip(&all)
            .map(|(logits, all)| all.without(logits[bit], right));
        guesses[best(scores)][bit]
    });
    read.collect()
}

/// The place of the best score, where the first is preferred.
fn best(scores: impl Iterator<Item = f64>) -> usize {
    let (mut best, mut bar) = (0, f64::NEG_INFINITY);
    for (index, score) in scores.enumerate() {
        if index == 0 {
            bar = score + BETTER;
        } else if score > bar {
            (best, bar) = (index, score);
        }
    }
    best
}

/// Right logits less wrong ones, and all of them.
struct Agreement {
    signed: f64,
    all: f64,
}

impl Agreement {
    fn of(logits: &[f32], message: &Message) -> Self {
        let pairs = || logits.iter().zip(message.bits());
        Self {
            signed: pairs().map(|(logit, right)| signed(*logit, right)).sum(),
            all: logits.iter().map(|v| f64::from(v.abs())).sum(),
        }
    }

    /// The share without one bit: 1 when all others are right, about 0 by chance.
    fn without(&self, logit: f32, right: bool) -> f64 {
        let all = self.all - f64::from(logit.abs());
        if all > 0.0 {
            (self.signed - signed(logit, right)) / all
        } else {
            0.0
        }
    }
}

fn signed(logit: f32, right: bool) -> f64 {
    f64::from(if right { logit } else { -logit })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message() -> Message {
        Message::parse("c0de", 16).unwrap()
    }

    /// Logits of size 1 of which the first `wrong` are wrong.
    fn logits(wrong: usize) -> Vec<f32> {
        let right = message().targets().map(|t| 2.0 * t - 1.0).collect::<Vec<_>>();
        let wrong = |(i, v): (usize, &f32)| if i < wrong { -v } else { *v };
        right.iter().enumerate().map(wrong).collect()
    }

    fn right(logits: &[f32]) -> usize {
        let read = guardsplat_codeword::Reading::from_logits(logits).unwrap();
        read.matches(&message()).unwrap() as usize
    }

    #[test]
    fn the_right_guess_is_found_and_nothing_done_is_preferred() {
        let found = cross_chosen(&[logits(8), logits(7), logits(0), logits(9)], &message());
        assert_eq!(right(&found), 16);
        // One bit better is no reason to believe that something was done.
        assert_eq!(cross_chosen(&[logits(1), logits(0)], &message()), logits(1));
    }

    #[test]
    fn searching_does_not_make_matches() {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let (mut crossed, mut searched, pictures) = (0, 0, 400);
        for _ in 0..pictures {
            let guesses: Vec<Vec<f32>> = (0..60)
                .map(|_| (0..16).map(|_| rng.random_range(-1.0..1.0)).collect())
                .collect();
            crossed += right(&cross_chosen(&guesses, &message()));
            searched += guesses.iter().map(|g| right(g)).max().unwrap();
        }
        let share = |matches: usize| matches as f64 / f64::from(16 * pictures);
        // 6,400 coins: a deviation is 0.006.
        assert!((share(crossed) - 0.5).abs() < 0.025, "{}", share(crossed));
        assert!(share(searched) > 0.75, "{}", share(searched));
    }
}
