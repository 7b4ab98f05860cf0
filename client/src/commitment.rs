//! Checking a commitment without a server: its signature, what opens it, the word that follows, and a report of a claim.
use guardsplat_codeword::{MARK_CODE, Message, Payload, Whitening, mark};
use guardsplat_commitment::{Commitment, Document, OpenedDocument, Opening, PublicKey};
use guardsplat_evidence::{Evidence, VerifyingKey};
use serde::Serialize;

/// One thing that was looked at.
#[derive(Debug, Serialize)]
pub struct Finding {
    /// What it is.
    pub what: &'static str,
    /// Whether it holds.
    pub holds: bool,
    /// What was found.
    pub detail: String,
}

/// What a check found.
#[derive(Debug)]
pub struct Checked {
    /// All that was looked at.
    pub findings: Vec<Finding>,
    /// The word that the asset is marked with, where the commitment was opened and opens.
    pub word: Option<Message>,
}

/// Checks a document, exported or opened, with a key that is trusted; and a report of a claim on its asset, if one is given.
///
/// # Errors
/// Those of [`Document::from_json`] for what is no such document.
pub fn check(document: &[u8], report: Option<&[u8]>, key: &PublicKey) -> guardsplat_commitment::Result<Checked> {
    let text = String::from_utf8_lossy(document);
    let (document, opening) = match OpenedDocument::is_one(&text) {
        true => {
            let opened = OpenedDocument::from_json(&text)?;
            (opened.document, Some(opened.opening))
        }
        false => (Document::from_json(&text)?, None),
    };
    let commitment = &document.signed.commitment;
    let mut findings = vec![finding(
        "signature",
        document
            .verify(key)
            .map(|()| said(commitment))
            .map_err(|error| error.to_string()),
    )];
    let mut word = None;
    if let Some(opening) = &opening {
        let opens = commitment.opens_with(opening).map_err(|error| error.to_string());
        if opens.is_ok() {
            word = word_of(commitment, opening);
        }
        let opened = opens.map(|()| "nonce and blinding are those that were committed to".to_owned());
        findings.push(finding("opening", opened));
    }
    if let Some(report) = report {
        let checked = VerifyingKey::from_bytes(&key.to_bytes()).map(|key| guardsplat_evidence::check(report, &key));
        match checked {
            Ok(checked) => {
                let genuine = match checked.holds() {
                    true => Ok("as it was signed, and its numbers follow".to_owned()),
                    false => {
                        Err("not as it was signed, or its numbers do not follow: report check says more".to_owned())
                    }
                };
                findings.push(finding("report", genuine));
                if let Some(evidence) = &checked.evidence {
                    compare(&document, word, evidence, &mut findings);
                }
            }
            Err(error) => findings.push(finding("report", Err(error.to_string()))),
        }
    }
    Ok(Checked { findings, word })
}

fn finding(what: &'static str, found: Result<String, String>) -> Finding {
    let holds = found.is_ok();
    let (Ok(detail) | Err(detail)) = found;
    Finding { what, holds, detail }
}

/// What a commitment says, for people.
fn said(commitment: &Commitment) -> String {
    let time = u64::try_from(commitment.time).unwrap_or_default();
    let time = std::time::UNIX_EPOCH + std::time::Duration::from_micros(time);
    format!(
        "number {} of the chain, {}: assets/{} of owners/{} under keys/{}, original {}",
        commitment.sequence,
        humantime::format_rfc3339_micros(time),
        commitment.asset,
        commitment.owner,
        commitment.key,
        hex::encode(commitment.sha256)
    )
}

/// The word that an asset is marked with, from what its commitment hid; none for numbers that no mark has room for.
fn word_of(commitment: &Commitment, opening: &Opening) -> Option<Message> {
    let number = u32::try_from(commitment.payload).ok()?;
    let secret = opening.whitening_secret();
    let whitening = Whitening {
        secret: &secret,
        asset: commitment.asset.as_bytes(),
        nonce: opening.nonce(),
    };
    let payload = Payload::of_key(MARK_CODE, commitment.key.as_bytes(), number);
    Some(mark(MARK_CODE, payload, &whitening).ok()?.word)
}

/// Whether a report is of this asset, and has its word.
fn compare(document: &Document, word: Option<Message>, evidence: &Evidence, findings: &mut Vec<Finding>) {
    let commitment = &document.signed.commitment;
    let key = format!("keys/{}", commitment.key);
    let same = |what: &str, told: String, wanted: String| match told == wanted {
        true => Ok(format!("{what} {wanted}")),
        false => Err(format!("the report has {what} {told}, the commitment {wanted}")),
    };
    findings.push(finding(
        "key of the report",
        same("the key", evidence.key.id.clone(), key),
    ));
    let Some(read) = &evidence.verification else {
        findings.push(finding("word of the report", Err("the report has no reading".into())));
        return;
    };
    if let Some(asset) = read.history.as_ref().and_then(|history| history.asset.as_ref()) {
        let hash = hex::encode(document.signed.hash());
        findings.push(finding(
            "commitment of the report",
            same("the hash", asset.hash.to_string(), hash),
        ));
    }
    let Some(word) = word else { return };
    let shown: Vec<(bool, bool)> = read
        .strip
        .iter()
        .zip(word.bits())
        .filter_map(|(bit, ours)| Some((bit.wanted?, ours)))
        .collect();
    let equal = shown.iter().filter(|(told, ours)| told == ours).count();
    let found = match shown.len() {
        0 => Err("the report shows no asset's word".to_owned()),
        all if all == equal => Ok(format!(
            "all {all} bits that the report shows are those of the opened commitment"
        )),
        all => Err(format!(
            "{equal} of {all} bits that the report shows are those of the opened commitment"
        )),
    };
    findings.push(finding("word of the report", found));
}
