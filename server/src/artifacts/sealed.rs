//! Secret artifacts: key files, which lie in the store encrypted. They are short, so they are sealed whole.
use secrecy::{ExposeSecret, SecretSlice};

use super::{Announced, ArtifactPath, ArtifactStore, StoreError, StoreResult};
use crate::secrets::MasterKey;

/// Most bytes of a key file; the widest key of a CLIP of 1024 dimensions has 13 MiB.
pub const MAX_SECRET_BYTES: u64 = 32 << 20;

impl ArtifactStore {
    /// Writes a secret, sealed for its path: what lies there can't be passed off as another key.
    pub async fn write_sealed(
        &self,
        path: &ArtifactPath,
        master: &MasterKey,
        secret: &SecretSlice<u8>,
    ) -> StoreResult<()> {
        let size = secret.expose_secret().len() as u64;
        if size > MAX_SECRET_BYTES {
            return Err(StoreError::TooLarge {
                size,
                limit: MAX_SECRET_BYTES,
            });
        }
        let sealed = master.seal(&path.to_string(), secret.expose_secret())?;
        let mut writer = self.write(path, Announced::of(&sealed)).await?;
        for chunk in sealed.chunks(super::CHUNK_BYTES) {
            writer.chunk(chunk.to_vec()).await?;
        }
        writer.finish().await?;
        Ok(())
    }

    /// Reads a secret that was written for this path.
    pub async fn read_sealed(&self, path: &ArtifactPath, master: &MasterKey) -> StoreResult<SecretSlice<u8>> {
        let mut reader = self.read(path, 0).await?;
        let mut sealed = Vec::with_capacity(reader.size().min(MAX_SECRET_BYTES) as usize);
        while let Some(piece) = reader.piece().await? {
            sealed.extend_from_slice(&piece);
        }
        Ok(master.open(&path.to_string(), &sealed)?)
    }
}
