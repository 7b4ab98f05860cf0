//! The page: one file for people, which needs nothing else and runs nothing.
mod caveats;
mod decision;
pub(crate) mod embedded;
mod facts;
mod history;
mod pictures;
mod quality;
mod strip;
mod text;
mod tried;
mod verdict;

use crate::evidence::Evidence;
use crate::signature::Signature;
use base64::{Engine, engine::general_purpose::STANDARD};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use sha2::Digest;

/// Colours are light, dark or those of paper; wide enough for a phone of 360 pixels.
const STYLE: &str = include_str!("style.css");

/// The page of a report. `json` is what is put inside for programs, with the signature where there is one.
pub(crate) fn page(evidence: &Evidence, json: &str, signature: Option<&Signature>) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta http-equiv="Content-Security-Policy" content=(policy());
                meta name="referrer" content="no-referrer";
                meta name="color-scheme" content="light dark";
                title { (verdict::title(evidence)) " \u{b7} GuardSplat evidence" }
                style { (PreEscaped(STYLE)) }
            }
            body { (body(evidence, signature)) (embedded::block(json)) }
        }
    };
    page.into_string() + "\n"
}

/// Nothing from anywhere, whatever a file may be called: this style and pictures inside the page, no scripts at all.
fn policy() -> String {
    let hash = STANDARD.encode(sha2::Sha256::digest(STYLE));
    format!("default-src 'none'; img-src data:; style-src 'sha256-{hash}'; base-uri 'none'; form-action 'none'")
}

/// The verdict first, then how sure it is, then what it rests on.
fn body(evidence: &Evidence, signature: Option<&Signature>) -> Markup {
    let verification = evidence.verification.as_ref();
    html! {
        main {
            (verdict::section(evidence))
            @if let Some(verification) = verification {
                @if let Some(decision) = &verification.decision {
                    (decision::section(decision, verification))
                    (tried::section(decision, verification))
                }
                @if let Some(history) = &verification.history { (history::section(history)) }
                (strip::section(verification))
            }
            @if let Some(embedding) = &evidence.embedding { (quality::section(embedding)) }
            (pictures::section(&evidence.views))
            (facts::files(&evidence.inputs))
            (facts::making(evidence))
            (caveats::section(evidence))
            (facts::signature(signature))
        }
    }
}
