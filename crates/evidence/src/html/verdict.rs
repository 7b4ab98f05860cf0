//! The verdict: what everybody reads, and some read only.
use super::text::{sent, visible};
use crate::evidence::{Audience, Evidence, EvidenceKind};
use crate::verification::{Reason, Verification};
use crate::words::{chance, counted};
use guardsplat_codeword::Verdict;
use maud::{Markup, html};

/// The verdict in a few words, for the title of the window.
pub(super) fn title(evidence: &Evidence) -> String {
    format!("{}: {}", headline(evidence).0, visible(&evidence.job))
}

/// The verdict in a word, what that means, and the class of its colours and sign.
fn headline(evidence: &Evidence) -> (&'static str, &'static str, &'static str) {
    let verdict = evidence.verification.as_ref().map(|v| v.verdict);
    if evidence.kind == EvidenceKind::Embed {
        let missed = evidence.embedding.as_ref().is_some_and(|e| !e.missed.is_empty());
        return match verdict {
            _ if missed => (
                "Marked, below target",
                "the scene has a mark that misses what was asked for",
                "inconclusive",
            ),
            None | Some(Verdict::Match) => ("Marked", "the scene carries its message", "match"),
            Some(_) => (
                "Marked, not read back",
                "the message was not found again with certainty",
                "inconclusive",
            ),
        };
    }
    match verdict {
        Some(Verdict::Match) => ("Match", "the message is there", "match"),
        Some(Verdict::NoMatch) => ("No match", "the message was not found", "no_match"),
        Some(Verdict::UnknownKey) => ("Unknown key", "nothing was read", "unknown_key"),
        Some(Verdict::Inconclusive) | None => ("Inconclusive", "nothing could be decided", "inconclusive"),
    }
}

/// The verdict, in one sentence each: what it is, whose, how likely by chance.
pub(super) fn section(evidence: &Evidence) -> Markup {
    let (word, meaning, class) = headline(evidence);
    let kind = match evidence.kind {
        EvidenceKind::Embed => "Evidence of a marking",
        EvidenceKind::Verify => "Evidence of a verification",
    };
    let audience = match evidence.audience {
        Audience::Owner => "the owner\u{2019}s report, not for others",
        Audience::Stranger => "report for anybody",
    };
    html! {
        p.kind { "GuardSplat \u{b7} " (kind) " \u{b7} " (audience) }
        div class={ "verdict " (class) } {
            (sign(class))
            div {
                h1 { (word) ": " (meaning) }
                @if let Some(verification) = &evidence.verification { (details(verification)) }
            }
        }
        @if let Some(verification) = &evidence.verification {
            @if let Some(reason) = verification.reason { (why(reason)) }
            @if verification.verdict == Verdict::UnknownKey {
                h2 { "Why, and what would help" }
                p { "The service has no key of this name, or none that whoever asked may use. Nothing was rendered, read or
                    compared, so this says nothing about the suspect. Ask for the name of the key, or have its owner verify." }
            }
            @if let Some(note) = &verification.note { p.soft { "Note of the engine: " (sent(note)) } }
        }
    }
}

fn details(verification: &Verification) -> Markup {
    html! {
        @if let Some(found) = &verification.found {
            p { "Owner " strong { (sent(&found.owner)) } ", asset " strong { (sent(&found.asset)) }
                @if let Some(payload) = &found.payload { ", payload " code { (payload) } } "." }
        }
        @if let Some(decision) = &verification.decision {
            p { (decision.matched) " of " (decision.bits) " bits agree, read from "
                (counted(verification.views.into(), "view", "views")) "."
                @if verification.verdict != Verdict::Inconclusive {
                    " Of unrelated scenes, " strong { (chance(decision.p_value)) } " would agree this well by chance."
                } }
        }
    }
}

/// Why nothing was decided, and what would help.
fn why(reason: Reason) -> Markup {
    let (why, help): (_, &[_]) = match reason {
        Reason::NothingToCompare => (
            "No message was named. Any scene, marked or not, reads as some message, so that reading alone proves nothing.",
            &["Name the message, or the owner and the asset, that the suspect should carry, and verify again."],
        ),
        Reason::TooFewBits => (
            "The message has so few bits that even if all of them agreed, chance would do the same too often.",
            &["Nothing helps for this scene. Mark with a key of more bits: from 20 on a match is possible at one in a million,
               and 64 leave room for errors and for searches."],
        ),
        Reason::TooManyHypotheses => (
            "Every attempt is paid for, and so many were made that even a perfect reading would not stand out.",
            &[
                "Name one owner and one asset instead of searching all of them.",
                "Send the pictures upright and uncropped, so that fewer framings have to be tried.",
                "Keys of more bits can pay for larger searches.",
            ],
        ),
        Reason::WeakReading => (
            "The views contradict each other, or say so little that the bits are hardly better than coins.",
            &[
                "Send the scene itself instead of pictures of it, or more pictures from other directions.",
                "Send pictures as they are, not photographs of a screen, and before they were made smaller or compressed again.",
            ],
        ),
        Reason::TooLittleToRead => (
            "There are too few pictures, or they are too small, for a reading.",
            &["Send more pictures, from several directions, at least 224 pixels a side, that show the whole scene."],
        ),
        Reason::RegisteredLater => (
            "So many bits agree that it would be a match, but the service had seen a file of the suspect before the asset was
             registered. Nobody could have marked that file with this asset: the asset was chosen to fit, or chance did it.",
            &["Claim on the asset that the file was marked with, which was registered before it was made."],
        ),
    };
    html! {
        h2 { "Why, and what would help" }
        p { (why) }
        ul { @for line in help { li { (line) } } }
    }
}

/// A tick, a cross, a question mark or a dash: the verdict without colour.
fn sign(class: &str) -> Markup {
    let path = match class {
        "match" => "M12 21 l6 6 l11 -13",
        "no_match" => "M13 13 L27 27 M27 13 L13 27",
        "inconclusive" => "M14 16 a6 6 0 1 1 8.5 5.5 q-2.5 1.2 -2.5 3.5 M20 30 v0.1",
        _ => "M12 20 H28",
    };
    html! {
        svg.sign viewBox="0 0 40 40" aria-hidden="true" { circle cx="20" cy="20" r="17" {} path d=(path) {} }
    }
}
