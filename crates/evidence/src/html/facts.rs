//! What the report rests on: files, model, key, times, and the signature.
use super::text::{hash, sent};
use crate::evidence::{Evidence, Input, Role};
use crate::signature::Signature;
use crate::words::size;
use maud::{Markup, html};

/// The files, by name, size and hash.
pub(super) fn files(inputs: &[Input]) -> Markup {
    if inputs.is_empty() {
        return html! {};
    }
    html! {
        section {
            h2 { "Files" }
            table.files {
                caption { "Files of the job, told by their hashes" }
                thead { tr { th scope="col" { "File" } th scope="col" { "SHA-256" } } }
                tbody {
                    @for input in inputs {
                        tr {
                            th scope="row" {
                                @match &input.name { Some(name) => (sent(name)), None => { em { "name withheld" } } }
                                br;
                                span.soft { (role(input.role)) ", " (size(input.bytes)) }
                            }
                            td { (hash(&input.sha256)) }
                        }
                    }
                }
            }
        }
    }
}

fn role(role: Role) -> &'static str {
    match role {
        Role::Suspect => "suspect",
        Role::Original => "original",
        Role::Marked => "marked scene",
        Role::Cameras => "cameras",
    }
}

/// Who did it, when and with what.
pub(super) fn making(evidence: &Evidence) -> Markup {
    html! {
        section {
            h2 { "How it was made" }
            table.facts {
                caption { "The job" }
                tbody {
                    tr { th scope="row" { "Job" } td { (sent(&evidence.job)) } }
                    tr { th scope="row" { "Key" } td { (sent(&evidence.key.id)) } }
                    tr { th scope="row" { "Begun (UTC)" } td { time datetime=(evidence.started) { (evidence.started) } } }
                    tr { th scope="row" { "Done (UTC)" } td { time datetime=(evidence.finished) { (evidence.finished) } } }
                    @if let Some(worker) = &evidence.worker {
                        tr { th scope="row" { "Worker" } td { (sent(&worker.name)) ", attempt " (worker.attempt) } }
                    }
                    tr { th scope="row" { "Engine" } td { (sent(&evidence.engine)) } }
                    tr { th scope="row" { "Computed on" } td { (sent(&evidence.device)) } }
                    tr { th scope="row" { "CLIP" } td { (sent(&evidence.model.name)) } }
                    tr { th scope="row" { "SHA-256 of its weights" } td { (hash(&evidence.model.sha256)) } }
                }
            }
        }
    }
}

/// Who signed, and how to check that.
pub(super) fn signature(signature: Option<&Signature>) -> Markup {
    html! {
        section {
            h2 { "Signature" }
            @match signature {
                None => { p { "Nobody signed this report: anybody could have written it." } }
                Some(signature) => {
                    p { "This page holds the evidence as JSON for programs, and is signed as a whole. Whoever checks it needs the
                        public key of the service from the service itself, not from this page." }
                    table.facts {
                        caption { "Ed25519 signature of the evidence" }
                        tbody {
                            tr { th scope="row" { "Public key" } td { code { (signature.public_key) } } }
                            tr { th scope="row" { "Signature" } td { code { (signature.value) } } }
                        }
                    }
                }
            }
        }
    }
}
