//! What is committed to, and its one encoding in bytes.
use sha2::{Digest, Sha256};
use uuid::Uuid;

use crate::{Error, Opening, Result};

/// A SHA-256.
pub type Hash = [u8; 32];

/// The version of commitments that is made and read here.
pub const VERSION: u8 = 1;

/// What the first commitment of a chain names as the hash of the one before.
pub const FIRST: Hash = [0; 32];

/// What the canonical bytes begin with, so that they are the bytes of nothing else.
const MAGIC: &[u8; 22] = b"guardsplat commitment\0";

/// Length of a commitment's canonical bytes: magic, version, and the fields in their order.
pub const CANONICAL_BYTES: usize = MAGIC.len() + 1 + 8 + 32 + 16 + 16 + 16 + 32 + 16 + 8 + 32 + 8;

/// What a registry says of an asset, at one time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Commitment {
    /// Place in the chain; the first has 1.
    pub sequence: u64,
    /// Hash of the commitment before; [`FIRST`] for the first.
    pub previous: Hash,
    /// The commitment's own id.
    pub id: Uuid,
    /// The asset.
    pub asset: Uuid,
    /// Its owner.
    pub owner: Uuid,
    /// SHA-256 of the original's bytes.
    pub sha256: Hash,
    /// The key that the asset is marked with.
    pub key: Uuid,
    /// Number of the asset among those of its key, at least 1.
    pub payload: u64,
    /// What [`Opening::hash`] gives for the secret nonce.
    pub nonce_hash: Hash,
    /// When it was made by the registry's clock, microseconds since 1970, UTC.
    pub time: i64,
}

impl Commitment {
    /// The bytes that are hashed: every field at its place, none of variable length, numbers with the highest byte
    /// first. Two commitments that differ have different bytes.
    pub fn canonical(&self) -> Vec<u8> {
        let fields: [&[u8]; 12] = [
            MAGIC,
            &[VERSION],
            &self.sequence.to_be_bytes(),
            &self.previous,
            self.id.as_bytes(),
            self.asset.as_bytes(),
            self.owner.as_bytes(),
            &self.sha256,
            self.key.as_bytes(),
            &self.payload.to_be_bytes(),
            &self.nonce_hash,
            &self.time.to_be_bytes(),
        ];
        fields.concat()
    }

    /// Reads canonical bytes.
    ///
    /// # Errors
    /// `NotACommitment`, `UnknownVersion`, `Length`.
    pub fn from_canonical(bytes: &[u8]) -> Result<Self> {
        let rest = bytes.strip_prefix(MAGIC.as_slice()).ok_or(Error::NotACommitment)?;
        if let Some(&found) = rest.first().filter(|&&version| version != VERSION) {
            return Err(Error::UnknownVersion {
                found: found.into(),
                known: VERSION,
            });
        }
        read(rest).ok_or(Error::Length {
            found: bytes.len(),
            wanted: CANONICAL_BYTES,
        })
    }

    /// SHA-256 of the canonical bytes: what is signed, and what the next commitment names.
    pub fn hash(&self) -> Hash {
        Sha256::digest(self.canonical()).into()
    }

    /// Checks that a nonce is the one that was committed to.
    ///
    /// # Errors
    /// `WrongOpening`.
    pub fn opens_with(&self, opening: &Opening) -> Result<()> {
        // Both hashes are public by now, so it does not matter how long comparing them takes.
        if opening.hash() == self.nonce_hash {
            Ok(())
        } else {
            Err(Error::WrongOpening)
        }
    }
}

/// What follows the magic; `None` where that is too short or too long.
fn read(bytes: &[u8]) -> Option<Commitment> {
    let mut fields = Fields(bytes);
    let [_version] = fields.next()?;
    let commitment = Commitment {
        sequence: u64::from_be_bytes(fields.next()?),
        previous: fields.next()?,
        id: Uuid::from_bytes(fields.next()?),
        asset: Uuid::from_bytes(fields.next()?),
        owner: Uuid::from_bytes(fields.next()?),
        sha256: fields.next()?,
        key: Uuid::from_bytes(fields.next()?),
        payload: u64::from_be_bytes(fields.next()?),
        nonce_hash: fields.next()?,
        time: i64::from_be_bytes(fields.next()?),
    };
    fields.0.is_empty().then_some(commitment)
}

/// Bytes of which fields are taken from the front.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn next<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (field, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*field)
    }
}
