//! Tokens as texts: made from random numbers, shown once, kept only as a hash.
use secrecy::{ExposeSecret, SecretBox, SecretString};
use sha2::{Digest, Sha256};
use uuid::Uuid;

use crate::error::{Error, Result};
use crate::secrets;

/// The variable that clients and workers take their token from.
pub const TOKEN_VARIABLE: &str = "GUARDSPLAT_TOKEN";

/// What tokens begin with, so that they are known for what they are wherever they turn up.
const PREFIX: &str = "gst";

/// A token that was just made.
pub struct Fresh {
    /// Its id, which is no secret, and is part of the text.
    pub id: Uuid,
    /// The whole text: `gst_`, the id, `_`, and 256 random bits in hexadecimal.
    pub text: SecretString,
    /// What is kept of it.
    pub hash: [u8; 32],
}

/// Makes a token.
pub fn fresh() -> Result<Fresh> {
    let id = Uuid::now_v7();
    let random: SecretBox<[u8; 32]> =
        secrets::random().map_err(|error| Error::internal("drawing random numbers", error))?;
    let digits = SecretString::from(hex::encode(random.expose_secret()));
    let text = SecretString::from(format!("{PREFIX}_{}_{}", id.simple(), digits.expose_secret()));
    let hash = hash(text.expose_secret());
    Ok(Fresh { id, text, hash })
}

/// What is kept of a token. It has 256 random bits, so that a plain hash is enough; and tokens are looked up by their
/// hashes, so that the time it takes tells nothing of one.
pub fn hash(text: &str) -> [u8; 32] {
    Sha256::digest(text.as_bytes()).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_differ_and_tell_their_id() {
        let (one, other) = (fresh().unwrap(), fresh().unwrap());
        let text = one.text.expose_secret();
        assert_ne!(text, other.text.expose_secret());
        let parts: Vec<_> = text.split('_').collect();
        assert_eq!((parts.len(), parts[0], parts[2].len()), (3, "gst", 64));
        assert_eq!(parts[1], one.id.simple().to_string());
        assert_eq!(hash(text), one.hash);
        assert_ne!(one.hash, other.hash);
    }
}
