//! The links of the chain: what an asset gets when it is registered, and what is kept of a commitment.
use guardsplat_commitment::{Commitment, Hash, Link, Signed, SigningKey};

use super::registry::{AssetRow, KeyState, NewAsset, payloads};
use super::types::KeyRow;
use super::{LedgerError, Result};

/// The asset with its payload number, the one behind the key's last (0 when it has none).
///
/// # Errors
/// `KeyNotActive`, `PayloadsUsedUp`.
pub(super) fn numbered(new: &NewAsset, key: &KeyRow, last: i64, now: i64) -> Result<AssetRow> {
    if key.state != KeyState::Active {
        return Err(LedgerError::KeyNotActive {
            key: key.id,
            state: key.state,
        });
    }
    let limit = payloads(key.bits);
    if last >= limit {
        return Err(LedgerError::PayloadsUsedUp { key: key.id, limit });
    }
    Ok(AssetRow {
        id: new.id,
        project: new.project.clone(),
        commitment: new.commitment,
        owner: new.owner,
        display_name: new.display_name.clone(),
        sha256: new.sha256,
        artifact: new.artifact,
        key: new.key,
        payload: last + 1,
        create_time: now,
        reveal_time: None,
    })
}

/// The commitment to an asset behind the last one of the chain, and its place.
pub(super) fn next(head: Option<&Signed>, asset: &AssetRow, nonce_hash: Hash, signer: &SigningKey) -> (i64, Signed) {
    let last = head.map_or(Link::START, Link::at);
    let signed = signer.sign(Commitment {
        sequence: last.sequence.saturating_add(1),
        previous: last.hash,
        id: asset.commitment,
        asset: asset.id,
        owner: asset.owner,
        sha256: asset.sha256,
        key: asset.key,
        payload: u64::try_from(asset.payload).unwrap_or_default(), // the table holds none below 1
        nonce_hash,
        // A clock that was set back must not make a chain that nobody believes.
        time: asset.create_time.max(last.time),
    });
    (i64::try_from(signed.commitment.sequence).unwrap_or(i64::MAX), signed)
}

/// What is read is what was signed: the canonical bytes, and not columns that say the same.
pub(super) fn read(sequence: i64, canonical: &[u8], signature: [u8; 64]) -> Result<Signed> {
    let commitment =
        Commitment::from_canonical(canonical).map_err(|source| LedgerError::BadCommitment { sequence, source })?;
    Ok(Signed { commitment, signature })
}
