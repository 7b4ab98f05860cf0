//! What commitments and evidence are signed with, and the nonces that they hide: secrets that lie in the ledger sealed under the
//! master key, each for its own place.
use std::sync::Arc;

use guardsplat_commitment::{Hash, OPENING_BYTES, Opening, PublicKey, SEED_BYTES, SigningKey};
use secrecy::ExposeSecret;

use crate::error::{Error, Result};
use crate::ledger::{AssetId, Ledger, SealedSigningKey};
use crate::secrets::{self, MasterKey, SecretResult};

/// What the signing key is sealed for.
const SIGNING_KEY: &str = "signing key";

/// The service as the one who signs.
#[derive(Clone)]
pub struct Notary {
    signing: Arc<SigningKey>,
    /// The same key, as reports are signed with it.
    reports: Arc<guardsplat_evidence::SigningKey>,
}

impl std::fmt::Debug for Notary {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Notary")
            .field("signing", &self.signing)
            .finish_non_exhaustive()
    }
}

impl Notary {
    /// Opens the signing key that the ledger keeps; makes one at the first start. `now` in microseconds since 1970.
    ///
    /// # Errors
    /// Those of the ledger; `Internal` when the key does not open, or is not the half of the public key beside it.
    pub async fn open(ledger: &dyn Ledger, master: &MasterKey, now: i64) -> Result<Self> {
        let kept = match ledger.signing_key().await? {
            Some(kept) => kept,
            None => {
                let kept = ledger.keep_signing_key(new_signing_key(master)?, now).await?;
                tracing::info!(public_key = hex::encode(kept.public_key), "a signing key was made");
                kept
            }
        };
        let seed = master.open(SIGNING_KEY, &kept.sealed)?;
        let signing = SigningKey::from_seed(seed.expose_secret()).map_err(broken)?;
        if signing.public_key().to_bytes() != kept.public_key {
            return Err(broken("its public key is another one"));
        }
        let seed = <&[u8; SEED_BYTES]>::try_from(seed.expose_secret()).map_err(broken)?;
        Ok(Self {
            signing: Arc::new(signing),
            reports: Arc::new(guardsplat_evidence::SigningKey::from_bytes(seed)),
        })
    }

    /// What evidence is signed with: the same key, over texts that no commitment begins with.
    pub fn report_key(&self) -> &guardsplat_evidence::SigningKey {
        &self.reports
    }

    /// What commitments are signed with.
    pub fn signing_key(&self) -> Arc<SigningKey> {
        self.signing.clone()
    }

    /// What signatures are checked with.
    pub fn public_key(&self) -> PublicKey {
        self.signing.public_key()
    }
}

fn new_signing_key(master: &MasterKey) -> Result<SealedSigningKey> {
    let seed = secrets::random::<SEED_BYTES>()?;
    let key = SigningKey::from_seed(seed.expose_secret()).map_err(broken)?;
    Ok(SealedSigningKey {
        public_key: key.public_key().to_bytes(),
        sealed: master.seal(SIGNING_KEY, seed.expose_secret())?,
    })
}

fn broken(reason: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Error {
    Error::internal("opening the signing key", reason)
}

/// A fresh nonce.
#[derive(Debug)]
pub struct SealedNonce {
    /// Nonce and blinding, sealed for one asset.
    pub sealed: Vec<u8>,
    /// What a commitment says of them.
    pub hash: Hash,
}

/// Draws a nonce and a blinding for an asset, and seals them for it.
///
/// # Errors
/// `NoRandomness`, `SealFailed`.
pub fn new_nonce(master: &MasterKey, asset: AssetId) -> Result<SealedNonce> {
    let bytes = secrets::random::<OPENING_BYTES>()?;
    let opening = opening(bytes.expose_secret())?;
    Ok(SealedNonce {
        sealed: master.seal(&place(asset), opening.bytes())?,
        hash: opening.hash(),
    })
}

/// Opens the nonce of an asset.
///
/// # Errors
/// As [`MasterKey::open`]; `Internal` when what was sealed is no nonce.
pub fn open_nonce(master: &MasterKey, asset: AssetId, sealed: &[u8]) -> Result<Opening> {
    let bytes: SecretResult<_> = master.open(&place(asset), sealed);
    opening(bytes?.expose_secret())
}

fn opening(bytes: &[u8]) -> Result<Opening> {
    Opening::new(bytes).map_err(|error| Error::internal("opening a nonce", error))
}

/// What the nonce of an asset is sealed for: it opens in no other asset's place.
fn place(asset: AssetId) -> String {
    format!("assets/{asset}/nonce")
}

#[cfg(test)]
mod tests {
    use uuid::Uuid;

    use super::*;
    use crate::ledger::{CommitmentLog as _, SqliteLedger};

    #[test]
    fn nonces_open_in_their_place_only() {
        let (master, asset) = (MasterKey::generate().unwrap(), Uuid::now_v7());
        let (one, other) = (new_nonce(&master, asset).unwrap(), new_nonce(&master, asset).unwrap());
        assert_ne!(one.hash, other.hash);
        let opened = open_nonce(&master, asset, &one.sealed).unwrap();
        assert_eq!(opened.hash(), one.hash);
        assert!(!one.sealed.windows(16).any(|part| part == opened.nonce()));
        assert!(open_nonce(&master, Uuid::now_v7(), &one.sealed).is_err());
        assert!(open_nonce(&MasterKey::generate().unwrap(), asset, &one.sealed).is_err());
        let no_nonce = master.seal(&place(asset), &[0; OPENING_BYTES - 1]).unwrap();
        assert!(open_nonce(&master, asset, &no_nonce).is_err());
    }

    #[tokio::test]
    async fn the_signing_key_is_made_once_and_lies_sealed() {
        let folder = tempfile::TempDir::new().unwrap();
        let path = folder.path().join("ledger.sqlite");
        let ledger = SqliteLedger::open(&path).await.unwrap();
        let master = MasterKey::generate().unwrap();
        let first = Notary::open(&ledger, &master, 0).await.unwrap().public_key();
        assert_eq!(Notary::open(&ledger, &master, 1).await.unwrap().public_key(), first);
        // Two that start at once come to the same.
        let late = ledger
            .keep_signing_key(new_signing_key(&master).unwrap(), 2)
            .await
            .unwrap();
        assert_eq!(late.public_key, first.to_bytes());

        ledger.close().await;
        let ledger = SqliteLedger::open(&path).await.unwrap();
        assert_eq!(Notary::open(&ledger, &master, 3).await.unwrap().public_key(), first);
        let other = MasterKey::generate().unwrap();
        assert!(Notary::open(&ledger, &other, 4).await.is_err());
        let seed = master.open(SIGNING_KEY, &late.sealed).unwrap();
        let files = std::fs::read_dir(folder.path()).unwrap();
        for file in files {
            let bytes = std::fs::read(file.unwrap().path()).unwrap();
            assert!(!bytes.windows(SEED_BYTES).any(|part| part == seed.expose_secret()));
        }
    }
}
