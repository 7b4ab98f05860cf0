//! Whether the bytes that arrive are the ones that were announced: their number and their SHA-256.
use sha2::{Digest, Sha256};

use super::{CHUNK_BYTES, StoreError, StoreResult};

/// What a sender says that it will send.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Announced {
    /// Length in bytes.
    pub size: u64,
    /// SHA-256 of the bytes.
    pub sha256: [u8; 32],
}

impl Announced {
    /// What is true of these bytes.
    pub fn of(bytes: &[u8]) -> Self {
        Self {
            size: bytes.len() as u64,
            sha256: Sha256::digest(bytes).into(),
        }
    }
}

/// Checks chunks as they arrive, so that a sender hears of a mistake at once.
#[derive(Clone, Debug)]
pub struct Check {
    announced: Announced,
    received: u64,
    digest: Sha256,
}

impl Check {
    /// Refuses what is longer than `limit` before any of it was sent.
    pub fn new(announced: Announced, limit: u64) -> StoreResult<Self> {
        if announced.size > limit {
            return Err(StoreError::TooLarge {
                size: announced.size,
                limit,
            });
        }
        Ok(Self {
            announced,
            received: 0,
            digest: Sha256::new(),
        })
    }

    /// Takes the next chunk.
    pub fn chunk(&mut self, chunk: &[u8]) -> StoreResult<()> {
        if chunk.len() > CHUNK_BYTES {
            return Err(StoreError::ChunkTooLarge {
                size: chunk.len(),
                limit: CHUNK_BYTES,
            });
        }
        let received = self.received + chunk.len() as u64;
        if received > self.announced.size {
            return Err(StoreError::TooLong {
                announced: self.announced.size,
            });
        }
        self.received = received;
        self.digest.update(chunk);
        Ok(())
    }

    /// Says whether what arrived is all that was announced.
    pub fn finish(self) -> StoreResult<Announced> {
        if self.received < self.announced.size {
            return Err(StoreError::TooShort {
                announced: self.announced.size,
                received: self.received,
            });
        }
        let received: [u8; 32] = self.digest.finalize().into();
        if received != self.announced.sha256 {
            return Err(StoreError::WrongChecksum {
                announced: hex::encode(self.announced.sha256),
                received: hex::encode(received),
            });
        }
        Ok(self.announced)
    }
}
