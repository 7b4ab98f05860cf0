//! `commitment reveal` and `commitment check`: a commitment that is opened in a dispute, and every part of it that is changed.
use guardsplat_codeword::{MARK_CODE, Payload, Whitening, mark};
use guardsplat_commitment::{Commitment, Document, FIRST, OPENING_BYTES, OpenedDocument, Opening, SigningKey};
use guardsplat_evidence::{
    Audience, Bit, Decision, Evidence, EvidenceKind, Found, History, Key, Model, Multiplicity, Registration, SCHEMA,
    Sha256, Timestamp, Tried, VERSION, Verdict, Verification, sign,
};
use uuid::Uuid;

use super::run::TestEnvironment;

const SEED: [u8; 32] = [7; 32];

fn opened() -> OpenedDocument {
    let opening = Opening::new(&std::array::from_fn::<u8, OPENING_BYTES, _>(|i| 100 + i as u8)).unwrap();
    let id = |byte| Uuid::from_bytes([byte; 16]);
    let signer = SigningKey::from_seed(&SEED).unwrap();
    let signed = signer.sign(Commitment {
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
    });
    OpenedDocument {
        opening,
        document: Document {
            signed,
            public_key: signer.public_key(),
        },
    }
}

/// The word that follows, computed as docs/registry.md has it.
fn word(opened: &OpenedDocument) -> guardsplat_codeword::Message {
    let commitment = &opened.document.signed.commitment;
    let secret = opened.opening.whitening_secret();
    let whitening = Whitening {
        secret: &secret,
        asset: commitment.asset.as_bytes(),
        nonce: opened.opening.nonce(),
    };
    let payload = Payload::of_key(MARK_CODE, commitment.key.as_bytes(), 7);
    mark(MARK_CODE, payload, &whitening).unwrap().word
}

/// The report of a claim that matched, in which so many bits of the word are another's.
fn report(opened: &OpenedDocument, wrong: usize) -> String {
    let now = Timestamp::from_second(1_800_000_000).unwrap();
    let commitment = &opened.document.signed.commitment;
    let bit = |(i, bit): (usize, bool)| Bit {
        wanted: Some(bit != (i < wrong)),
        read: bit != (i < wrong),
        confidence: None,
        logit: None,
    };
    let evidence = Evidence {
        schema: SCHEMA.into(),
        version: VERSION,
        audience: Audience::Owner,
        kind: EvidenceKind::Verify,
        job: "jobs/1".into(),
        started: now,
        finished: now,
        engine: "a test".into(),
        device: "cpu".into(),
        worker: None,
        model: Model {
            name: "guardsplat".into(),
            sha256: Sha256([1; 32]),
        },
        key: Key {
            id: format!("keys/{}", commitment.key),
        },
        inputs: Vec::new(),
        verification: Some(Verification {
            verdict: Verdict::Match,
            reason: None,
            note: None,
            tried: Tried {
                paid: Some(Multiplicity { assets: 1, readings: 1 }),
                ..Tried::once()
            },
            views: 1,
            decision: Some(Decision::new(64, (64, 2080), 1, 1e-6)),
            history: Some(History {
                first_seen: now,
                readings_of_key: 1,
                assets_of_owner: Some(1),
                asset: Some(Registration {
                    asset: format!("assets/{}", commitment.asset),
                    commitment: format!("commitments/{}", commitment.id),
                    sequence: commitment.sequence,
                    hash: Sha256(opened.document.signed.hash()),
                    time: Timestamp::from_microsecond(commitment.time).unwrap(),
                    revealed: None,
                }),
            }),
            found: Some(Found {
                owner: "studio".into(),
                asset: "robot".into(),
                payload: None,
            }),
            strip: word(opened).bits().enumerate().map(bit).collect(),
        }),
        embedding: None,
        views: Vec::new(),
    };
    sign(&evidence, &guardsplat_evidence::SigningKey::from_bytes(&SEED))
        .unwrap()
        .json
}

#[test]
fn an_opened_commitment_is_checked_against_its_signature_and_against_a_report() {
    let environment = TestEnvironment::new();
    let opened = opened();
    let text = opened.to_json().unwrap();
    environment.fake.state().opened = Some(text.clone());
    let name = format!("commitments/{}", opened.document.signed.commitment.id);
    let ran = environment.run(&format!("commitment reveal {name} -o opened.json --json"));
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert_eq!(
        (&ran.json()["commitment"], &ran.json()["file"]),
        (&name.into(), &"opened.json".into())
    );
    assert_eq!(ran.json()["reveal_time"], "2027-01-15T08:00:00Z");
    assert_eq!(std::fs::read_to_string(environment.path("opened.json")).unwrap(), text);

    environment.file("key.hex", opened.document.public_key.to_hex().as_bytes());
    environment.file("report.json", report(&opened, 0).as_bytes());
    environment.file("other.json", report(&opened, 3).as_bytes());
    // Nothing is asked of a server.
    let check = |line: &str| {
        let line = format!("--server http://127.0.0.1:1 commitment check {line} --public-key key.hex");
        environment.run(&line)
    };
    let ran = check("opened.json --report report.json");
    assert_eq!(ran.code, 0, "{} {}", ran.out, ran.err);
    assert!(ran.out.contains("all 64 bits that the report shows"), "{}", ran.out);
    assert!(
        ran.out
            .ends_with(&format!("the asset is marked with {}\n", word(&opened))),
        "{}",
        ran.out
    );
    let ran = check("opened.json --report other.json");
    assert_eq!(ran.code, 2, "{}", ran.out);
    assert!(
        ran.out.contains("DOES NOT HOLD: word of the report: 61 of 64"),
        "{}",
        ran.out
    );

    // A commitment that was not opened is checked as far as that goes.
    environment.file("exported.json", opened.document.to_json().unwrap().as_bytes());
    let ran = check("exported.json");
    assert_eq!((ran.code, ran.out.lines().count()), (0, 1), "{}", ran.out);
    // Another nonce or blinding does not open it, and no word follows.
    for field in ["nonce", "blinding"] {
        let mut changed: serde_json::Value = serde_json::from_str(&text).unwrap();
        let digits = changed[field].as_str().unwrap().to_owned();
        changed[field] = format!(
            "{}{}",
            &digits[..digits.len() - 1],
            if digits.ends_with('0') { '1' } else { '0' }
        )
        .into();
        environment.file("changed.json", changed.to_string().as_bytes());
        let ran = check("changed.json --report report.json");
        assert_eq!(ran.code, 2, "{}", ran.out);
        assert!(
            ran.out.contains("DOES NOT HOLD: opening") && !ran.out.contains("marked with"),
            "{}",
            ran.out
        );
    }
    // Another key, and what is no commitment at all.
    environment.file(
        "key.hex",
        SigningKey::from_seed(&[8; 32])
            .unwrap()
            .public_key()
            .to_hex()
            .as_bytes(),
    );
    let ran = check("opened.json");
    assert_eq!(ran.code, 2, "{}", ran.out);
    assert!(ran.out.contains("DOES NOT HOLD: signature"), "{}", ran.out);
    assert_eq!(check("key.hex").code, 1);
}
