//! The canonical bytes, their hash and the signature are those that other programs compute.
use proptest::prelude::*;
use uuid::Uuid;

use super::*;
use crate::{CANONICAL_BYTES, Error, PublicKey};

// Made with Python's hashlib and struct, and with OpenSSL 3 (`openssl pkeyutl -sign -rawin`).
const NONCE_HASH: &str = "24f8e3e6ff476b23c2c09b535bef746e9555349f4356aeb8cdd041709092ba4d";
const HASH: &str = "3092562ee49b5fc3ed572354b22f93875ed4fb8a409a38e4f014e7f2180b2454";
const SIGNATURE: &str = "77ae6af0c1467d008c6e9d165017306acc98e718cbc3b2643774a21fc9e70b9e\
                         0c4afe998280c9429f9d91333288b0a1ebbdb6d57c307da14f48c94205f4fa0e";
const PUBLIC_KEY: &str = "03a107bff3ce10be1d70dd18e74bc09967e4d6309ba50d5f1ddc8664125531b8";
const PEM: &str = "-----BEGIN PUBLIC KEY-----\n\
                   MCowBQYDK2VwAyEAA6EHv/POEL4dcN0Y50vAmWfk1jCbpQ1fHdyGZBJVMbg=\n\
                   -----END PUBLIC KEY-----\n";

#[test]
fn other_programs_come_to_the_same() {
    let signed = first();
    assert_eq!(hex::encode(opening().hash()), NONCE_HASH);
    assert_eq!(signed.commitment.canonical().len(), CANONICAL_BYTES);
    assert_eq!(hex::encode(signed.hash()), HASH);
    assert_eq!(hex::encode(signed.signature), SIGNATURE);
    let key = signing_key().public_key();
    assert_eq!(
        (key.to_hex().as_str(), key.to_pem().unwrap().as_str()),
        (PUBLIC_KEY, PEM)
    );
    signed.verify(&key).unwrap();
}

#[test]
fn public_keys_are_read_in_every_form() {
    let key = signing_key().public_key();
    for read in [
        PublicKey::from_hex(PUBLIC_KEY),
        PublicKey::from_hex(&format!(" {}\n", PUBLIC_KEY.to_uppercase())),
        PublicKey::from_pem(PEM),
        PublicKey::from_pem(&PEM.replace('\n', "\r\n")),
        PublicKey::from_bytes(&key.to_bytes()),
    ] {
        assert_eq!(read, Ok(key));
    }
    // The neutral element is a point, under which a signature can hold for every text.
    let mut neutral = [0; 32];
    neutral[0] = 1;
    for refused in [
        PublicKey::from_hex(""),
        PublicKey::from_hex(&PUBLIC_KEY[1..]),
        PublicKey::from_pem(PUBLIC_KEY),
        PublicKey::from_pem(&PEM.replace("PUBLIC", "PRIVATE")),
        PublicKey::from_bytes(&[1; 31]),
        PublicKey::from_bytes(&neutral),
        PublicKey::from_bytes(&[2; 32]),
    ] {
        assert!(matches!(refused, Err(Error::NotAPublicKey(_))), "{refused:?}");
    }
}

#[test]
fn a_signature_is_of_one_key_over_one_commitment() {
    let signed = first();
    let refused = Err(Error::BadSignature { sequence: 1 });
    assert_eq!(signed.verify(&another_key().public_key()), refused);
    for bit in 0..512 {
        let mut changed = signed.clone();
        changed.signature[bit / 8] ^= 1 << (bit % 8);
        assert_eq!(changed.verify(&signing_key().public_key()), refused, "bit {bit}");
    }
    // Every field is under it.
    let changes: [fn(&mut Commitment); 9] = [
        |c| c.previous[31] ^= 1,
        |c| c.id = Uuid::from_bytes([8; 16]),
        |c| c.asset = Uuid::from_bytes([8; 16]),
        |c| c.owner = Uuid::from_bytes([8; 16]),
        |c| c.sha256[0] ^= 128,
        |c| c.key = Uuid::from_bytes([8; 16]),
        |c| c.payload += 1,
        |c| c.nonce_hash[7] ^= 1,
        |c| c.time -= 1,
    ];
    for (i, change) in changes.into_iter().enumerate() {
        let mut changed = signed.clone();
        change(&mut changed.commitment);
        assert_eq!(changed.verify(&signing_key().public_key()), refused, "change {i}");
    }
}

#[test]
fn only_the_nonce_that_was_committed_to_opens() {
    let commitment = first().commitment;
    commitment.opens_with(&opening()).unwrap();
    // The nonce and the blinding count alike.
    for at in [0, 15, 16, 47] {
        let mut bytes = *opening().bytes();
        bytes[at] ^= 1;
        let other = Opening::new(&bytes).unwrap();
        assert_eq!(commitment.opens_with(&other), Err(Error::WrongOpening), "byte {at}");
    }
    assert_eq!((opening().nonce().len(), opening().blinding().len()), (16, 32));
    assert_eq!(
        Opening::new(&[0; 47]).unwrap_err(),
        Error::NotAnOpening { found: 47, wanted: 48 }
    );
}

#[test]
fn bytes_of_something_else_are_told() {
    let bytes = first().commitment.canonical();
    assert_eq!(Commitment::from_canonical(b"GIF89a"), Err(Error::NotACommitment));
    assert_eq!(Commitment::from_canonical(b""), Err(Error::NotACommitment));
    let mut newer = bytes.clone();
    newer[22] = 2;
    assert_eq!(
        Commitment::from_canonical(&newer),
        Err(Error::UnknownVersion { found: 2, known: 1 })
    );
    for found in [22, 23, 206] {
        let wanted = CANONICAL_BYTES;
        assert_eq!(
            Commitment::from_canonical(&bytes[..found]),
            Err(Error::Length { found, wanted })
        );
    }
    let longer = [&bytes[..], &[0]].concat();
    assert!(matches!(
        Commitment::from_canonical(&longer),
        Err(Error::Length { found: 208, .. })
    ));
}

#[test]
fn debug_shows_nothing() {
    assert_eq!(format!("{:?}", opening()), "Opening([REDACTED])");
    let text = format!("{:?}", signing_key());
    assert!(text.contains(PUBLIC_KEY) && !text.contains("00010203"), "{text}");
    assert_eq!(
        SigningKey::from_seed(&[7; 31]).unwrap_err(),
        Error::NotASigningKey { found: 31, wanted: 32 }
    );
}

proptest! {
    /// Whatever is committed to comes back from its bytes.
    #[test]
    fn bytes_are_read_back(
        numbers in any::<(u64, u64, i64)>(),
        ids in any::<[[u8; 16]; 4]>(),
        hashes in any::<[[u8; 32]; 3]>(),
    ) {
        let [id, asset, owner, key] = ids.map(Uuid::from_bytes);
        let [previous, sha256, nonce_hash] = hashes;
        let (sequence, payload, time) = numbers;
        let made = Commitment { sequence, previous, id, asset, owner, sha256, key, payload, nonce_hash, time };
        prop_assert_eq!(Commitment::from_canonical(&made.canonical()), Ok(made));
    }

    /// Any bytes are read or refused, and what is read is what was there.
    #[test]
    fn any_bytes_will_do(mut bytes in prop::collection::vec(any::<u8>(), 0..250), begin in any::<bool>()) {
        if begin {
            let whole = first().commitment.canonical();
            let length = bytes.len().min(23);
            bytes[..length].copy_from_slice(&whole[..length]);
        }
        if let Ok(read) = Commitment::from_canonical(&bytes) {
            prop_assert_eq!(read.canonical(), bytes);
        }
    }
}
