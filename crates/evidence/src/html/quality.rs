//! What a marking cost, and how well its mark is read.
use super::text::sent;
use crate::embedding::Embedding;
use crate::words::grouped;
use maud::{Markup, html};

/// The figures beside what was asked for.
pub(super) fn section(embedding: &Embedding) -> Markup {
    let target = &embedding.target;
    let percent = |share: f64| format!("{:.2}\u{a0}%", share * 100.0);
    let decibels = |db: f64| format!("{db:.2}\u{a0}dB");
    let plain = |value: f64| format!("{value:.4}");
    let psnr = embedding.psnr_db.map_or("identical".into(), decibels);
    let lpips = embedding.lpips.map_or("not measured".into(), plain);
    let rows = [
        (
            "Bit accuracy, mean of views",
            percent(embedding.bit_accuracy),
            target.bit_accuracy.map(|t| (">", percent(t))),
        ),
        (
            "Bit accuracy, worst view",
            percent(embedding.bit_accuracy_worst_view),
            None,
        ),
        (
            "PSNR (more is better)",
            psnr,
            target.psnr_db.map(|t| (">", decibels(t))),
        ),
        (
            "SSIM (more is better)",
            plain(embedding.ssim),
            target.ssim.map(|t| (">", plain(t))),
        ),
        ("LPIPS (less is better)", lpips, target.lpips.map(|t| ("<", plain(t)))),
    ];
    html! {
        section {
            h2 { "Quality of the marked scene" }
            p { "Means over views that the optimisation never saw, as 8-bit pictures of the marked file." }
            @if let Some(payload) = &embedding.payload { p { "Payload written: " code { (payload) } } }
            table {
                caption { "Figures and what was asked for" }
                thead { tr { th scope="col" { "Figure" } th.number scope="col" { "Measured" } th.number scope="col" { "Asked for" } } }
                tbody {
                    @for (name, value, asked) in rows {
                        tr { th scope="row" { (name) } td.number { (value) } td.number {
                            @match asked {
                                Some((">", limit)) => { "at least " (limit) }
                                Some((_, limit)) => { "at most " (limit) }
                                None => "\u{2013}",
                            }
                        } }
                    }
                }
            }
            p { (grouped(embedding.changed_gaussians)) " of " (grouped(embedding.gaussians)) " Gaussians changed their colours." }
            @if !embedding.missed.is_empty() {
                h3 { "What misses the target" }
                ul { @for missed in &embedding.missed { li { (sent(missed)) } } }
            }
        }
    }
}
