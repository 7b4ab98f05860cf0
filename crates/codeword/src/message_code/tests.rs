//! Words are far apart, and are read in spite of errors.
use super::*;
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

fn code(bits: usize) -> MessageCode {
    MessageCode::coded(bits, 0x0123_4567_89ab_cdef).unwrap()
}

fn message(bits: usize, seed: u64) -> Message {
    Message::random(bits, &mut ChaCha8Rng::seed_from_u64(seed)).unwrap()
}

/// Logits of size 1 for a word.
fn logits(word: &Message) -> Vec<f32> {
    word.targets().map(|target| 2.0 * target - 1.0).collect()
}

#[test]
fn words_differ_in_24_bits_at_least_and_in_about_half() {
    let words = codewords(MessageLength::new(16).unwrap());
    // Linear: distances are the weights of words.
    let weights: Vec<u32> = words[1..].iter().map(|word| word.count_ones()).collect();
    assert_eq!(weights.iter().min(), Some(&24));
    assert_eq!(words[0], 0);
    let mean = weights.iter().sum::<u32>() as f64 / weights.len() as f64;
    assert!((mean - 32.0).abs() < 0.01, "{mean}");
}

#[test]
fn what_does_not_fit_is_an_error() {
    assert!(MessageCode::coded(0, 1).is_err());
    let error = MessageCode::coded(17, 1).unwrap_err().to_string();
    assert_eq!(error, "bits of a coded message: 17 is above 16");
    let code = code(12);
    assert!(code.word(&message(16, 1)).is_err());
    assert!(code.read(&[1.0; 63]).is_err());
    assert!(code.margin(&[1.0; 64], &message(16, 1)).is_err());
    assert!(code.wrong_bits(&[1.0; 64], &message(16, 1)).is_err());
    assert!(MessageCode::Plain.margin(&[1.0; 8], &message(16, 1)).is_err());
    // Whatever logits are, something is read.
    for odd in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, 0.0] {
        code.read(&[odd; 64]).unwrap();
        code.margin(&[odd; 64], &message(12, 1)).unwrap();
    }
    assert!(!format!("{code:?}").contains("cdef"));
}

#[test]
fn a_fifth_of_wrong_bits_is_corrected_and_bit_by_bit_none_is() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let (mut lost, tries) = (0, 300);
    for seed in 0..tries {
        let (code, sent) = (code(16), message(16, seed));
        // A mean of 0.84 deviations: a fifth of the signs are wrong.
        let word = code.word(&sent).unwrap();
        let noisy =
            |logit: f32| 0.84 * logit + <StandardNormal as Distribution<f32>>::sample(&StandardNormal, &mut rng);
        let read: Vec<f32> = logits(&word).into_iter().map(noisy).collect();
        lost += u32::from(code.wrong_bits(&read, &sent).unwrap() > 0);
    }
    // Measured: 4 %.
    assert!(lost * 12 < tries as u32, "{lost} of {tries}");
    let sent = message(16, 1);
    let mut read = logits(&sent);
    read[3] = -read[3];
    read[4] = 0.0;
    assert_eq!(MessageCode::Plain.wrong_bits(&read, &sent).unwrap(), 2);
}

#[test]
fn margins_are_of_the_weakest_bit_or_the_nearest_word() {
    let sent = message(16, 3);
    let mut read = logits(&sent);
    read[5] *= 0.25;
    assert_eq!(MessageCode::Plain.margin(&read, &sent).unwrap(), 0.25);
    read[5] = -read[5];
    assert_eq!(MessageCode::Plain.margin(&read, &sent).unwrap(), -0.25);
    let code = code(16);
    let read = logits(&code.word(&sent).unwrap());
    assert_eq!(code.margin(&read, &sent).unwrap(), 1.0);
    let halves: Vec<f32> = read.iter().map(|logit| 0.5 * logit).collect();
    assert_eq!(code.margin(&halves, &sent).unwrap(), 0.5);
    // Another message is as far from being read as this one is read.
    assert!(code.margin(&read, &message(16, 4)).unwrap() < 0.0);
}

#[test]
fn margin_and_reading_agree() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for _ in 0..50 {
        let code = code(10);
        let read: Vec<f32> = (0..64).map(|_| rng.random_range(-1.0..1.0)).collect();
        let best = code.read(&read).unwrap();
        assert!(code.margin(&read, &best).unwrap() >= 0.0);
        let other = best.xor(&Message::from_integer(1, best.length())).unwrap();
        assert!(code.margin(&read, &other).unwrap() <= 0.0);
    }
}

proptest! {
    #[test]
    fn eleven_wrong_bits_of_one_size_are_always_corrected(
        bits in 1_usize..=16, pad: u64, seed: u64, wrong in prop::collection::hash_set(0_usize..64, 0..=11)
    ) {
        let (code, sent) = (MessageCode::coded(bits, pad).unwrap(), message(bits, seed));
        let mut read = logits(&code.word(&sent).unwrap());
        for place in wrong {
            read[place] = -read[place];
        }
        prop_assert_eq!(code.read(&read).unwrap(), sent);
        prop_assert_eq!(code.messages(), Some(1 << bits));
    }
}
