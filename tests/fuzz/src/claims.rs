//! What somebody shows to prove a claim: reports of evidence, and commitments.
use crate::memory::bounded;
use guardsplat_commitment::{Document, OpenedDocument};
use guardsplat_evidence::{Answer, Evidence, SigningKey, check};
use std::sync::LazyLock;

/// The service's key, which the seeds are signed with; of examples, so everybody's.
static KEY: LazyLock<SigningKey> = LazyLock::new(|| SigningKey::from_bytes(&[7; 32]));
/// The key of somebody who signed nothing.
static OTHER: LazyLock<SigningKey> = LazyLock::new(|| SigningKey::from_bytes(&[8; 32]));

/// Reports, as JSON or as a page: one that is read is written as the same report, and nobody signed it unasked.
pub fn evidence(data: &[u8]) {
    if let Ok(read) = bounded(data.len(), || Evidence::from_json(data)) {
        let json = read.to_json().expect("what was read is written");
        let again = Evidence::from_json(json.as_bytes()).expect("what was written is read");
        assert_eq!(again.to_json().expect("what was read is written"), json);
    }
    let checked = bounded(data.len(), || check(data, &KEY.verifying_key()));
    let others = bounded(data.len(), || check(data, &OTHER.verifying_key()));
    assert!(
        !matches!(others.answer, Answer::Genuine),
        "nothing was signed with that key"
    );
    if matches!(checked.answer, Answer::Genuine) {
        assert!(matches!(others.answer, Answer::WrongKey { .. }), "it has one signer");
    }
}

/// Commitments as documents: one that is read is written as the same, and holds under one key at most.
pub fn commitment(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else { return };
    if let Ok(opened) = bounded(data.len(), || OpenedDocument::from_json(text)) {
        let json = opened.to_json().expect("what was read is written");
        let again = OpenedDocument::from_json(&json).expect("what was written is read");
        assert_eq!(again.document, opened.document);
        assert_eq!(again.opening.bytes(), opened.opening.bytes());
    }
    let Ok(read) = bounded(data.len(), || Document::from_json(text)) else {
        return;
    };
    let json = read.to_json().expect("what was read is written");
    assert_eq!(Document::from_json(&json).expect("what was written is read"), read);
    let own = read.public_key;
    let other = guardsplat_commitment::PublicKey::from_bytes(OTHER.verifying_key().as_bytes()).expect("it is a key");
    let _ = bounded(data.len(), || read.verify(&own));
    assert!(read.verify(&other).is_err(), "nothing was signed with that key");
}
