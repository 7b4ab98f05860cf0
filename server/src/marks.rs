//! What assets are marked with: the codeword of a payload under the pad of the asset's own secret.
//!
//! Nonce and blinding, which the ledger keeps sealed and a commitment holds the hash of, decide the pad. So it was
//! settled when the original was registered, nobody who reads a scene first can choose an asset to fit, and whoever is
//! shown both can compute the word again. Formulas are in `docs/registry.md`.
use guardsplat_codeword::{Code, MARK_CODE, Mark, MessageLength, Payload, Whitening};

use crate::error::{Error, Result};
use crate::ledger::{Candidate, KeyId};
use crate::notary;
use crate::secrets::MasterKey;

/// The code of all marks, by which the ledger numbers them.
pub const CODE: Code = MARK_CODE;

/// Bits that a key must have for its assets to be marked.
pub fn bits() -> u32 {
    MessageLength::CODED.bits()
}

/// The payload of a number of a key.
///
/// # Errors
/// `Internal` for numbers that no asset is given.
pub fn payload(key: KeyId, number: i64) -> Result<Payload> {
    let number = u32::try_from(number).map_err(|error| Error::internal("making a codeword", error))?;
    Ok(Payload::of_key(CODE, key.as_bytes(), number))
}

/// The word that an asset of a key is marked with, and its pad.
///
/// # Errors
/// Those of opening the nonce; `Internal` for a payload that the code has no room for.
pub fn mark(master: &MasterKey, key: KeyId, asset: &Candidate) -> Result<Mark> {
    let opening = notary::open_nonce(master, asset.asset, &asset.sealed_nonce)?;
    let secret = opening.whitening_secret();
    let whitening = Whitening {
        secret: &secret,
        asset: asset.asset.as_bytes(),
        nonce: opening.nonce(),
    };
    let payload = payload(key, asset.payload)?;
    guardsplat_codeword::mark(CODE, payload, &whitening).map_err(|error| Error::internal("making a codeword", error))
}

#[cfg(test)]
mod tests {
    use uuid::Uuid;

    use super::*;

    fn candidate(master: &MasterKey, payload: i64) -> Candidate {
        let asset = Uuid::now_v7();
        Candidate {
            asset,
            owner: Uuid::now_v7(),
            sha256: [0; 32],
            payload,
            sealed_nonce: notary::new_nonce(master, asset).unwrap().sealed,
        }
    }

    #[test]
    fn the_word_says_key_and_number_under_a_pad_of_the_asset_alone() {
        let (master, key) = (MasterKey::generate().unwrap(), Uuid::now_v7());
        let [one, two] = [7, 7].map(|number| candidate(&master, number));
        let [a, b] = [&one, &two].map(|asset| mark(&master, key, asset).unwrap());
        assert_eq!(mark(&master, key, &one).unwrap(), a);
        let read = CODE.decode(&a.word.xor(&a.pad).unwrap()).unwrap().unwrap();
        assert_eq!(read.corrected_bits, 0);
        assert_eq!(
            Payload::unpack(CODE, read.information).unwrap(),
            payload(key, 7).unwrap()
        );
        // The same number of the same key, and nothing in common.
        assert_eq!(a.word.xor(&a.pad).unwrap(), b.word.xor(&b.pad).unwrap());
        assert_ne!(a.pad, b.pad);
        assert!(mark(&master, key, &candidate(&master, 1 << 24)).is_err());
        assert!(mark(&master, key, &candidate(&master, -1)).is_err());
        assert!(mark(&MasterKey::generate().unwrap(), key, &one).is_err());
    }
}
