//! Lease tokens: handed out once, kept only as a hash.
use sha2::{Digest, Sha256};
use uuid::Uuid;

/// A fresh token: 244 random bits from the operating system, in hexadecimal.
pub(crate) fn fresh() -> String {
    format!("{}{}", Uuid::new_v4().simple(), Uuid::new_v4().simple())
}

/// What the database holds of a token. Tokens are compared by their hashes, so timing tells nothing of a token.
pub(crate) fn hash(token: &str) -> Vec<u8> {
    Sha256::digest(token.as_bytes()).to_vec()
}
