//! The registry: owners, assets, and the states of keys.
use std::sync::Arc;

use guardsplat_codeword::Layout;
use guardsplat_commitment::{Hash, SigningKey};
use uuid::Uuid;

use super::Result;
use super::types::{ArtifactId, KeyId};

/// The code of all marks, which says how many payload numbers a key has.
pub use guardsplat_codeword::MARK_CODE;

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
    /// When its commitment was first opened for somebody, from when on its word is no secret.
    pub reveal_time: Option<i64>,
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
    /// SHA-256 of its original.
    pub sha256: [u8; 32],
    /// Its number among the assets of its key.
    pub payload: i64,
    /// Its nonce and blinding, sealed.
    pub sealed_nonce: Vec<u8>,
}

/// Owners and assets of all projects.
#[async_trait::async_trait]
pub trait Registry: Send + Sync + 'static {
    /// Registers an owner. The same request id with the same display name gives the one that the first call made.
    ///
    /// # Errors
    /// `RequestIdReused` for the same request id with another name, or of another project.
    async fn create_owner(&self, new: NewOwner, now: i64) -> Result<OwnerRow>;

    /// One owner.
    async fn get_owner(&self, id: OwnerId) -> Result<Option<OwnerRow>>;

    /// Owners of a project, newest first; those after `before`, as with `list_jobs`.
    async fn list_owners(&self, project: &str, before: Option<(i64, OwnerId)>, limit: u32) -> Result<Vec<OwnerRow>>;

    /// Registers an asset: gives it the next payload number of its key, and appends a commitment to the chain, signed by
    /// `signer`, at once. The same request id with the same owner, key, hash and display name gives the asset that the
    /// first call made, with the nonce of then.
    ///
    /// # Errors
    /// `RequestIdReused` for the same request id with another asset, or of another project; `NotFound` for an owner or a
    /// key that isn't there or is another project's; `KeyNotActive`, `PayloadsUsedUp`.
    async fn create_asset(&self, new: NewAsset, signer: Arc<SigningKey>, now: i64) -> Result<AssetRow>;

    /// The asset that was registered under a request id.
    async fn find_asset_request(&self, request: Uuid) -> Result<Option<AssetRow>>;

    /// One asset.
    async fn get_asset(&self, id: AssetId) -> Result<Option<AssetRow>>;

    /// Assets of a project, newest first; those after `before`, as with `list_jobs`.
    async fn list_assets(
        &self,
        project: &str,
        filter: AssetFilter,
        before: Option<(i64, AssetId)>,
        limit: u32,
    ) -> Result<Vec<AssetRow>>;

    /// Assets of a key by payload number, those with higher ones than `after`. [`super::candidates::of_key`] reads all.
    async fn candidates(&self, key: KeyId, after: i64, limit: u32) -> Result<Vec<Candidate>>;

    /// How many assets a key has; those of one owner, where one is given.
    async fn count_assets(&self, key: KeyId, owner: Option<OwnerId>) -> Result<u64>;

    /// Notes that the commitment to an asset is opened for somebody. The first time counts.
    ///
    /// # Errors
    /// `NotFound`.
    async fn reveal_asset(&self, asset: AssetId, now: i64) -> Result<AssetRow>;

    /// One asset as a search has it.
    async fn candidate(&self, asset: AssetId) -> Result<Option<Candidate>>;
}

/// How many numbers the messages of a key can hold: all but zero, and no more than the codeword of a mark has room for.
pub fn payloads(bits: u32) -> i64 {
    let room = i64::from(Layout::of(MARK_CODE).largest_number());
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
