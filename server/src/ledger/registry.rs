//! What the registry keeps: owners, assets, the states of keys, and the sealed signing key, without any wire format.
use guardsplat_codeword::Layout;
use guardsplat_commitment::Hash;
use uuid::Uuid;

use super::types::{ArtifactId, KeyId};
use crate::marks::CODE;

/// Name of an owner.
pub type OwnerId = Uuid;
/// Name of an asset.
pub type AssetId = Uuid;
/// Name of a commitment.
pub type CommitmentId = Uuid;

/// What a key may be used for. Numbers are kept in the database, and are those of `guardsplat.v1.Key.State`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum KeyState {
    /// It marks and verifies.
    Active = 1,
    /// It verifies.
    Retired = 2,
    /// Nothing.
    Revoked = 3,
}

impl KeyState {
    /// Whether a key may go from this state to another one: forwards only, so that what a key was is never in doubt.
    pub fn may_become(self, next: Self) -> bool {
        next as i32 > self as i32
    }

    /// The state in words.
    pub fn word(self) -> &'static str {
        match self {
            Self::Active => "active",
            Self::Retired => "retired",
            Self::Revoked => "revoked",
        }
    }
}

/// An owner to register.
#[derive(Clone, Debug)]
pub struct NewOwner {
    /// Its name.
    pub id: OwnerId,
    /// The project that registers it.
    pub project: String,
    /// What people call it.
    pub display_name: String,
    /// Names the request, so that it can be repeated.
    pub request_id: Option<Uuid>,
}

/// What is known of an owner.
#[derive(Clone, Debug, PartialEq)]
pub struct OwnerRow {
    /// Its name.
    pub id: OwnerId,
    /// The project that registered it.
    pub project: String,
    /// What people call it.
    pub display_name: String,
    /// When it was registered.
    pub create_time: i64,
}

/// An asset to register. Payload number and place in the chain are given by the ledger.
#[derive(Clone, Debug)]
pub struct NewAsset {
    /// Its name.
    pub id: AssetId,
    /// The project that registers it; owner and key must be of the same.
    pub project: String,
    /// Name of its commitment.
    pub commitment: CommitmentId,
    /// Whose it is.
    pub owner: OwnerId,
    /// What people call it.
    pub display_name: String,
    /// SHA-256 of the original.
    pub sha256: Hash,
    /// The artifact that the hash was taken from, if it was.
    pub artifact: Option<ArtifactId>,
    /// The key that it is marked with.
    pub key: KeyId,
    /// Its nonce and blinding, sealed.
    pub sealed_nonce: Vec<u8>,
    /// What the commitment says of the nonce.
    pub nonce_hash: Hash,
    /// Names the request, so that it can be repeated.
    pub request_id: Option<Uuid>,
}

/// What is known of an asset.
#[derive(Clone, Debug, PartialEq)]
pub struct AssetRow {
    /// Its name.
    pub id: AssetId,
    /// The project that registered it.
    pub project: String,
    /// Its commitment.
    pub commitment: CommitmentId,
    /// Whose it is.
    pub owner: OwnerId,
    /// What people call it.
    pub display_name: String,
    /// SHA-256 of the original.
    pub sha256: Hash,
    /// The artifact that the hash was taken from, if it was; it may be gone.
    pub artifact: Option<ArtifactId>,
    /// The key that it is marked with.
    pub key: KeyId,
    /// Its number among the assets of that key, from 1.
    pub payload: i64,
    /// When it was registered.
    pub create_time: i64,
}

/// Which assets to list; all, when neither is given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AssetFilter {
    /// Only those of this owner.
    pub owner: Option<OwnerId>,
    /// Only those of this key.
    pub key: Option<KeyId>,
}

/// An asset as a search for the one that a reading belongs to needs it.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Its name.
    pub asset: AssetId,
    /// Whose it is.
    pub owner: OwnerId,
    /// Its number among the assets of its key.
    pub payload: i64,
    /// Its nonce and blinding, sealed.
    pub sealed_nonce: Vec<u8>,
}

/// The key that commitments are signed with, sealed.
#[derive(Clone, Debug, PartialEq)]
pub struct SealedSigningKey {
    /// The half that signatures are checked with.
    pub public_key: [u8; 32],
    /// The seed of the other half, sealed.
    pub sealed: Vec<u8>,
}

/// How many numbers the messages of a key can hold: all but zero, and no more than the codeword of a mark has room for.
pub fn payloads(bits: u32) -> i64 {
    let room = i64::from(Layout::of(CODE).largest_number());
    room.min((1_i64 << bits.min(62)) - 1)
}

#[cfg(test)]
mod tests {
    use super::KeyState::{Active, Retired, Revoked};
    use super::*;

    #[test]
    fn keys_go_forwards_only() {
        let may: Vec<_> = [Active, Retired, Revoked]
            .into_iter()
            .flat_map(|from| [Active, Retired, Revoked].map(|to| (from, to)))
            .filter(|(from, to)| from.may_become(*to))
            .collect();
        assert_eq!(may, [(Active, Retired), (Active, Revoked), (Retired, Revoked)]);
    }

    #[test]
    fn short_messages_hold_few_numbers_and_long_ones_what_a_codeword_does() {
        assert_eq!(
            [1, 8, 23, 24, 64, 150].map(payloads),
            [1, 255, (1 << 23) - 1, (1 << 24) - 1, (1 << 24) - 1, (1 << 24) - 1]
        );
    }
}
