//! Are p-values what they say? A million claims with wrong keys against a biased, correlated decoder.
//!
//! Prints the share of claims with p <= 10^-k beside what it may be at most. The first argument is another number of
//! claims. Views counted as trials, and hypotheses tried but not counted, are shown to fail.
mod simulation;

use simulation::{Method, attainable, interval, run};

fn main() {
    let claims: u64 = std::env::args()
        .nth(1)
        .and_then(|text| text.parse().ok())
        .unwrap_or(1_000_000);
    for (method, title) in [
        (Method::OneTest, "one test: logits summed over views, decided once"),
        (Method::SeveralHypotheses, "six hypotheses tried, all counted"),
        (
            Method::BestHypothesisOnly,
            "WRONG: six hypotheses tried, the best counted as the only one",
        ),
        (Method::ViewsAsTrials, "WRONG: each bit of each view counted as a trial"),
    ] {
        println!("{title}; {claims} claims");
        println!("  p at most   exact tail   share      95 % interval            true p-values?");
        for (k, count) in (1..).zip(run(method, claims, 1)) {
            let (low, high) = interval(count, claims);
            let (rate, share) = (10_f64.powi(-k), count as f64 / claims as f64);
            let exact = if method == Method::OneTest {
                format!("{:.2e}", attainable(k))
            } else {
                "-".into()
            };
            let holds = if low <= rate { "yes" } else { "NO" };
            println!("  {rate:<9.0e}   {exact:<10}   {share:<8.2e}   {low:.2e} to {high:.2e}     {holds}");
        }
    }
}
