//! Checking: whether a document is the report that a key signed, and whether its numbers follow from each other.
use crate::error::Error;
use crate::evidence::Evidence;
use crate::html::embedded;
use crate::json::{self, Document, SignedFile};
use crate::limits::HTML_BYTES;
use crate::recompute::Finding;
use crate::sign::is_signed_page;
use ed25519_dalek::VerifyingKey;

/// What a check found.
#[derive(Debug)]
pub struct Checked {
    /// Whether the document is what was signed.
    pub answer: Answer,
    /// What it says; to be believed only where the answer is [`Answer::Genuine`].
    pub evidence: Option<Evidence>,
    /// What was computed again. A genuine report with a finding that does not agree was signed by a faulty engine.
    pub findings: Vec<Finding>,
}

impl Checked {
    /// Whether it is genuine and everything that was computed again agrees.
    pub fn holds(&self) -> bool {
        matches!(self.answer, Answer::Genuine) && self.findings.iter().all(|f| f.agrees)
    }
}

/// Whether a document is what was signed.
#[derive(Debug)]
pub enum Answer {
    /// Signed by this key, and as it was then.
    Genuine,
    /// Not as it was signed.
    Altered(Altered),
    /// As it was signed, by somebody else.
    WrongKey {
        /// Whose signature it is.
        signer: VerifyingKey,
    },
    /// A report that nobody signed, or one that lost its signature.
    Unsigned,
    /// No report, or one that this program can't read: see the reason.
    NotAReport(Error),
}

/// Which part of a report is not as it was signed.
#[derive(Debug)]
pub enum Altered {
    /// The evidence itself, or its signature.
    Evidence,
    /// The page around it; the evidence inside is as it was.
    Page,
    /// It has values that no report has.
    Impossible(Error),
}

/// Checks a report, its JSON or its page, against the public key of the service that should have signed it.
///
/// At most 4 MiB of JSON and 64 MiB of HTML are looked at. What is computed again: the number of hypotheses, both
/// p-values, the matches needed, the verdict, the matches of the strip, and of a page the hashes, sizes and differences
/// of its pictures.
pub fn check(document: &[u8], key: &VerifyingKey) -> Checked {
    if document.trim_ascii_start().starts_with(b"{") {
        return match json::read(document) {
            Ok(Document::Signed(file)) => {
                let answer = signed(&file, None, key);
                checked(answer, file.evidence)
            }
            Ok(Document::Bare(evidence)) => checked(Answer::Unsigned, evidence),
            Err(error) => unread(error),
        };
    }
    if document.len() > HTML_BYTES {
        return unread(Error::TooLarge {
            what: "the page of a report".into(),
            bytes: document.len() as u64,
            limit: HTML_BYTES as u64,
        });
    }
    let Ok(page) = std::str::from_utf8(document) else {
        return unread(Error::NotAReport("it is neither JSON nor HTML in UTF-8".into()));
    };
    let Some(inner) = embedded::json(page) else {
        return unread(Error::NotAReport("the page has no evidence inside".into()));
    };
    let (answer, mut evidence) = match json::read(inner.as_bytes()) {
        Ok(Document::Signed(file)) => (signed(&file, Some(page), key), file.evidence),
        Ok(Document::Bare(evidence)) => (Answer::Unsigned, evidence),
        Err(error) => return unread(error),
    };
    let strangers = embedded::fill(page, &mut evidence);
    let mut checked = checked(answer, evidence);
    checked
        .findings
        .push(Finding::pictures(checked.evidence.as_ref(), strangers));
    checked
}

/// Whether the evidence, and the page where there is one, are as they were signed, and by whom.
fn signed(file: &SignedFile, page: Option<&str>, key: &VerifyingKey) -> Answer {
    let json = match file.evidence.to_json() {
        Ok(json) => json,
        Err(error) => return Answer::Altered(Altered::Impossible(error)),
    };
    let signer = file.signature.signer();
    let Some(signer) = signer.filter(|signer| file.signature.is_of_json(&json, signer)) else {
        return Answer::Altered(Altered::Evidence);
    };
    if page.is_some_and(|page| !is_signed_page(page, &signer)) {
        return Answer::Altered(Altered::Page);
    }
    if signer != *key {
        return Answer::WrongKey { signer };
    }
    Answer::Genuine
}

fn checked(answer: Answer, evidence: Evidence) -> Checked {
    Checked {
        answer,
        findings: evidence.recompute(),
        evidence: Some(evidence),
    }
}

fn unread(error: Error) -> Checked {
    let answer = match error {
        // Nobody signs such a report: signing refuses it.
        Error::Malformed(_) | Error::BadField { .. } => Answer::Altered(Altered::Impossible(error)),
        _ => Answer::NotAReport(error),
    };
    Checked {
        answer,
        evidence: None,
        findings: Vec::new(),
    }
}
