//! Reports of evidence, and commitments.
use super::{put, put_damaged};
use guardsplat_commitment::{Commitment, Document, FIRST, OPENING_BYTES, Opening, SigningKey};
use guardsplat_evidence::sign;
use uuid::Uuid;

#[path = "../../../../crates/evidence/examples/samples/mod.rs"]
mod samples;

pub fn put_all() {
    for (name, report) in samples::all() {
        // Pictures are in pages only; one page is enough of them.
        put("evidence", name, report.to_json().expect("samples are right"));
    }
    let signed = sign(&samples::matching(), &samples::key()).expect("samples are right");
    put_damaged("evidence", "signed", signed.json.as_bytes());
    put("evidence", "page", &signed.html);
    put("evidence", "page-empty", "<!DOCTYPE html><title>evidence</title>");

    let key = SigningKey::from_seed(&[7; 32]).expect("32 bytes are a seed");
    let opening = Opening::new(&[1; OPENING_BYTES]).expect("it has its length");
    let id = |byte| Uuid::from_bytes([byte; 16]);
    let document = Document {
        signed: key.sign(Commitment {
            sequence: 1,
            previous: FIRST,
            id: id(1),
            asset: id(2),
            owner: id(3),
            sha256: [4; 32],
            key: id(5),
            payload: 7,
            nonce_hash: opening.hash(),
            time: 1_700_000_000_000_000,
        }),
        public_key: key.public_key(),
    };
    let json = document.to_json().expect("it can be written");
    put_damaged("commitment", "right", json.as_bytes());
    put(
        "commitment",
        "later-version",
        json.replace("\"version\": 1", "\"version\": 2"),
    );
    put(
        "commitment",
        "another-payload",
        json.replace("\"payload\": 7", "\"payload\": 8"),
    );
}
