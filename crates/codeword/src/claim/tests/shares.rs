//! What readings pay where they share the rate unevenly.
use super::*;

/// A reading with half of the rate needs a smaller rank sum than one of many with the other half; the least p-value wins,
/// not the largest rank sum.
#[test]
fn readings_pay_by_their_shares() {
    let word = Message::from_u64(0x0123_4567_89ab_cdef);
    let targets = [target("ours", word)];
    let with = |given: usize, guessed: usize| {
        let guess = |i: usize| HypothesisReading {
            tries: 2 * 500,
            ..reading("guess", logits(&word, if i == 0 { guessed } else { 32 }))
        };
        let given = HypothesisReading {
            tries: 2,
            ..reading("as given", logits(&word, given))
        };
        let readings: Vec<_> = std::iter::once(given).chain((0..500).map(guess)).collect();
        let answer = claim(raw(64), &readings, &targets).test().unwrap().answer;
        let best = answer.best.unwrap();
        (
            answer.verdict,
            best.hypothesis,
            answer.hypotheses,
            answer.needed_rank_sum,
        )
    };
    let (given, guess) = ("as given".to_owned(), "guess".to_owned());
    assert_eq!(with(25, 20), (Verdict::Match, given.clone(), 2, Some(1735)));
    assert_eq!(with(26, 21), (Verdict::NoMatch, given, 2, Some(1735)));
    assert_eq!(with(32, 21), (Verdict::NoMatch, guess.clone(), 1000, Some(1863)));
    assert_eq!(with(32, 20), (Verdict::Match, guess, 1000, Some(1863)));
    // Together they have the rate, and not more.
    let more = [reading("as given", vec![1.0; 64]), reading("again", vec![1.0; 64])];
    let error = claim(raw(64), &more, &targets).test().unwrap_err().to_string();
    assert_eq!(error, "tries: the readings have 2 times the rate together");
    let mut none = more;
    none[1].tries = 0;
    assert!(claim(raw(64), &none, &targets).test().is_err());
}

/// Wrong claims have small p-values no more often than they may, whatever the shares, though readings depend on each other.
#[test]
fn shares_keep_wrong_claims_rare() {
    let mut seed = 1_u64;
    let mut word = || {
        seed = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (seed ^ (seed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        Message::from_u64(mixed ^ (mixed >> 31))
    };
    let shares = [2, 4, 12, 12, 12];
    // Each reading differs from the first in a few bits: all are of one suspect.
    let base = word();
    let readings: Vec<_> = shares
        .iter()
        .enumerate()
        .map(|(i, &tries)| HypothesisReading {
            tries,
            ..reading("any", logits(&base, 2 * i))
        })
        .collect();
    let mut p_values: Vec<f64> = (0..20_000)
        .map(|_| {
            let targets = [target("theirs", word())];
            p_value_of(&claim(raw(64), &readings, &targets))
        })
        .collect();
    p_values.sort_by(f64::total_cmp);
    for rate in [0.3, 0.1, 0.03, 0.01] {
        let share = p_values.partition_point(|p| *p <= rate) as f64 / 20_000.0;
        assert!(
            share <= rate + 3.0 * (rate / 20_000.0_f64).sqrt(),
            "{share} of claims at {rate}"
        );
        assert!(share > 0.1 * rate, "{share} of claims at {rate}: nothing was tested");
    }
}
