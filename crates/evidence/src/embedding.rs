//! What a marking cost in quality, and how well the mark is read from views that training never saw.
use serde::{Deserialize, Serialize};

/// The figures of an embed job: means over held-out views of the marked file, as 8-bit pictures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Embedding {
    /// The payload that was written, in hexadecimal; for the owner only.
    pub payload: Option<String>,
    /// Mean share of right bits of a view, 0 to 1.
    pub bit_accuracy: f64,
    /// The same of the worst view.
    pub bit_accuracy_worst_view: f64,
    /// PSNR in dB; absent when the views are identical.
    pub psnr_db: Option<f64>,
    /// SSIM, −1 to 1.
    pub ssim: f64,
    /// LPIPS; absent where the worker has no weights for it.
    pub lpips: Option<f64>,
    /// What was asked for.
    pub target: Target,
    /// What misses it, in words; empty where nothing does.
    pub missed: Vec<String>,
    /// Gaussians of the scene.
    pub gaussians: u64,
    /// Gaussians whose colours changed.
    pub changed_gaussians: u64,
}

/// What a marking must reach; absent means that nothing was asked.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// Least mean share of right bits of a view, 0 to 1.
    pub bit_accuracy: Option<f64>,
    /// Least PSNR in dB.
    pub psnr_db: Option<f64>,
    /// Least SSIM.
    pub ssim: Option<f64>,
    /// Largest LPIPS.
    pub lpips: Option<f64>,
}
