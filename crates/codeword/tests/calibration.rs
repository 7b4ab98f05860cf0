//! P-values are true under a decoder that is biased and correlated, and wrong pooling is seen to fail.
#[path = "../examples/calibrate/simulation.rs"]
mod simulation;

use simulation::{Method, attainable, interval, run};

const CLAIMS: u64 = 100_000;

/// Shares of claims that may be at most 10^-k, and are, at the upper end of 5 standard deviations of a count.
fn holds(counts: [u64; 6]) -> bool {
    let most = |k: i32| CLAIMS as f64 * 10_f64.powi(-k);
    (1..)
        .zip(counts)
        .all(|(k, count)| count as f64 <= most(k) + 5.0 * most(k).sqrt() + 1.0)
}

#[test]
fn one_test_a_claim_is_calibrated() {
    let counts = run(Method::OneTest, CLAIMS, 1);
    assert!(holds(counts), "{counts:?}");
    // Not merely below: as often as the exact tail says, within 5 standard deviations.
    for (k, count) in (1..).zip(counts) {
        let expected = CLAIMS as f64 * attainable(k);
        let off = (count as f64 - expected).abs();
        assert!(
            off <= 5.0 * expected.sqrt() + 1.0,
            "p <= 1e-{k}: {count} for {expected}"
        );
    }
}

#[test]
fn hypotheses_that_are_counted_are_calibrated_and_others_are_not() {
    let counts = run(Method::SeveralHypotheses, CLAIMS / 2, 2);
    assert!(holds(counts), "{counts:?}");
    let (low, _) = interval(run(Method::BestHypothesisOnly, CLAIMS / 2, 2)[1], CLAIMS / 2);
    assert!(low > 0.015, "{low}");
}

#[test]
fn views_counted_as_trials_are_not_calibrated() {
    // Two views that agree make every deviation twice as long: by 1e-4 there are more than ten times too many.
    let counts = run(Method::ViewsAsTrials, CLAIMS, 3);
    let (low, _) = interval(counts[3], CLAIMS);
    assert!(low > 10.0 * 1e-4, "{counts:?}");
    assert!(!holds(counts));
}
