//! Attacks as text.
use proptest::prelude::*;

use super::attack;
use crate::attack::{Attack, AttackKind, MAX_STEPS, Step, Strength};

fn refused(text: &str) -> String {
    text.parse::<Attack>().unwrap_err().to_string()
}

#[test]
fn texts_are_read_and_printed() {
    for text in [
        "none",
        "jpeg:10",
        "noise:0.1",
        "rotate:-30..30",
        "flip",
        "crop:0.6+brightness:1.3+jpeg:50",
        "quarter-turns:1..3",
        "tint:1.05/1/0.95",
        "tint:0.95..1.05/1/1..1.1",
        "brightness:1.05+crop:0.8+fit:600+jpeg-turbo:80",
    ] {
        assert_eq!(attack(text).to_string(), text);
    }
    assert_eq!(attack("blur:3.0").to_string(), "blur:3");
    assert_eq!(attack("hue:0.25..0.25").to_string(), "hue:0.25");
    assert_eq!(attack("rotate:-0").to_string(), "rotate:0");
    assert_eq!(attack("none").steps(), []);
}

#[test]
fn bad_texts_are_refused_with_the_limits() {
    for (text, reason) in [
        ("jpeg:0", "jpeg: 0 is not a whole number from 1 to 100"),
        ("jpeg:101", "jpeg: 101 is not a whole number from 1 to 100"),
        ("jpeg:9.5", "jpeg: 9.5 is not a whole number from 1 to 100"),
        ("jpeg", "jpeg: needs a whole number from 1 to 100"),
        ("jpeg:10..200", "jpeg: 10..200 is not a whole number from 1 to 100"),
        (
            "jpeg:ten",
            "jpeg: \"ten\" is not a number; needs a whole number from 1 to 100",
        ),
        (
            "jpeg:",
            "jpeg: \"\" is not a number; needs a whole number from 1 to 100",
        ),
        (
            "blur:3 ",
            "blur: \"3 \" is not a number; needs an odd number from 1 to 31",
        ),
        ("blur:4", "blur: 4 is not an odd number from 1 to 31"),
        ("noise:-0.1", "noise: -0.1 is not a number from 0 to 1"),
        (
            "noise:NaN",
            "noise: NaN..NaN is not a range of finite numbers from low to high; needs a number from 0 to 1",
        ),
        (
            "rotate:30..-30",
            "rotate: 30..-30 is not a range of finite numbers from low to high; needs a number from -360 to 360",
        ),
        ("flip:1", "flip: takes no strength, but has 1"),
        ("tint:1/2", "tint: \"1/2\" is not a number; needs a number from 0 to 10"),
        ("tint:1/1/11", "tint: 1/1/11 is not a number from 0 to 10"),
        (
            "brightness:1/1/1",
            "brightness: 1/1/1 is three numbers; needs a number from 0 to 10",
        ),
        ("window:0", "window: 0 is not a whole number from 1 to 16383"),
    ] {
        assert_eq!(refused(text), reason);
    }
    for text in ["", "+", "none+flip", "flip+", "JPEG:10", " flip", "melt:1"] {
        assert!(refused(text).contains("is none of none, jpeg, webp"), "{text:?}");
    }
    let chain = vec!["flip"; MAX_STEPS].join("+");
    assert_eq!(attack(&chain).steps().len(), MAX_STEPS);
    assert_eq!(refused(&format!("{chain}+flip")), "attack: more than 16 steps");
}

#[test]
fn messages_do_not_grow_with_the_text() {
    assert!(refused(&"x".repeat(100_000)).len() < 400);
    assert!(refused(&format!("jpeg:{}", "9".repeat(100_000))).len() < 800);
    assert!(refused(&"flip+".repeat(100_000)).len() < 400);
}

#[test]
fn json_holds_the_text() {
    let attacks = vec![attack("none"), attack("crop:0.4+jpeg:10")];
    let json = serde_json::to_string(&attacks).unwrap();
    assert_eq!(json, r#"["none","crop:0.4+jpeg:10"]"#);
    assert_eq!(serde_json::from_str::<Vec<Attack>>(&json).unwrap(), attacks);
    let error = serde_json::from_str::<Attack>(r#""bits:9""#).unwrap_err();
    assert_eq!(error.to_string(), "bits: 9 is not a whole number from 1 to 8");
}

#[test]
fn names_are_distinct_and_short_enough_for_keys() {
    let mut names = AttackKind::ALL.map(AttackKind::name);
    assert!(
        names
            .iter()
            .all(|name| (1..=14).contains(&name.len()) && name.is_ascii())
    );
    names.sort_unstable();
    assert!(names.windows(2).all(|pair| pair[0] != pair[1]));
}

/// Any step, its strength a number or a range within the limits.
pub(super) fn step() -> impl Strategy<Value = Step> {
    (0..AttackKind::ALL.len(), 0.0..=1.0f64, 0.0..=1.0f64, any::<bool>()).prop_map(|(kind, one, other, range)| {
        let kind = AttackKind::ALL[kind];
        let strength = kind.limits().map(|(least, most)| {
            let at = |share: f64| {
                let value = least + share * (most - least);
                // Odd numbers are whole, and so are all that need be.
                [value, value.round(), (value / 2.0).floor() * 2.0 + 1.0]
                    .into_iter()
                    .find(|value| {
                        let strength = Strength::new(*value, *value).unwrap();
                        Step::new(kind, Some(strength)).is_ok()
                    })
                    .unwrap_or(least)
            };
            let (low, high) = (
                at(one.min(other)),
                at(if range { one.max(other) } else { one.min(other) }),
            );
            Strength::new(low, high).unwrap()
        });
        Step::new(kind, strength).unwrap()
    })
}

proptest! {
    #[test]
    fn what_is_printed_reads_back(steps in prop::collection::vec(step(), 0..=MAX_STEPS)) {
        let attack = Attack::new(steps).unwrap();
        prop_assert_eq!(attack.to_string().parse::<Attack>().unwrap(), attack.clone());
        let json = serde_json::to_string(&attack).unwrap();
        prop_assert_eq!(serde_json::from_str::<Attack>(&json).unwrap(), attack);
    }

    #[test]
    fn no_text_panics_and_what_is_read_prints_alike(text in "[a-z:+.0-9-]{0,24}") {
        if let Ok(attack) = text.parse::<Attack>() {
            prop_assert_eq!(attack.to_string().parse::<Attack>().unwrap(), attack);
        }
    }

    #[test]
    fn what_is_drawn_is_fixed_and_allowed(step in step(), seed: u64, index: u64) {
        let drawn = Attack::new(vec![step]).unwrap().drawn(seed, index).steps()[0];
        prop_assert_eq!(drawn.kind(), step.kind());
        let again = match drawn.channels() {
            Some(channels) => Step::tint(channels),
            None => Step::new(drawn.kind(), drawn.strength()),
        };
        prop_assert_eq!(again.unwrap(), drawn);
        for one in drawn.channels().into_iter().flatten() {
            let range = step.strength().unwrap();
            prop_assert!(one.is_fixed() && range.low() <= one.low() && one.high() <= range.high());
        }
        if let (Some(range), Some(one)) = (step.strength(), drawn.strength()) {
            prop_assert!(one.is_fixed() && range.low() <= one.low() && one.high() <= range.high());
        }
    }
}
