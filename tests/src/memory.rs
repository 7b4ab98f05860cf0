//! What memory an embedding was predicted to need, and what it had in use at most.
use serde_json::Value;

use crate::TestEnvironment;

/// Prediction and peak of one embedding, in bytes.
#[derive(Clone, Debug)]
pub struct Footprint {
    /// Gaussians of the scene.
    pub gaussians: u64,
    /// What was predicted before the work.
    pub predicted: u64,
    /// Its parts, by name.
    pub parts: Value,
    /// The most that was in use at once.
    pub peak: u64,
    /// Seconds that it took.
    pub seconds: f64,
}

impl Footprint {
    /// Marks a sample of so many Gaussians of degree 3 on the CPU, with these settings in place of the preset's
    /// `standard`; a process of its own, or an earlier peak would be seen.
    ///
    /// # Panics
    /// When that fails.
    #[track_caller]
    pub fn of_sample(gaussians: u64, settings: &str) -> Self {
        let environment = TestEnvironment::new();
        environment.write("settings.json", settings);
        environment.exits(
            &format!("sample in.ply --gaussians {gaussians} --sh-degree 3 --seed 5"),
            0,
        );
        environment.exits("key create --bits 32 --seed 1 -o k.key --device cpu", 0);
        let embed =
            "embed in.ply out.ply --key k.key --message 8f3a5c71 --settings settings.json --device cpu --force --json";
        let output = environment.run(embed);
        // Whether it reached its target is of no interest here: that is code 3.
        assert!(matches!(output.status.code(), Some(0 | 3)), "{output:?}");
        let report: Value = serde_json::from_slice(&output.stdout).expect("a report");
        let number = |field: &str| report[field].as_u64().unwrap_or_else(|| panic!("{field}: {report}"));
        Self {
            gaussians: number("gaussians"),
            predicted: number("predicted_memory_bytes"),
            parts: report["predicted_memory"].clone(),
            peak: number("peak_memory_bytes"),
            seconds: report["seconds"].as_f64().unwrap_or(f64::NAN),
        }
    }

    /// How much more was predicted than used, as a share of what was used; negative when it was less.
    pub fn excess(&self) -> f64 {
        self.predicted as f64 / self.peak as f64 - 1.0
    }
}
