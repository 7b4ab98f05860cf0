//! Verdicts at their limits, and p-values whose calibration can be enumerated.
mod shares;

use super::*;
use crate::code::Code;
use crate::code::Payload;
use crate::message::MessageLength;
use crate::whiten::{Whitening, mark};
use proptest::prelude::*;

fn raw(bits: usize) -> Scheme {
    Scheme::Raw {
        bits: MessageLength::new(bits).unwrap(),
    }
}

fn reading(name: &str, logits: Vec<f32>) -> HypothesisReading {
    HypothesisReading {
        name: name.into(),
        views: 4,
        logits,
        tries: 1,
    }
}

/// Readings that share the rate alike.
fn alike(mut readings: Vec<HypothesisReading>) -> Vec<HypothesisReading> {
    let tries = readings.len() as u64;
    readings.iter_mut().for_each(|read| read.tries = tries);
    readings
}

/// Logits of a word, the first `wrong` of them on the wrong side and unsure.
fn logits(word: &Message, wrong: usize) -> Vec<f32> {
    let side =
        |(i, bit): (usize, bool)| if bit == (i < wrong) { -1.0 } else { 1.0 } * if i < wrong { 0.5 } else { 3.0 };
    word.bits().enumerate().map(side).collect()
}

fn target(id: &str, word: Message) -> Target {
    Target {
        id: id.into(),
        word,
        pad: None,
    }
}

fn claim<'a>(scheme: Scheme, readings: &'a [HypothesisReading], targets: &'a [Target]) -> Claim<'a> {
    Claim {
        scheme,
        readings,
        targets,
        targets_tried: None,
        other_tries: 1,
        rate: 1e-6,
    }
}

/// The p-value of a claim that is compared with something.
fn p_value_of(claim: &Claim<'_>) -> f64 {
    claim.test().unwrap().answer.best.unwrap().p_value
}

#[test]
fn rank_sums_decide_at_their_thresholds() {
    // Of so many bits the least clear may be wrong, as long as the rank sum is no less than that.
    for (bits, needed, wrong) in [(32, 494, 7), (48, 1022, 17), (64, 1718, 26), (72, 2126, 31)] {
        let word = Message::zeros(MessageLength::new(bits).unwrap());
        let targets = [target("ours", word)];
        for (wrong, verdict) in [(wrong, Verdict::Match), (wrong + 1, Verdict::NoMatch)] {
            let readings = [reading("as given", logits(&word, wrong))];
            let answer = claim(raw(bits), &readings, &targets).test().unwrap().answer;
            let best = answer.best.unwrap();
            assert_eq!(
                (answer.verdict, answer.needed_rank_sum),
                (verdict, Some(needed)),
                "{bits}"
            );
            assert_eq!((best.matched_bits, best.views), ((bits - wrong) as u32, 4));
            let rank_sum = signed_rank::largest(bits as u32) - signed_rank::largest(wrong as u32);
            assert_eq!(best.rank_sum, rank_sum);
            assert_eq!(best.p_alone, signed_rank::tail(bits as u32, rank_sum).unwrap());
            assert_eq!((answer.payload, answer.reason), (None, None));
        }
    }
}

#[test]
fn a_short_key_is_inconclusive_and_says_what_it_can_reach() {
    let word = Message::zeros(MessageLength::new(16).unwrap());
    let readings = [reading("as given", logits(&word, 0))];
    let targets = [target("ours", word)];
    let question = claim(raw(16), &readings, &targets);
    let answer = question.test().unwrap().answer;
    assert_eq!((answer.verdict, answer.needed_rank_sum), (Verdict::Inconclusive, None));
    let expected = "16 bits with 1 hypotheses can never reach a rate of 1e-6: all of them match by chance at a rate of up \
                    to 1.5e-5";
    assert_eq!(answer.reason.as_deref(), Some(expected));
    // What it can reach is enough for who asks for no more.
    assert_eq!(
        Claim { rate: 2e-5, ..question }.test().unwrap().answer.verdict,
        Verdict::Match
    );
}

#[test]
fn all_hypotheses_count() {
    let word = Message::from_u64(0x0123_4567_89ab_cdef);
    let readings = alike(vec![
        reading("as given", vec![-1.0; 64]),
        reading("mirrored", logits(&word, 26)),
    ]);
    let targets = [
        target("theirs", Message::from_u64(!0)),
        target("ours", word),
        target("again", word),
    ];
    let question = Claim {
        other_tries: 5,
        ..claim(raw(64), &readings, &targets)
    };
    let answer = question.test().unwrap().answer;
    let best = answer.best.clone().unwrap();
    assert_eq!((answer.hypotheses, answer.verdict), (2 * 3 * 5, Verdict::NoMatch)); // alone, it would do
    assert_eq!(
        (best.hypothesis.as_str(), best.target.as_str(), best.matched_bits),
        ("mirrored", "ours", 38)
    );
    assert!(best.p_alone <= 1e-6 && best.p_value == 30.0 * best.p_alone);
    let searched = Claim {
        targets_tried: Some(1_000_000),
        rate: 1e-3,
        ..question
    };
    let answer = searched.test().unwrap().answer;
    assert_eq!(answer.hypotheses, 10_000_000);
    assert_eq!(answer.needed_rank_sum, signed_rank::least(64, 1e-10, 1).unwrap());
    // Whatever was tried, the p-value is a probability.
    let often = Claim {
        other_tries: 1 << 60,
        ..question
    };
    assert_eq!(often.test().unwrap().answer.best.unwrap().p_value, 1.0);
}

#[test]
fn nothing_to_compare_with_is_an_unknown_key_and_nothing_read_is_inconclusive() {
    let readings = [reading("as given", vec![1.0; 64])];
    let tested = claim(raw(64), &readings, &[]).test().unwrap();
    assert_eq!((tested.answer.verdict, tested.confidences), (Verdict::UnknownKey, None));
    assert!(tested.answer.best.is_none() && tested.answer.reason.is_some());

    let targets = [target("ours", Message::from_u64(!0))];
    let answer = claim(raw(64), &[], &targets).test().unwrap().answer;
    assert_eq!(
        (answer.verdict, answer.reason.as_deref()),
        (Verdict::Inconclusive, Some("no picture was read"))
    );

    let mut unsure = vec![1.0; 64];
    unsure[..27].fill(f32::NAN);
    let readings = [reading("as given", unsure.clone())];
    let answer = claim(raw(64), &readings, &targets).test().unwrap().answer;
    let reason = "at most 37 of 64 bits could be decided: were all of them right, it would be no match";
    assert_eq!(
        (answer.verdict, answer.reason.as_deref()),
        (Verdict::Inconclusive, Some(reason))
    );
    // One bit more decides, and undecided bits count as not matching.
    unsure[0] = 1.0;
    let readings = [reading("as given", unsure)];
    let tested = claim(raw(64), &readings, &targets).test().unwrap();
    let best = tested.answer.best.unwrap();
    assert_eq!(
        (tested.answer.verdict, best.matched_bits, best.undecided_bits),
        (Verdict::Match, 38, 26)
    );
    let confidences = tested.confidences.unwrap();
    assert_eq!((confidences.bits[1], confidences.bits[63]), (0.0, 0.5_f32.tanh()));
}

#[test]
fn a_match_of_a_coded_scheme_says_what_was_embedded() {
    let whitening = Whitening {
        secret: &[5; 32],
        asset: b"lego",
        nonce: &[6; 16],
    };
    for code in Code::ALL {
        let payload = Payload {
            key: 77,
            number: 123_456,
        };
        let mark = mark(code, payload, &whitening).unwrap();
        let targets = [Target {
            pad: Some(mark.pad),
            ..target("ours", mark.word)
        }];
        for wrong in [0, 1, code.corrects() as usize] {
            let readings = [reading("as given", logits(&mark.word, wrong))];
            let answer = claim(Scheme::Coded { code }, &readings, &targets)
                .test()
                .unwrap()
                .answer;
            let read = ReadPayload::Read {
                payload,
                corrected_bits: wrong as u32,
                filled_bits: 0,
                as_registered: true,
            };
            assert_eq!((answer.verdict, answer.payload), (Verdict::Match, Some(read)));
        }
        // Without the pad, and for another word, nothing is read.
        let bare = [target("ours", mark.word)];
        let readings = [reading("as given", logits(&mark.word, 0))];
        let answer = claim(Scheme::Coded { code }, &readings, &bare).test().unwrap().answer;
        assert_eq!((answer.verdict, answer.payload), (Verdict::Match, None));
        let other = [reading("as given", logits(&mark.pad, 0))];
        let answer = claim(Scheme::Coded { code }, &other, &targets).test().unwrap().answer;
        assert_eq!((answer.verdict, answer.payload), (Verdict::NoMatch, None));
    }
}

#[test]
fn error_correction_never_decides() {
    // A word that decodes to the very payload isn't a match when its matches do not make one: the code of 30 bits reads
    // through 6 wrong bits, and at a rate of 1e-18 no more than the 3 least clear may be wrong.
    let whitening = Whitening {
        secret: &[5; 32],
        asset: b"lego",
        nonce: &[6; 16],
    };
    let mark = mark(Code::Bch30, Payload { key: 1, number: 2 }, &whitening).unwrap();
    let targets = [Target {
        pad: Some(mark.pad),
        ..target("ours", mark.word)
    }];
    let readings = [reading("as given", logits(&mark.word, 6))];
    let strict = Claim {
        rate: 1e-18,
        ..claim(Scheme::Coded { code: Code::Bch30 }, &readings, &targets)
    };
    let answer = strict.test().unwrap().answer;
    assert_eq!((answer.verdict, answer.payload), (Verdict::NoMatch, None));
    // And a match whose payload is lost stays a match, whatever is made of the payload.
    let readings = [reading(
        "as given",
        logits(&mark.word, 13).iter().map(|l| l.signum()).collect(),
    )];
    let answer = claim(Scheme::Coded { code: Code::Bch30 }, &readings, &targets)
        .test()
        .unwrap()
        .answer;
    assert_eq!(answer.verdict, Verdict::Match);
    assert!(!matches!(
        answer.payload,
        Some(ReadPayload::Read {
            as_registered: true,
            ..
        })
    ));
}

#[test]
fn p_values_are_calibrated_for_every_word_that_could_be_read() {
    // All 1024 equally likely targets of 10 bits: for any reading, with undecided bits or not, p <= x for a share of at
    // most x of them; exactly x where x is attained and all bits are decided.
    let constant = vec![1.0; 10];
    let mixed: Vec<f32> = (0..10).map(|i| (i % 3) as f32 - 1.0).collect();
    for (logits, decided) in [(constant, true), (mixed, false)] {
        let readings = [reading("as given", logits)];
        let p_value = |value: u32| {
            let bits: Vec<bool> = (0..10).map(|i| value >> i & 1 == 1).collect();
            let targets = [target("wrong", Message::from_bits(&bits).unwrap())];
            p_value_of(&claim(raw(10), &readings, &targets))
        };
        let all: Vec<f64> = (0..1024).map(p_value).collect();
        for &x in &all {
            let share = all.iter().filter(|&&p| p <= x).count() as f64 / 1024.0;
            assert!(if decided { share == x } else { share <= x }, "{share} for {x}");
        }
    }
}

#[test]
fn what_does_not_fit_together_is_an_error() {
    let readings = [reading("as given", vec![1.0; 64])];
    let targets = [target("ours", Message::from_u64(0))];
    let good = claim(raw(64), &readings, &targets);
    let text = |claim: Claim<'_>| claim.test().unwrap_err().to_string();
    assert_eq!(
        text(Claim {
            scheme: raw(63),
            ..good
        }),
        r#"reading "as given" has 64 bits, not 63"#
    );
    let short = [target("ours", Message::from_bits(&[true]).unwrap())];
    assert_eq!(
        text(Claim {
            targets: &short,
            ..good
        }),
        r#"target "ours" has 1 bits, not 64"#
    );
    let padded = [Target {
        pad: Some(short[0].word),
        ..targets[0].clone()
    }];
    assert_eq!(
        text(Claim {
            targets: &padded,
            ..good
        }),
        r#"the pad of target "ours" has 1 bits, not 64"#
    );
    assert_eq!(
        text(Claim { rate: f64::NAN, ..good }),
        "rate: NaN is not above 0 and below 1"
    );
    assert_eq!(
        text(Claim { other_tries: 0, ..good }),
        "other tries: 0 is below 1: this claim counts"
    );
    let fewer = Claim {
        targets_tried: Some(0),
        ..good
    };
    assert_eq!(text(fewer), "targets tried: 0 are fewer than the 1 targets given");
    let many = Claim {
        targets_tried: Some(u64::MAX),
        other_tries: 2,
        ..good
    };
    assert_eq!(text(many), "hypotheses: more than 2^64 - 1 were tried");
}

#[test]
fn answers_come_back_from_json_without_confidences() {
    let targets = [target("ours", Message::from_u64(0))];
    let readings = [reading("as given", vec![-1.0; 64])];
    let answer = claim(raw(64), &readings, &targets).test().unwrap().answer;
    let json = serde_json::to_string(&answer).unwrap();
    assert_eq!(serde_json::from_str::<Answer>(&json).unwrap(), answer);
    assert!(
        json.contains(r#""verdict":"match""#) && !json.contains("confidence") && !json.contains("logit"),
        "{json}"
    );
}

proptest! {
    #[test]
    fn no_input_panics_and_matches_are_at_or_below_the_rate(
        readings in prop::collection::vec(prop::collection::vec(prop::num::f32::ANY, 0..70), 0..3),
        targets in prop::collection::vec((any::<u64>(), any::<Option<u64>>()), 0..4),
        tried: Option<u64>,
        other_tries: u64,
        rate in prop_oneof![prop::num::f64::ANY, 1e-3..0.9],
    ) {
        let full = |mut logits: Vec<f32>| { if logits.len() > 3 { logits.resize(64, 0.5) }; logits };
        let readings: Vec<HypothesisReading> = readings.into_iter().map(|logits| reading("any", full(logits))).collect();
        let readings = alike(readings);
        let targets: Vec<Target> = targets
            .into_iter()
            .map(|(word, pad)| Target { pad: pad.map(Message::from_u64), ..target("any", Message::from_u64(word)) })
            .collect();
        let claim = Claim {
            scheme: Scheme::default(),
            readings: &readings,
            targets: &targets,
            targets_tried: tried,
            other_tries: other_tries >> 40,
            rate,
        };
        if let Ok(Tested { answer, .. }) = claim.test() {
            let p = answer.best.as_ref().map(|best| best.p_value);
            match answer.verdict {
                Verdict::Match => prop_assert!(p.unwrap() <= rate),
                Verdict::NoMatch => prop_assert!(p.unwrap() > rate),
                Verdict::Inconclusive | Verdict::UnknownKey => prop_assert!(answer.reason.is_some()),
            }
        }
    }
}
