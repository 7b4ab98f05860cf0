//! Owners and assets.
use guardsplat_proto::v1::asset::Original;
use guardsplat_proto::v1::{Asset, Owner};
use serde::Serialize;

use super::text::time;

/// What is known of an owner.
#[derive(Debug, Serialize)]
pub struct OwnerReport {
    name: String,
    display_name: String,
    create_time: Option<String>,
}

impl From<&Owner> for OwnerReport {
    fn from(owner: &Owner) -> Self {
        Self {
            name: owner.name.clone(),
            display_name: owner.display_name.clone(),
            create_time: time(owner.create_time),
        }
    }
}

/// What is known of an asset.
#[derive(Debug, Serialize)]
pub struct AssetReport {
    name: String,
    owner: String,
    display_name: String,
    sha256: Option<String>,
    key: String,
    payload_number: i64,
    commitment: String,
    create_time: Option<String>,
    /// When its commitment was first opened.
    reveal_time: Option<String>,
}

impl From<&Asset> for AssetReport {
    fn from(asset: &Asset) -> Self {
        Self {
            name: asset.name.clone(),
            owner: asset.owner.clone(),
            display_name: asset.display_name.clone(),
            sha256: match &asset.original {
                Some(Original::Sha256(digits)) => Some(digits.clone()),
                // Answers have the hash.
                Some(Original::Artifact(_)) | None => None,
            },
            key: asset.key.clone(),
            payload_number: asset.payload_number,
            commitment: asset.commitment.clone(),
            create_time: time(asset.create_time),
            reveal_time: time(asset.reveal_time),
        }
    }
}
