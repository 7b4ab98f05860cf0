//! Documents are read back, and every change of one is noticed.
use serde_json::{Value, json};

use super::*;
use crate::{Document, Error, MAX_DOCUMENT_BYTES, OpenedDocument};

fn document() -> Document {
    Document {
        signed: first(),
        public_key: signing_key().public_key(),
    }
}

fn with(field: &str, value: Value) -> String {
    let mut json: Value = serde_json::from_str(&document().to_json().unwrap()).unwrap();
    json[field] = value;
    json.to_string()
}

#[test]
fn a_document_is_read_back_and_holds() {
    let text = document().to_json().unwrap();
    let read = Document::from_json(&text).unwrap();
    assert_eq!(read, document());
    assert_eq!(read.to_json().unwrap(), text);
    read.verify(&signing_key().public_key()).unwrap();
    let json: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(json["asset"], "assets/02020202-0202-0202-0202-020202020202");
    assert_eq!(
        (&json["payload"], &json["time_micros"]),
        (&json!(7), &json!(1_700_000_000_000_000_i64))
    );
}

/// Nothing in it can be another way: not read at all, or not under the signature.
#[test]
fn every_field_counts() {
    let text = document().to_json().unwrap();
    let json: serde_json::Map<String, Value> = serde_json::from_str(&text).unwrap();
    assert_eq!(json.len(), 16);
    for (field, value) in &json {
        let changed = match value {
            Value::Number(number) => json!(number.as_i64().unwrap() + 1),
            Value::String(text) => {
                let (rest, last) = text.split_at(text.len() - 1);
                json!(format!("{rest}{}", if last == "1" { "2" } else { "1" }))
            }
            other => panic!("{other}"),
        };
        let read = Document::from_json(&with(field, changed));
        let held = read.and_then(|read| read.verify(&signing_key().public_key()));
        assert!(held.is_err(), "{field}");
        let mut without = json.clone();
        without.remove(field);
        assert!(
            Document::from_json(&Value::Object(without).to_string()).is_err(),
            "{field}"
        );
    }
    // Even where hash and canonical bytes were made to fit.
    let mut forged = document();
    forged.signed.commitment.owner = Uuid::from_bytes([6; 16]);
    let forged = Document::from_json(&forged.to_json().unwrap()).unwrap();
    assert_eq!(
        forged.verify(&signing_key().public_key()),
        Err(Error::BadSignature { sequence: 1 })
    );
}

#[test]
fn a_document_does_not_vouch_for_itself() {
    let forger = another_key();
    let forged = Document {
        signed: forger.sign(first().commitment),
        public_key: forger.public_key(),
    };
    forged.verify(&forger.public_key()).unwrap();
    assert_eq!(
        forged.verify(&signing_key().public_key()),
        Err(Error::OtherKey {
            found: forger.public_key().to_hex(),
            trusted: signing_key().public_key().to_hex(),
        })
    );
}

#[test]
fn what_is_wrong_is_told() {
    let field = |field: &str, value: Value| match Document::from_json(&with(field, value)) {
        Err(Error::Field { field, .. }) => field,
        other => panic!("{other:?}"),
    };
    assert_eq!(field("format", json!("another")), "format");
    assert_eq!(field("sha256", json!("04".repeat(31))), "sha256");
    assert_eq!(field("previous", json!("00".repeat(33))), "previous");
    assert_eq!(
        field(
            "signature",
            json!(first().signature.map(|b| format!("{b:02X}")).concat())
        ),
        "signature"
    );
    assert_eq!(
        field("owner", json!("assets/03030303-0303-0303-0303-030303030303")),
        "owner"
    );
    assert_eq!(
        field("owner", json!("owners/03030303030303030303030303030303")),
        "owner"
    );
    assert_eq!(field("hash", json!("é".repeat(32))), "hash");
    assert_eq!(field("payload", json!(8)), "canonical");
    assert_eq!(
        Document::from_json(&with("version", json!(2))),
        Err(Error::UnknownVersion { found: 2, known: 1 })
    );
    for text in [
        "",
        "{}",
        "[]",
        "null",
        "7",
        "\u{0}",
        &with("more", json!(1)),
        &with("payload", json!(-1)),
    ] {
        assert!(
            matches!(Document::from_json(text), Err(Error::NotADocument(_))),
            "{text}"
        );
    }
    let long = format!("{}{}", document().to_json().unwrap(), " ".repeat(MAX_DOCUMENT_BYTES));
    assert!(matches!(Document::from_json(&long), Err(Error::NotADocument(_))));
}

fn opened() -> OpenedDocument {
    OpenedDocument {
        document: document(),
        opening: opening(),
    }
}

#[test]
fn an_opened_commitment_is_read_back_and_opens() {
    let text = opened().to_json().unwrap();
    assert!(OpenedDocument::is_one(&text) && !OpenedDocument::is_one(&document().to_json().unwrap()));
    let read = OpenedDocument::from_json(&text).unwrap();
    assert_eq!((&read.document, read.opening.bytes()), (&document(), opening().bytes()));
    assert_eq!(read.to_json().unwrap(), text);
    read.verify(&signing_key().public_key()).unwrap();
    assert!(matches!(
        read.verify(&another_key().public_key()),
        Err(Error::OtherKey { .. })
    ));
    // Nothing of it is told by accident.
    let digits = hex::encode(opening().nonce());
    assert!(text.contains(&digits) && !format!("{read:?}").contains(&digits));
}

#[test]
fn every_field_of_an_opened_commitment_counts() {
    let json: serde_json::Map<String, Value> = serde_json::from_str(&opened().to_json().unwrap()).unwrap();
    assert_eq!(json.len(), 5);
    let held = |json: &serde_json::Map<String, Value>| {
        let read = OpenedDocument::from_json(&Value::Object(json.clone()).to_string());
        read.and_then(|read| read.verify(&signing_key().public_key()))
    };
    held(&json).unwrap();
    for field in json.keys() {
        let mut changed = json.clone();
        changed.remove(field);
        assert!(held(&changed).is_err(), "without {field}");
    }
    let mut newer = json.clone();
    newer["version"] = json!(2);
    assert_eq!(held(&newer), Err(Error::UnknownVersion { found: 2, known: 1 }));
    for field in ["nonce", "blinding"] {
        let digits = json[field].as_str().unwrap().to_owned();
        let mut changed = json.clone();
        changed[field] = json!(format!("{}{}", &digits[1..], "a"));
        assert_eq!(held(&changed), Err(Error::WrongOpening), "{field}");
        for odd in [digits.to_uppercase(), digits[2..].to_owned(), format!("{digits}00")] {
            changed[field] = json!(odd);
            assert!(matches!(held(&changed), Err(Error::Field { .. })), "{field}");
        }
    }
}
