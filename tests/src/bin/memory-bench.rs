//! Holds the memory that embeddings are predicted to need against their peaks, as a table.
//!
//! `cargo run --release --bin memory-bench` (which needs `cargo build --release --workspace` before).
//! Arguments: numbers of Gaussians (1000 100000 1000000), and settings in JSON that replace those of the preset `standard`
//! (only 70 steps, by which the kept views fill their room). Exits with 1 when a prediction is off by 20 % or more.
use std::process::ExitCode;

use guardsplat_tests::Footprint;

/// Steps without those that change nothing any more.
const SETTINGS: &str = r#"{"steps": 70}"#;
const MOST_OFF: f64 = 0.2;

fn main() -> ExitCode {
    let (settings, numbers): (Vec<String>, Vec<String>) =
        std::env::args().skip(1).partition(|text| text.starts_with('{'));
    let settings = settings.first().map_or(SETTINGS, String::as_str);
    let Ok(mut sizes) = numbers.iter().map(|text| text.parse()).collect::<Result<Vec<u64>, _>>() else {
        eprintln!("error: wants numbers of Gaussians, and settings in JSON");
        return ExitCode::FAILURE;
    };
    if sizes.is_empty() {
        sizes = vec![1_000, 100_000, 1_000_000];
    }
    println!("settings {settings}, sizes in MB\n");
    println!(
        "| Gaussians | predicted | peak | predicted / peak - 1 | parts predicted | seconds |\n|---|---|---|---|---|---|"
    );
    let mut worst = 0.0f64;
    for gaussians in sizes {
        let found = Footprint::of_sample(gaussians, settings);
        let megabytes = |bytes: u64| bytes as f64 / 1e6;
        let parts = found.parts.as_object().into_iter().flatten();
        let parts: Vec<String> = parts
            .map(|(name, bytes)| format!("{name} {:.0}", megabytes(bytes.as_u64().unwrap_or(0))))
            .collect();
        println!(
            "| {} | {:.0} | {:.0} | {:+.1} % | {} | {:.0} |",
            found.gaussians,
            megabytes(found.predicted),
            megabytes(found.peak),
            100.0 * found.excess(),
            parts.join(", "),
            found.seconds
        );
        worst = worst.max(found.excess().abs());
    }
    ExitCode::from(u8::from(worst >= MOST_OFF))
}
