//! Intervals of a proportion, from successes among trials that are independent.
//!
//! The bits of one message and the views of one scene are not: see [`student_mean`](super::student_mean) for those.
use super::bad;
use super::interval::{Interval, normal_width, tail};
use crate::Result;
use statrs::function::beta::checked_beta_reg;

/// Wilson's score interval (1927) at a confidence such as 0.95, in `[0, 1]`; no trials give `[0, 1]`.
///
/// Centre `(p + z²/2n) / (1 + z²/n)`, half-width `z / (1 + z²/n) · √(p(1-p)/n + z²/4n²)`. Its coverage is close to the
/// confidence on average, below it for some proportions.
///
/// # Errors
/// More successes than trials, or a confidence outside (0, 1).
pub fn wilson(successes: u64, trials: u64, confidence: f64) -> Result<Interval> {
    let z = normal_width(confidence)?;
    check(successes, trials)?;
    if trials == 0 {
        return Ok(Interval { low: 0.0, high: 1.0 });
    }
    let n = trials as f64;
    let p = successes as f64 / n;
    let scale = 1.0 / (1.0 + z * z / n);
    let centre = scale * (p + z * z / (2.0 * n));
    let half = scale * z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    let mut interval = Interval::around(centre, half).within(0.0, 1.0);
    // Exact by the formula; rounding would exclude them.
    if successes == 0 {
        interval.low = 0.0;
    }
    if successes == trials {
        interval.high = 1.0;
    }
    Ok(interval)
}

/// The exact interval of Clopper and Pearson (1934) at a confidence such as 0.95; no trials give `[0, 1]`.
///
/// With `a = (1 - confidence) / 2` its ends are the quantile `a` of Beta(k, n-k+1) and the quantile `1-a` of
/// Beta(k+1, n-k). It covers the truth at least as often as the confidence says, whatever the proportion.
///
/// # Errors
/// More successes than trials, or a confidence outside (0, 1).
pub fn clopper_pearson(successes: u64, trials: u64, confidence: f64) -> Result<Interval> {
    let tail = tail(confidence)?;
    check(successes, trials)?;
    let (k, failures) = (successes as f64, (trials - successes) as f64);
    let low = if successes == 0 {
        0.0
    } else {
        beta_quantile(k, failures + 1.0, tail)?.0
    };
    let high = if successes == trials {
        1.0
    } else {
        beta_quantile(k + 1.0, failures, 1.0 - tail)?.1
    };
    Ok(Interval { low, high })
}

fn check(successes: u64, trials: u64) -> Result<()> {
    if successes > trials {
        return Err(bad(
            "successes",
            format!("{successes} are more than the {trials} trials"),
        ));
    }
    Ok(())
}

/// Neighbouring numbers below and above the quantile of a beta distribution.
///
/// By bisection, since it ends after as many steps as a number has bits whatever the shape; Newton's iteration, which
/// `statrs` has, promises no such thing.
fn beta_quantile(a: f64, b: f64, probability: f64) -> Result<(f64, f64)> {
    let (mut low, mut high) = (0.0_f64, 1.0_f64);
    // Near 0 numbers are dense, so that halving would take a thousand steps to end; 200 are below 1e-60.
    for _ in 0..200 {
        let middle = f64::midpoint(low, high);
        if middle <= low || middle >= high {
            break;
        }
        let below = checked_beta_reg(a, b, middle).map_err(|error| bad("proportion", error.to_string()))?;
        if below < probability {
            low = middle;
        } else {
            high = middle;
        }
    }
    Ok((low, high))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(interval: Interval, low: f64, high: f64, tolerance: f64) {
        assert!(
            (interval.low - low).abs() < tolerance && (interval.high - high).abs() < tolerance,
            "{interval:?} is not {low}, {high}"
        );
    }

    /// Newcombe, "Two-sided confidence intervals for the single proportion", Statistics in Medicine 17 (1998), table I.
    #[test]
    fn published_examples() {
        for (k, n, wilson_low, wilson_high, exact_low, exact_high) in [
            (81, 263, 0.2553, 0.3662, 0.2527, 0.3676),
            (15, 148, 0.0624, 0.1605, 0.0578, 0.1617),
            (0, 20, 0.0, 0.1611, 0.0, 0.1684),
            (1, 29, 0.0061, 0.1718, 0.0009, 0.1776),
        ] {
            close(wilson(k, n, 0.95).unwrap(), wilson_low, wilson_high, 6e-5);
            close(clopper_pearson(k, n, 0.95).unwrap(), exact_low, exact_high, 6e-5);
        }
    }

    #[test]
    fn no_failures_have_a_closed_form() {
        for n in [1_u64, 10, 1_000, 1_000_000] {
            let interval = clopper_pearson(n, n, 0.95).unwrap();
            close(interval, 0.025_f64.powf(1.0 / n as f64), 1.0, 1e-9);
            let none = clopper_pearson(0, n, 0.95).unwrap();
            close(none, 0.0, 1.0 - 0.025_f64.powf(1.0 / n as f64), 1e-9);
        }
    }

    /// By the definition: the ends are where the binomial tails have the probability that is left.
    #[test]
    fn exact_ends_cut_binomial_tails() {
        let n = 40_u64;
        let upper_tail = |k: u64, p: f64| -> f64 {
            let mut term = (1.0 - p).powi(n as i32);
            let mut sum = 0.0;
            for i in 0..=n {
                if i >= k {
                    sum += term;
                }
                term *= (n - i) as f64 / (i + 1) as f64 * p / (1.0 - p);
            }
            sum
        };
        for k in 1..n {
            let interval = clopper_pearson(k, n, 0.9).unwrap();
            assert!((upper_tail(k, interval.low) - 0.05).abs() < 1e-9, "{k}");
            assert!((1.0 - upper_tail(k + 1, interval.high) - 0.05).abs() < 1e-9, "{k}");
        }
    }

    #[test]
    fn many_trials_agree_with_the_normal_approximation() {
        let (k, n) = (300_000, 1_000_000);
        let half = 1.959_964 * (0.3_f64 * 0.7 / n as f64).sqrt();
        close(clopper_pearson(k, n, 0.95).unwrap(), 0.3 - half, 0.3 + half, 3e-6);
        close(wilson(k, n, 0.95).unwrap(), 0.3 - half, 0.3 + half, 3e-6);
    }

    #[test]
    fn none_and_too_many() {
        for interval in [wilson, clopper_pearson] {
            assert_eq!(interval(0, 0, 0.95).unwrap(), Interval { low: 0.0, high: 1.0 });
            assert!(interval(2, 1, 0.95).is_err());
            assert!(interval(1, 2, 1.0).is_err());
            let one = interval(1, 1, 0.95).unwrap();
            assert!(one.low > 0.0 && one.low < 0.3 && one.high == 1.0);
        }
    }
}
