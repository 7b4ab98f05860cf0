//! Memory that is predicted before an embedding holds against what it takes.
use guardsplat_tests::Footprint;

/// Few steps with few kept views: these are all there from the first step on, as they would be after many.
const SETTINGS: &str =
    r#"{"steps": 3, "pool_views": 16, "early_stop": null, "verify": {"views": 2, "message_views": 1}}"#;
const MOST_OFF: f64 = 0.2;

#[track_caller]
fn holds(gaussians: u64) {
    let found = Footprint::of_sample(gaussians, SETTINGS);
    assert!(found.excess().abs() < MOST_OFF, "{:+.3}: {found:?}", found.excess());
}

#[test]
fn of_a_thousand_gaussians() {
    holds(1_000);
}

#[test]
fn of_a_hundred_thousand_gaussians() {
    holds(100_000);
}

#[test]
fn of_a_million_gaussians() {
    holds(1_000_000);
}
