//! What was before a claim: when the suspect was first seen, what had been tried, and since when the asset is registered.
use crate::hash::Sha256;
use jiff::Timestamp;
use serde::{Deserialize, Serialize};

/// What the service had seen of a suspect and of its claimant before.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct History {
    /// When the service first saw any of these files, by their hashes.
    pub first_seen: Timestamp,
    /// Readings that the claimant had made with this key, of whatever suspects, this one included. The p-value does not
    /// pay for those of other files: who lets a changed copy be read again and again is found out by this number.
    pub readings_of_key: u64,
    /// Assets of the owner of `asset` that are registered for this key.
    pub assets_of_owner: Option<u64>,
    /// The asset that was named or found.
    pub asset: Option<Registration>,
}

/// Since when an asset is registered, and where in the chain of commitments that stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Registration {
    /// The asset, as the service names it.
    pub asset: String,
    /// Its commitment, as the service names it.
    pub commitment: String,
    /// The commitment's place in the chain.
    pub sequence: u64,
    /// The commitment's hash.
    pub hash: Sha256,
    /// When the asset was registered, by the clock of the service.
    pub time: Timestamp,
    /// When the commitment was opened for somebody, from when on the asset's word is no secret.
    pub revealed: Option<Timestamp>,
}

impl History {
    /// Whether the asset was registered after a file of the suspect was seen, which can't carry its mark then.
    pub fn registered_later(&self) -> bool {
        self.asset.as_ref().is_some_and(|asset| asset.time > self.first_seen)
    }
}
