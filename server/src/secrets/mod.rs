//! The master key, and what is kept encrypted under it.
//!
//! Keys of the service lie in the artifact store sealed with XChaCha20-Poly1305. A sealed text names its format and the
//! master key it needs, and belongs to one context (where it lies), so that a wrong key, damage and an exchange of two
//! texts are told apart from each other where that can be done, and never pass.
mod error;
mod load;
mod seal;

use chacha20poly1305::aead::Generate;
use hmac::{Hmac, KeyInit, Mac};
use secrecy::zeroize::{Zeroize, Zeroizing};
use secrecy::{ExposeSecret, SecretBox};
use sha2::{Digest, Sha256};

pub use error::{SecretError, SecretResult};
pub use load::{KeySource, MASTER_KEY_VARIABLE, load};

/// Bytes of a master key.
const KEY_BYTES: usize = 32;
/// Bytes of what tells master keys apart.
const ID_BYTES: usize = 8;

/// What keys are sealed with. It shows nothing of itself in `Debug`, and is wiped when it is dropped.
#[derive(Debug)]
pub struct MasterKey {
    key: SecretBox<[u8; KEY_BYTES]>,
    id: [u8; ID_BYTES],
}

/// Secret bytes from the operating system's random numbers.
pub fn random<const N: usize>() -> SecretResult<SecretBox<[u8; N]>> {
    let mut bytes = <[u8; N]>::try_generate().map_err(|error| SecretError::NoRandomness(error.to_string()))?;
    let secret = SecretBox::new(Box::new(bytes));
    bytes.zeroize();
    Ok(secret)
}

impl MasterKey {
    /// A new one, from the operating system's random numbers.
    pub fn generate() -> SecretResult<Self> {
        let mut bytes =
            <[u8; KEY_BYTES]>::try_generate().map_err(|error| SecretError::NoRandomness(error.to_string()))?;
        let key = Self::new(bytes);
        bytes.zeroize();
        Ok(key)
    }

    /// Reads 64 hexadecimal digits; spaces around them do not matter. `place` says where they are from, for the error.
    pub fn from_hex(text: &str, place: &str) -> SecretResult<Self> {
        let mut bytes = [0; KEY_BYTES];
        // The decoder's own error would quote a digit.
        hex::decode_to_slice(text.trim(), &mut bytes).map_err(|_| SecretError::NotAKey {
            place: place.to_owned(),
            digits: 2 * KEY_BYTES,
        })?;
        let key = Self::new(bytes);
        bytes.zeroize();
        Ok(key)
    }

    fn new(bytes: [u8; KEY_BYTES]) -> Self {
        let mut hash = Sha256::new_with_prefix(b"guardsplat master key id\0");
        hash.update(bytes);
        let mut id = [0; ID_BYTES];
        id.copy_from_slice(&hash.finalize()[..ID_BYTES]);
        Self {
            key: SecretBox::new(Box::new(bytes)),
            id,
        }
    }

    /// HMAC-SHA256 of something under a key of its own for this purpose, which follows from the master key: what is hashed
    /// can't be found by trying without that.
    pub fn keyed_hash(&self, purpose: &str, bytes: &[u8]) -> [u8; 32] {
        let mut derived = Sha256::new_with_prefix(b"guardsplat keyed hash\0");
        derived.update(self.bytes());
        let derived = Zeroizing::new(<[u8; 32]>::from(derived.finalize()));
        // A key of a whole block: HMAC itself puts zeros behind shorter ones, and this way nothing can fail.
        let mut block = Zeroizing::new([0; 64]);
        block.iter_mut().zip(derived.iter()).for_each(|(to, from)| *to = *from);
        let mut mac = Hmac::<Sha256>::new(&(*block).into());
        for part in [purpose.as_bytes(), bytes] {
            mac.update(&(part.len() as u64).to_be_bytes());
            mac.update(part);
        }
        mac.finalize().into_bytes().into()
    }

    /// What tells this key from others, in hexadecimal; no secret.
    pub fn id(&self) -> String {
        hex::encode(self.id)
    }

    fn bytes(&self) -> &[u8; KEY_BYTES] {
        self.key.expose_secret()
    }
}

#[cfg(test)]
mod tests;
