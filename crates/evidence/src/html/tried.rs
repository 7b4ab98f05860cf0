//! What was tried, and how it is paid for.
use crate::tried::{HypothesisGroup, HypothesisKind, Tried};
use crate::verification::{Decision, Verification};
use crate::words::{counted, grouped};
use maud::{Markup, html};

/// Every framing and claim, and the number of hypotheses that they make.
pub(super) fn section(decision: &Decision, verification: &Verification) -> Markup {
    let tried = &verification.tried;
    html! {
        section {
            h2 { "What was tried, and how it is paid for" }
            p { "Who looks often enough finds something by accident. So every reading that was decided on is compared with every
                claim, each comparison is one hypothesis, and the p-value is multiplied by their number. What was pooled into a
                reading costs nothing: it was decided once." }
            table {
                caption { "Framings of the suspect" }
                thead { tr { th scope="col" { "Framing" } th.number scope="col" { "Variants" } th.number scope="col" { "Readings paid for" } } }
                tbody { @for framing in &tried.framings { (row(framing)) } }
                tfoot { tr { th scope="row" { "Readings" } td {} td.number { (grouped(tried.readings())) } } }
            }
            p { "Compared with the messages of " (counted(tried.assets, "asset", "assets")) " of "
                (counted(tried.owners, "owner", "owners")) ". " (paid(tried)) "That makes " (grouped(tried.readings()))
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

fn row(framing: &HypothesisGroup) -> Markup {
    let name = match framing.kind {
        HypothesisKind::AsGiven => "As given",
        HypothesisKind::Crop => "Parts, or without borders",
        HypothesisKind::QuarterTurn => "Quarter turns",
        HypothesisKind::Mirrored => "Mirrored",
        HypothesisKind::Scaling => "Other scales",
        HypothesisKind::Tone => "Changed tones undone",
    };
    html! {
        tr {
            th scope="row" { (name) }
            td.number { (grouped(framing.variants.into())) }
            td.number { @if framing.pooled { "pooled" } @else { (grouped(framing.variants.into())) } }
        }
    }
}
