//! Encoding, signatures, documents and chains, against values from elsewhere and against every change.
mod chains;
mod documents;
mod encoding;

use uuid::Uuid;

use crate::{Commitment, FIRST, Hash, OPENING_BYTES, Opening, Signed, SigningKey};

fn signing_key() -> SigningKey {
    SigningKey::from_seed(&std::array::from_fn::<u8, 32, _>(|i| i as u8)).unwrap()
}

fn another_key() -> SigningKey {
    SigningKey::from_seed(&[9; 32]).unwrap()
}

fn opening() -> Opening {
    Opening::new(&std::array::from_fn::<u8, OPENING_BYTES, _>(|i| 100 + i as u8)).unwrap()
}

fn commitment(sequence: u64, previous: Hash, time: i64) -> Commitment {
    let id = |byte| Uuid::from_bytes([byte; 16]);
    Commitment {
        sequence,
        previous,
        id: id(1),
        asset: id(2),
        owner: id(3),
        sha256: [4; 32],
        key: id(5),
        payload: 7,
        nonce_hash: opening().hash(),
        time,
    }
}

fn first() -> Signed {
    signing_key().sign(commitment(1, FIRST, 1_700_000_000_000_000))
}
