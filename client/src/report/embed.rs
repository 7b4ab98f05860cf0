//! How a mark came out.
use guardsplat_proto::v1::EmbedResult;
use serde::Serialize;

use super::credentials::CredentialsReport;
use super::text::{rows_ignored, seconds, some};
use crate::output::printable;

/// What came of a job that marked a scene.
#[derive(Debug, Serialize)]
pub struct EmbedReport {
    scene: String,
    comparison: String,
    bit_accuracy: f64,
    bit_accuracy_worst_view: f64,
    /// Null for an asset, whose word stays secret.
    message: Option<String>,
    message_recovered: bool,
    /// Null when the views are identical.
    psnr_db: Option<f64>,
    identical: bool,
    /// Null when the views are identical where the scene is.
    psnr_covered_db: Option<f64>,
    covered: f64,
    ssim: f64,
    lpips: Option<f64>,
    steps: u32,
    view_steps: u64,
    seconds: f64,
    device: String,
    clip: String,
    gaussians: u64,
    changed_gaussians: u64,
    ignored_rows: u64,
    evidence_html: Option<String>,
    evidence_json: Option<String>,
    /// Null unless they were asked for.
    credentials: Option<CredentialsReport>,
    target_missed: Vec<String>,
}

impl From<&EmbedResult> for EmbedReport {
    fn from(result: &EmbedResult) -> Self {
        Self {
            scene: result.scene.clone(),
            comparison: result.comparison.clone(),
            bit_accuracy: result.bit_accuracy,
            bit_accuracy_worst_view: result.bit_accuracy_worst_view,
            message: some(&result.message),
            message_recovered: result.message_recovered,
            psnr_db: result.psnr_db,
            identical: result.psnr_db.is_none(),
            psnr_covered_db: result.psnr_covered_db,
            covered: result.covered,
            ssim: result.ssim,
            lpips: result.lpips,
            steps: result.steps,
            view_steps: result.view_steps,
            seconds: seconds(result.duration),
            device: result.device.clone(),
            clip: result.clip.clone(),
            gaussians: result.gaussians,
            changed_gaussians: result.changed_gaussians,
            ignored_rows: result.ignored_rows,
            evidence_html: some(&result.evidence_html),
            evidence_json: some(&result.evidence_json),
            credentials: result.credentials.as_ref().map(Into::into),
            target_missed: result.target_missed.clone(),
        }
    }
}

impl EmbedReport {
    /// What missed the target.
    pub fn missed(&self) -> &[String] {
        &self.target_missed
    }

    /// For people.
    pub fn line(&self) -> String {
        let psnr = self.psnr_db.map_or("identical".into(), |db| format!("{db:.2} dB"));
        let message = match &self.message {
            Some(message) => format!("message {}", printable(message)),
            None => "codeword".into(),
        };
        format!(
            "bits {:.2} % (worst view {:.2} %), {message} {}, PSNR {psnr}, SSIM {:.4}; {} steps, {:.0} s on {}",
            100.0 * self.bit_accuracy,
            100.0 * self.bit_accuracy_worst_view,
            if self.message_recovered {
                "recovered"
            } else {
                "not recovered"
            },
            self.ssim,
            self.steps,
            self.seconds,
            printable(&self.device)
        ) + &self
            .evidence_html
            .as_ref()
            .map(|name| format!("\nevidence: {name}"))
            .unwrap_or_default()
            + &self
                .credentials
                .as_ref()
                .map(CredentialsReport::line)
                .unwrap_or_default()
            + &rows_ignored(self.ignored_rows)
    }
}
