//! How sure the verdict is: the p-value for a lawyer, for a statistician, and its numbers.
use super::text::number;
use crate::verification::{Decision, Test, Verification};
use crate::words::{chance, counted, grouped};
use guardsplat_codeword::{Verdict, signed_rank};
use maud::{Markup, html};

/// What the number means and where it comes from.
pub(super) fn section(decision: &Decision, verification: &Verification) -> Markup {
    html! {
        section {
            h2 { "How sure this is" }
            dl.figures {
                div { dt { "Bits that agree" } dd { (decision.matched) " of " (decision.bits) } }
                @if let Test::SignedRank(sum) = decision.test() {
                    div { dt { "Weighed by clearness" } dd { (share(decision, sum)) } }
                }
                div { dt { "Needed for a match" } dd { (needed(decision)) } }
                div { dt { "p-value" } dd { (number(decision.p_value)) } }
                div { dt { "Threshold" } dd { (number(decision.threshold)) } }
            }
            div.reading { strong { "In plain words" } p { (plain(decision, verification)) } }
            div.reading { strong { "For statisticians" } (statistics(decision)) }
            (table(decision))
        }
    }
}

fn needed(decision: &Decision) -> Markup {
    match (decision.needed, decision.test()) {
        (Some(needed), Test::SignedRank(_)) => html! { "at least " (share(decision, needed)) },
        (Some(needed), Test::Counted) => html! { "at least " (needed) },
        (None, _) => html! { "not possible" },
    }
}

/// A rank sum as a share of that of all bits.
fn share(decision: &Decision, rank_sum: u32) -> String {
    let all = signed_rank::largest(decision.bits).max(1);
    format!("{:.1}\u{a0}%", 100.0 * f64::from(rank_sum) / f64::from(all))
}

/// One sentence that a lawyer understands.
fn plain(decision: &Decision, verification: &Verification) -> Markup {
    let attempts = match decision.hypotheses {
        1 => "the one attempt".into(),
        many => format!("all {} attempts", grouped(many)),
    };
    let chance = chance(decision.p_value);
    let end = match verification.verdict {
        Verdict::Match => ": rare enough to count as a match by the rule fixed beforehand",
        Verdict::NoMatch => ": too often to count as a match by the rule fixed beforehand",
        Verdict::Inconclusive | Verdict::UnknownKey => "; nothing is concluded from it, for the reason given above",
    };
    html! {
        "If what was read had nothing to do with this mark, pure chance would make it agree at least this well in "
        strong { (chance) } " cases, with " (attempts) " of this search counted" (end) "."
        @if let Test::SignedRank(_) = decision.test() {
            " A bit that was read clearly counts for more than one that was hardly read; which is which was known before
            anything was compared with the mark."
        }
    }
}

/// One sentence that a statistician understands, with the null hypothesis named.
fn statistics(decision: &Decision) -> Markup {
    let (n, k, m) = (decision.bits, decision.matched, decision.hypotheses);
    if let Test::SignedRank(sum) = decision.test() {
        return html! {
            p { "Wilcoxon\u{2019}s signed-rank test, exact and one-sided, of H" sub { "0" } ": what was read is independent of
                the whitening pad of the message; the pad is secret and uniform, so that, given the logits, each of the "
                (n) " bits matches with probability \u{bd}, independently, whatever the decoder\u{2019}s bias and the
                dependence between bits. Ranked by the size of their logits, the bits that match have the rank sum T = "
                (grouped(sum.into())) " of " (grouped(signed_rank::largest(n).into())) "; P(T \u{2265} "
                (grouped(sum.into())) ") = " (number(decision.p_single)) ", and by the union bound over "
                (counted(m, "hypothesis", "hypotheses")) " p = " (number(decision.p_value)) "." }
        };
    }
    html! {
        p { "Exact one-sided test of H" sub { "0" } ": what was read is independent of the whitening pad of the message; the
            pad is secret and uniform, so the matches of an independent scene are X ~ Binomial(" (n) ", \u{bd}), whatever the
            decoder\u{2019}s bias and the dependence between bits; P(X \u{2265} " (k) ") = " (number(decision.p_single))
            ", and by the union bound over " (counted(m, "hypothesis", "hypotheses")) " p = " (number(decision.p_value)) "." }
    }
}

fn table(decision: &Decision) -> Markup {
    html! {
        table.facts {
            caption { "The numbers of the decision" }
            tbody {
                tr { th scope="row" { "Bits compared" } td { (decision.bits) } }
                tr { th scope="row" { "Bits that agree" } td { (decision.matched) } }
                @if let Test::SignedRank(sum) = decision.test() {
                    tr { th scope="row" { "Sum of their ranks" } td {
                        (grouped(sum.into())) " of " (grouped(signed_rank::largest(decision.bits).into())) " (the least clear bit has rank 1)"
                    } }
                }
                @if let Some(corrected) = decision.corrected {
                    tr { th scope="row" { "Bits set right by the code" } td { (corrected) " (read after the decision, no part of it)" } }
                }
                tr { th scope="row" { "p-value before correction" } td { (number(decision.p_single)) " (" (chance(decision.p_single)) ")" } }
                tr { th scope="row" { "Hypotheses tried" } td { (grouped(decision.hypotheses)) } }
                tr { th scope="row" { "p-value after correction" } td { (number(decision.p_value)) " (" (chance(decision.p_value)) ")" } }
                tr { th scope="row" { "Threshold as a rate" } td { (number(decision.threshold)) " (" (chance(decision.threshold)) ")" } }
                tr {
                    th scope="row" { @match decision.test() {
                        Test::SignedRank(_) => "Threshold as a rank sum",
                        Test::Counted => "Threshold in bits",
                    } }
                    td { @match (decision.needed, decision.test()) {
                        (Some(needed), Test::SignedRank(_)) => { (grouped(needed.into())) " after this many hypotheses" }
                        (Some(needed), Test::Counted) => { (needed) " of " (decision.bits) " after this many hypotheses" }
                        (None, _) => { "none: even all " (decision.bits) " bits would not do" }
                    } }
                }
            }
        }
    }
}
