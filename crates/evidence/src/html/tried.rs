//! What was tried, and how it is paid for.
use crate::tried::{HypothesisGroup, HypothesisKind, Tried};
use crate::verification::{Decision, Verification};
use crate::words::{counted, grouped};
use maud::{Markup, html};

/// Every framing and claim, and the number of hypotheses that they make.
pub(super) fn section(decision: &Decision, verification: &Verification) -> Markup {
    let tried = &verification.tried;
    let parts = tried.parts();
    let paid_by = |tries: &&u64| tried.hypotheses(**tries) == decision.hypotheses;
    let factor = parts.iter().find(paid_by).or(parts.first()).copied().unwrap_or(1);
    let shared = match parts.iter().all(|part| *part == parts[0]) {
        true => "All readings pay alike. ",
        false => {
            "What is likely beforehand pays less than what is a guess: files as given have half of the allowed rate of \
             errors, and each kind in the table half of what those before it leave; all guesses share what is left. "
        }
    };
    html! {
        section {
            h2 { "What was tried, and how it is paid for" }
            p { "Who looks often enough finds something by accident. So every reading that was decided on is compared with every
                claim, and pays: its p-value is multiplied. " (shared) "What was pooled into a reading costs nothing: it was
                decided once." }
            table {
                caption { "Framings of the suspect" }
                thead { tr { th scope="col" { "Framing" } th.number scope="col" { "Variants" } th.number scope="col" { "Each multiplied by" } } }
                tbody { @for framing in &tried.framings { (row(framing, tried.readings())) } }
                tfoot { tr { th scope="row" { "Readings" } td.number { (grouped(tried.readings())) } td {} } }
            }
            p { "Compared with the messages of " (counted(tried.assets, "asset", "assets")) " of "
                (counted(tried.owners, "owner", "owners")) ". " (paid(tried)) "That makes, for the reading that was decided on, " (grouped(factor))
                " \u{d7} " (grouped(tried.assets_paid()))
                @if let Some(paid) = tried.paid { " \u{d7} " (grouped(paid.readings)) }
                " = " strong { (counted(decision.hypotheses, "hypothesis", "hypotheses")) } "." }
        }
    }
}

/// What is counted beyond what was compared, and why.
fn paid(tried: &Tried) -> Markup {
    html! {
        @if let Some(paid) = tried.paid {
            "All " (counted(paid.assets, "asset", "assets")) " of the key are paid for, whichever the claim names: whoever
            registers many could name the one that fits best. This is the claimant\u{2019}s "
            (counted(paid.readings, "reading", "readings")) " of these files, counted from the first, and each is paid for. "
        }
    }
}

fn row(framing: &HypothesisGroup, readings: u64) -> Markup {
    let name = match framing.kind {
        HypothesisKind::AsGiven => "As given",
        HypothesisKind::Crop => "Parts, or without borders",
        HypothesisKind::QuarterTurn => "Quarter turns",
        HypothesisKind::Mirrored => "Mirrored",
        HypothesisKind::Scaling => "Other scales",
        HypothesisKind::Tone => "Changed tones undone",
        HypothesisKind::Estimated => "Tones and part estimated",
        HypothesisKind::Led => "One picture leads",
        HypothesisKind::Registered => "Compared with the original",
    };
    html! {
        tr {
            th scope="row" { (name) }
            td.number { (grouped(framing.variants.into())) }
            td.number { @if framing.pooled { "pooled" } @else { (grouped(framing.tries.unwrap_or(readings))) } }
        }
    }
}
