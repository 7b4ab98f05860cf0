//! What became of an embedding, with the names of the programs' JSON.
use std::time::Duration;

use guardsplat_engine::embed::{Outcome, Preset};
use guardsplat_engine::extract::Engine;
use guardsplat_engine::memory::MemoryRequirements;
use guardsplat_engine::message::Key;
use guardsplat_engine::quality::Quality;
use guardsplat_engine::scene::Ignored;
use serde::Serialize;

/// The figures of a marked scene: means over held-out views of what was written, as 8-bit pictures.
#[derive(Serialize)]
pub struct EmbedReport<'a> {
    /// Mean share of right bits of a view.
    pub bit_accuracy: f64,
    /// The same of the worst view.
    pub bit_accuracy_worst_view: f64,
    /// The message as read from the first few views.
    pub message: String,
    /// Whether that is the message.
    pub message_recovered: bool,
    /// How much the mark shows.
    #[serde(flatten)]
    pub quality: Quality,
    /// PSNR over the pixels that the scene covers, dB.
    pub psnr_covered_db: Option<f64>,
    /// Mean share of a view that the scene covers.
    pub covered: f64,
    /// Steps taken.
    pub steps: usize,
    /// Views drawn in all steps.
    pub view_steps: usize,
    /// How long it took.
    pub seconds: f64,
    /// Where it was computed.
    pub device: &'a str,
    /// The key's CLIP.
    pub clip: &'a str,
    /// The preset.
    pub preset: &'a str,
    /// Bits of the message.
    pub bits: usize,
    /// Views of the verification.
    pub views: usize,
    /// Their side in pixels.
    pub size: u32,
    /// Gaussians of the scene.
    pub gaussians: usize,
    /// Those that training views show.
    pub seen_gaussians: usize,
    /// Those whose colours changed.
    pub changed_gaussians: usize,
    /// Rows of the file that were ignored.
    pub ignored_rows: usize,
    /// Training views that it took to find what can be seen.
    pub covering_views: usize,
    /// Memory that was predicted.
    pub predicted_memory_bytes: u64,
    /// The same by what it is for.
    pub predicted_memory: MemoryRequirements,
    /// The most that the process has had in use so far.
    pub peak_memory_bytes: Option<u64>,
    /// Whether the output was written.
    pub written: bool,
    /// What misses the target, in words.
    pub target_missed: &'a [String],
}

impl<'a> EmbedReport<'a> {
    /// What `engine` made with `key` in so much time.
    pub fn of(outcome: &'a Outcome, engine: &'a Engine, key: &'a Key, preset: Preset, duration: Duration) -> Self {
        let found = &outcome.verification;
        Self {
            bit_accuracy: found.comparison.bit_accuracy,
            bit_accuracy_worst_view: found.comparison.bit_accuracy_worst_view,
            message: found.message.to_string(),
            message_recovered: found.message_recovered,
            quality: found.quality,
            psnr_covered_db: found.psnr_covered_db,
            covered: found.covered,
            steps: outcome.steps,
            view_steps: outcome.view_steps,
            seconds: duration.as_secs_f64(),
            device: &engine.compute.name,
            clip: &key.clip.name,
            preset: preset.name(),
            bits: key.bits(),
            views: found.views,
            size: found.size,
            gaussians: outcome.gaussians,
            seen_gaussians: outcome.seen,
            changed_gaussians: outcome.changed,
            ignored_rows: outcome.ignored.as_ref().map_or(0, Ignored::count),
            covering_views: outcome.covering_views,
            predicted_memory_bytes: outcome.memory.total(),
            predicted_memory: outcome.memory,
            peak_memory_bytes: guardsplat_engine::memory::peak(),
            written: outcome.written,
            target_missed: &outcome.missed,
        }
    }
}
