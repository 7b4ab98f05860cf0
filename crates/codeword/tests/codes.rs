//! The codes as they are used: every pattern that they promise to correct, and how often they are wrong.
use guardsplat_codeword::{Code, Message};
use proptest::prelude::*;
use rand::seq::index::sample;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

/// A random codeword and its information.
fn random(code: Code, rng: &mut ChaCha8Rng) -> (u64, u64) {
    let information = rng.random::<u64>() >> (64 - code.information_bits());
    (information, code.encode(information).unwrap().to_u64().unwrap())
}

fn logits(word: u64, size: f32) -> Vec<f32> {
    Message::from_u64(word)
        .bits()
        .map(|bit| if bit { size } else { -size })
        .collect()
}

/// Patterns of errors: all of weight 0 to 2, and `sampled` of each weight above, up to `heaviest`.
fn patterns(heaviest: u32, sampled: usize, rng: &mut ChaCha8Rng) -> Vec<u64> {
    let mut patterns = vec![0];
    for a in 0..64 {
        patterns.push(1 << a);
        patterns.extend((a + 1..64).map(|b| 1_u64 << a | 1 << b));
    }
    for weight in 3..=heaviest {
        let draw = |_| {
            sample(rng, 64, weight as usize)
                .into_iter()
                .fold(0_u64, |mask, i| mask | 1 << i)
        };
        patterns.extend((0..sampled).map(draw));
    }
    patterns
}

#[test]
fn all_errors_up_to_t_are_corrected_and_counted() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    for code in Code::ALL {
        for pattern in patterns(code.corrects(), 2000, &mut rng) {
            let (information, word) = random(code, &mut rng);
            let decoded = code.decode(&Message::from_u64(word ^ pattern)).unwrap().unwrap();
            assert_eq!(decoded.information, information, "{code:?} {pattern:x}");
            assert_eq!((decoded.corrected_bits, decoded.filled_bits), (pattern.count_ones(), 0));
            assert_eq!(decoded.codeword, Message::from_u64(word));
        }
    }
}

#[test]
fn logits_of_one_size_are_corrected_as_well() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for code in Code::ALL {
        for pattern in patterns(code.corrects(), 40, &mut rng).into_iter().step_by(13) {
            let (information, word) = random(code, &mut rng);
            let decoded = code.decode_logits(&logits(word ^ pattern, 3.0)).unwrap().unwrap();
            assert_eq!(
                (decoded.information, decoded.corrected_bits),
                (information, pattern.count_ones())
            );
        }
    }
}

#[test]
fn one_error_more_than_t_is_seen_and_not_miscorrected() {
    // The minimum distance is 2 t + 2, thanks to the parity bit.
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for code in Code::ALL {
        for _ in 0..5000 {
            let (_, word) = random(code, &mut rng);
            let pattern = sample(&mut rng, 64, code.corrects() as usize + 1)
                .into_iter()
                .fold(0_u64, |m, i| m | 1 << i);
            assert_eq!(code.decode(&Message::from_u64(word ^ pattern)).unwrap(), None);
        }
    }
}

#[test]
fn codewords_differ_in_the_minimum_distance_at_least() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for (code, distance) in Code::ALL.into_iter().zip([8, 12, 14]) {
        let lightest = (0..200_000)
            .map(|_| random(code, &mut rng).1.count_ones())
            .filter(|&ones| ones > 0)
            .min();
        assert!(
            lightest >= Some(distance) && lightest <= Some(distance + 8),
            "{code:?} {lightest:?}"
        );
    }
}

/// The share of all words within t bits of a codeword: 2^k (C(64, 0) + … + C(64, t)) / 2^64.
fn accepted_by_theory(code: Code) -> f64 {
    let mut ball = 0.0;
    let mut choose = 1.0;
    for i in 0..=code.corrects() {
        ball += choose;
        choose = choose * f64::from(64 - i) / f64::from(i + 1);
    }
    ball * 2_f64.powi(code.information_bits() as i32 - 64)
}

#[test]
fn random_words_are_accepted_as_often_as_theory_says() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let trials = 100_000;
    for (code, published) in Code::ALL.into_iter().zip([0.0834, 0.0309, 0.00485]) {
        let theory = accepted_by_theory(code);
        assert!((theory / published - 1.0).abs() < 0.005, "{theory}");
        let accepted = (0..trials)
            .filter(|_| code.decode(&Message::from_u64(rng.random())).unwrap().is_some())
            .count();
        let (measured, sigma) = (accepted as f64 / trials as f64, (theory / trials as f64).sqrt());
        assert!(
            (measured - theory).abs() < 4.0 * sigma,
            "{code:?}: {measured} for {theory}"
        );
    }
}

#[test]
fn undecided_bits_are_filled_in() {
    // Up to 2 t + 1 erasures leave one codeword; the flipped bits of Chase's algorithm cover 7 and t more.
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    for code in Code::ALL {
        for erased in 1..=7 {
            let (information, word) = random(code, &mut rng);
            let mut read = logits(word, 1.0);
            for place in sample(&mut rng, 64, erased) {
                read[place] = if place.is_multiple_of(2) { f32::NAN } else { 0.0 };
            }
            let decoded = code.decode_logits(&read).unwrap().unwrap();
            assert_eq!((decoded.information, decoded.corrected_bits), (information, 0));
            assert_eq!(decoded.filled_bits as usize, erased);
        }
    }
}

#[test]
fn confidences_save_payloads_that_are_lost_without() {
    // Gaussian logits with 5 % of wrong bits: mean 1.645 standard deviations on the right side.
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let noise = Normal::new(1.645_f32, 1.0).unwrap();
    let (mut hard, mut soft, trials) = (0, 0, 2000);
    for _ in 0..trials {
        let (information, word) = random(Code::Bch36, &mut rng);
        let read: Vec<f32> = logits(word, 1.0)
            .into_iter()
            .map(|sign| sign * noise.sample(&mut rng))
            .collect();
        let bits: Vec<bool> = read.iter().map(|&logit| logit > 0.0).collect();
        let right =
            |decoded: Option<guardsplat_codeword::Decoded>| decoded.is_some_and(|d| d.information == information);
        hard += u32::from(!right(Code::Bch36.decode(&Message::from_bits(&bits).unwrap()).unwrap()));
        soft += u32::from(!right(Code::Bch36.decode_logits(&read).unwrap()));
    }
    // P(Bin(64, 0.05) > 5) = 0.098.
    assert!((150..=250).contains(&hard), "{hard}");
    assert!(soft * 10 <= hard, "{soft} of {hard}");
}

#[test]
fn other_lengths_and_too_much_information_are_errors() {
    let short = Message::from_bits(&[true; 63]).unwrap();
    for code in Code::ALL {
        assert_eq!(
            code.decode(&short).unwrap_err().to_string(),
            "a coded word has 63 bits, not 64"
        );
        assert!(code.decode_logits(&[1.0; 65]).is_err() && code.decode_logits(&[]).is_err());
        assert!(code.encode(1 << code.information_bits()).is_err());
    }
}

proptest! {
    #[test]
    fn what_is_decoded_is_a_codeword_near_the_word(word: u64) {
        for code in Code::ALL {
            if let Some(decoded) = code.decode(&Message::from_u64(word)).unwrap() {
                prop_assert_eq!(code.encode(decoded.information).unwrap(), decoded.codeword);
                let differ = decoded.codeword.xor(&Message::from_u64(word)).unwrap().count_ones();
                prop_assert_eq!(differ, decoded.corrected_bits);
                prop_assert!(differ <= code.corrects());
            }
        }
    }

    #[test]
    fn no_logits_panic(logits in prop::collection::vec(prop::num::f32::ANY, 64)) {
        for code in Code::ALL {
            if let Some(decoded) = code.decode_logits(&logits).unwrap() {
                prop_assert_eq!(code.encode(decoded.information).unwrap(), decoded.codeword);
            }
        }
    }
}
