//! Marks are made once, and chosen by variant and length.
use super::*;
use crate::evaluate::variants;
use guardsplat_engine::embed::Preset;

#[test]
fn a_mark_that_several_experiments_need_is_made_once() {
    let standard = Preset::Standard.settings();
    let trade = Trade {
        device: "cpu".into(),
        variants: variants(&standard, None, &[]).unwrap(),
    };
    let plan = plan(&Experiment::ALL, &standard, &[], &trade, &Robustness::default()).unwrap();
    assert_eq!(plan.judged, [32]);
    let timed: Vec<&str> = plan
        .wanted
        .iter()
        .filter(|w| w.timed)
        .map(|w| w.variant.as_str())
        .collect();
    assert_eq!(timed.len(), trade.variants.len());
    assert!(timed.contains(&"trade:cpu:draft") && timed.contains(&"trade:cpu:standard"));
    for (i, one) in plan.wanted.iter().enumerate() {
        one.settings.check().unwrap();
        let again = |other: &WantedMark| (other.bits, &other.variant) == (one.bits, &one.variant);
        assert!(!plan.wanted[i + 1..].iter().any(again), "{} {}", one.bits, one.variant);
    }
    let claimed: Vec<usize> = plan.wanted.iter().filter(|w| w.claims).map(|w| w.bits).collect();
    assert_eq!(claimed, [64]);
    let standard = plan
        .wanted
        .iter()
        .find(|w| w.bits == 32 && w.variant == "standard")
        .unwrap();
    let names: Vec<String> = standard.trials.iter().map(ToString::to_string).collect();
    for name in [
        "none",
        "prune-random:0.25",
        "format:spz",
        "sh-degree:0",
        "occlusion:0.2",
    ] {
        assert_eq!(names.iter().filter(|n| *n == name).count(), 1, "{name}");
    }
}

#[test]
fn variants_can_be_chosen() {
    let settings = Preset::Standard.settings();
    let robustness = Robustness::default();
    let mut plan = plan(
        &[Experiment::Robustness],
        &settings,
        &[],
        &Trade::default(),
        &robustness,
    )
    .unwrap();
    assert_eq!(plan.wanted.len(), 3);
    let error = plan.keep_only(&["strong".into()]).unwrap_err().to_string();
    assert!(error.contains("\"strong\" is none of standard, robust"), "{error}");
    plan.keep_only(&[]).unwrap();
    plan.keep_only(&[names::ROBUST.into()]).unwrap();
    assert_eq!(plan.wanted.len(), 1);
}

#[test]
fn lengths_can_be_chosen() {
    let plan = plan(
        &[Experiment::Capacity],
        &Preset::Standard.settings(),
        &[32, 64],
        &Trade::default(),
        &Robustness::default(),
    )
    .unwrap();
    let bits: Vec<usize> = plan.wanted.iter().map(|w| w.bits).collect();
    assert_eq!(bits, [32, 64]);
    let other = super::plan(
        &[Experiment::Security],
        &Preset::Standard.settings(),
        &[16],
        &Trade::default(),
        &Robustness::default(),
    )
    .unwrap();
    assert_eq!((other.wanted.len(), other.judged), (1, vec![16]));
}
