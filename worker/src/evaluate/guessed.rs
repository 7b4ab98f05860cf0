//! What is read of a picture whose tones may have been changed, without counting matches that were searched for.
//!
//! A claim takes the reading of which chance is the least likely, each paid for by its share. The share of right bits under
//! that reading would be too good: it was searched for. So each bit is read as a claim about all *other* bits would; no bit
//! has a say in how it is read. A coded message can be read without knowing it: the reading is taken that is least likely by
//! chance to be as near to a codeword as it is.
use guardsplat_codeword::{Hypothesis, Message, MessageCode, Reading, shares, signed_rank};

use crate::error::Result;

/// Logits of what was read under each hypothesis, each bit under the one that a claim about the others would take.
///
/// # Errors
/// Messages of more bits than claims have.
pub(super) fn cross_chosen(read: &[(Hypothesis, Vec<f32>)], message: &Message) -> Result<Vec<f32>> {
    let hypotheses: Vec<Hypothesis> = read.iter().map(|(hypothesis, _)| *hypothesis).collect();
    let tries = shares(&hypotheses);
    let each = (0..message.len()).map(|bit| {
        let p_values = read.iter().zip(&tries).map(|((_, logits), tries)| {
            let p_value = p_value_without(bit, logits, message)?;
            Ok(p_value * *tries as f64)
        });
        let p_values = p_values.collect::<Result<Vec<f64>>>()?;
        // The first of equal ones.
        let better = |best: usize, place: usize| if p_values[place] < p_values[best] { place } else { best };
        Ok(read[(0..read.len()).fold(0, better)].1[bit])
    });
    each.collect()
}

/// Logits of the reading whose own message is the least likely by chance, each paid for by its share; the first of equal ones.
///
/// # Errors
/// Logits that are not of the code's words.
pub(super) fn blindly_chosen(code: &MessageCode, read: Vec<(Hypothesis, Vec<f32>)>) -> Result<Vec<f32>> {
    let hypotheses: Vec<Hypothesis> = read.iter().map(|(hypothesis, _)| *hypothesis).collect();
    let mut best: Option<(f64, Vec<f32>)> = None;
    for ((_, logits), tries) in read.into_iter().zip(shares(&hypotheses)) {
        let word = code.word(&code.read(&logits)?)?;
        let rank_sum = Reading::from_logits(&logits)?.rank_sum(&word)?;
        let p_value = signed_rank::tail(word.length().bits(), rank_sum)? * tries as f64;
        if best.as_ref().is_none_or(|(least, _)| p_value < *least) {
            best = Some((p_value, logits));
        }
    }
    Ok(best.map_or_else(Vec::new, |(_, logits)| logits))
}

/// The p-value of a claim about all bits but one; 1 where there are no others.
fn p_value_without(bit: usize, logits: &[f32], message: &Message) -> Result<f64> {
    let mut others = logits.to_vec();
    others.remove(bit);
    if others.is_empty() {
        return Ok(1.0);
    }
    let mut bits: Vec<bool> = message.bits().collect();
    bits.remove(bit);
    let rank_sum = Reading::from_logits(&others)?.rank_sum(&Message::from_bits(&bits)?)?;
    Ok(signed_rank::tail(others.len() as u32, rank_sum)?)
}

#[cfg(test)]
mod tests {
    use guardsplat_codeword::{PhotometricCorrection, Tone};

    use super::*;

    /// Whether each bit is right; one that is undecided isn't.
    fn right(logits: &[f32], message: &Message) -> Vec<bool> {
        let pairs = logits.iter().zip(message.bits());
        pairs
            .map(|(logit, bit)| if bit { *logit > 0.0 } else { *logit < 0.0 })
            .collect()
    }

    fn message() -> Message {
        Message::parse("c0de", 16).unwrap()
    }

    /// Readings under as many hypotheses, the first as given and all others guesses.
    fn under_guesses(readings: Vec<Vec<f32>>) -> Vec<(Hypothesis, Vec<f32>)> {
        let guess = |i: usize| Hypothesis {
            correction: PhotometricCorrection::Tone(Tone::Brightness(1.0 + i as f32 / 100.0)),
            ..Hypothesis::default()
        };
        let hypothesis = |i: usize| if i == 0 { Hypothesis::default() } else { guess(i) };
        let numbered = readings.into_iter().enumerate();
        numbered.map(|(i, logits)| (hypothesis(i), logits)).collect()
    }

    fn chosen(readings: Vec<Vec<f32>>) -> Vec<f32> {
        cross_chosen(&under_guesses(readings), &message()).unwrap()
    }

    /// Logits of size 1 of which the first `wrong` are wrong, which have the lowest ranks.
    fn logits(wrong: usize) -> Vec<f32> {
        let right = message().targets().map(|t| 2.0 * t - 1.0).collect::<Vec<_>>();
        let wrong = |(i, v): (usize, &f32)| if i < wrong { -v } else { *v };
        right.iter().enumerate().map(wrong).collect()
    }

    fn matches(logits: &[f32]) -> usize {
        right(logits, &message()).into_iter().filter(|right| *right).count()
    }

    #[test]
    fn the_right_guess_is_found_and_nothing_done_is_preferred() {
        let found = chosen(vec![logits(8), logits(7), logits(0), logits(9)]);
        assert_eq!(matches(&found), 16);
        // One bit better is no reason to believe that something was done.
        assert_eq!(chosen(vec![logits(1), logits(0)]), logits(1));
        // Many guesses pay more than one.
        let many = |wrong: usize| {
            let mut readings = vec![logits(3)];
            readings.extend(std::iter::repeat_n(logits(8), 500));
            readings.push(logits(wrong));
            matches(&chosen(readings))
        };
        assert_eq!(many(0), 13);
        assert_eq!(matches(&chosen(vec![logits(3), logits(8), logits(0)])), 16);
    }

    #[test]
    fn of_coded_messages_the_reading_is_taken_that_is_nearest_to_a_codeword() {
        let code = MessageCode::coded(16, 3).unwrap();
        let word = code.word(&message()).unwrap();
        let at = |wrong: usize| -> Vec<f32> {
            let signed = word.targets().map(|t| 2.0 * t - 1.0).enumerate();
            // The wrong ones lie all over the word.
            signed.map(|(i, v)| if i * 37 % 64 < wrong { -v } else { v }).collect()
        };
        // What says nothing is as near to some codeword as chance has it.
        let nothing = |seed: u64| -> Vec<f32> {
            use rand::{RngExt, SeedableRng};
            let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
            (0..64).map(|_| rng.random_range(-1.0..1.0)).collect()
        };
        let mut readings: Vec<_> = (0..100).map(nothing).collect();
        readings.insert(70, at(6));
        let found = blindly_chosen(&code, under_guesses(readings)).unwrap();
        assert_eq!(found, at(6));
        assert_eq!(code.read(&found).unwrap(), message());
        // Of equal ones as given is paid for least.
        let twice: Vec<f32> = at(3).iter().map(|logit| 2.0 * logit).collect();
        let found = blindly_chosen(&code, under_guesses(vec![at(3), twice, nothing(1)])).unwrap();
        assert_eq!(found, at(3));
    }

    #[test]
    fn an_undecided_bit_is_no_match_and_a_message_of_one_bit_is_read_as_given() {
        assert_eq!(
            right(&[0.0, f32::NAN, -1.0], &Message::parse("0", 3).unwrap()),
            [false, false, true]
        );
        let one = Message::parse("1", 1).unwrap();
        let read = under_guesses(vec![vec![-1.0], vec![1.0]]);
        assert_eq!(cross_chosen(&read, &one).unwrap(), [-1.0]);
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
            searched += guesses.iter().map(|g| matches(g)).max().unwrap();
            crossed += matches(&chosen(guesses));
        }
        let share = |matches: usize| matches as f64 / f64::from(16 * pictures);
        // 6,400 coins: a deviation is 0.006.
        assert!((share(crossed) - 0.5).abs() < 0.025, "{}", share(crossed));
        assert!(share(searched) > 0.75, "{}", share(searched));
    }
}
