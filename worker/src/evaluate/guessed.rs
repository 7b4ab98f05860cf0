//! What is read of a picture whose tones may have been changed, without counting matches that were searched for.
//!
//! A claim takes the guess at what was done under which most bits match, and counts every guess in its p-value. The share
//! of right bits under that guess would be too good: it was searched for. So each half of the bits is read under the guess
//! that the *other* half prefers; no bit has a say in how it is read.
use crate::message::Message;

/// How much better than the picture as it is a guess must match: 1 is all bits against half of them.
const BETTER: f64 = 0.25;

/// Logits of a picture, each read under the guess that the other half of the bits prefers. `guesses` has the logits of
/// every guess, nothing done first.
pub(super) fn cross_chosen(guesses: &[Vec<f32>], message: &Message) -> Vec<f32> {
    let chosen: [usize; 2] = std::array::from_fn(|half| best(guesses, message, 1 - half));
    (0..message.len())
        .map(|bit| guesses.get(chosen[bit % 2]).map_or(0.0, |logits| logits[bit]))
        .collect()
}

/// The guess under which the bits of a half match best.
fn best(guesses: &[Vec<f32>], message: &Message, half: usize) -> usize {
    let scores: Vec<f64> = guesses.iter().map(|logits| agreement(logits, message, half)).collect();
    let mut best = 0;
    for (index, score) in scores.iter().enumerate().skip(1) {
        let bar = if best == 0 { scores[0] + BETTER } else { scores[best] };
        if *score > bar {
            best = index;
        }
    }
    best
}

/// Right logits less wrong ones over all, of the bits of a half: 1 when all are right, about 0 by chance.
fn agreement(logits: &[f32], message: &Message, half: usize) -> f64 {
    let (mut signed, mut all) = (0.0, 0.0);
    for (logit, bit) in logits.iter().zip(message.bits()).skip(half).step_by(2) {
        let logit = f64::from(*logit);
        signed += if *bit { logit } else { -logit };
        all += logit.abs();
    }
    if all > 0.0 { signed / all } else { 0.0 }
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
        Message::from_logits(logits).unwrap().matches(&message())
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
