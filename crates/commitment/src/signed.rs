//! A commitment with the signature under it.
use crate::{Commitment, Error, Hash, PublicKey, Result};

/// Bytes of a signature.
pub const SIGNATURE_BYTES: usize = 64;

/// A commitment that somebody signed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Signed {
    /// What was said.
    pub commitment: Commitment,
    /// Ed25519 over a prefix and the commitment's hash.
    pub signature: [u8; SIGNATURE_BYTES],
}

impl Signed {
    /// The commitment's hash.
    pub fn hash(&self) -> Hash {
        self.commitment.hash()
    }

    /// Checks that this key signed the commitment as it is.
    ///
    /// # Errors
    /// `BadSignature`.
    pub fn verify(&self, key: &PublicKey) -> Result<()> {
        if key.holds(&self.hash(), &self.signature) {
            Ok(())
        } else {
            Err(Error::BadSignature {
                sequence: self.commitment.sequence,
            })
        }
    }
}
