//! The two halves of the key that commitments are signed with (Ed25519, RFC 8032).
use std::fmt;

use ed25519_dalek::pkcs8::spki::der::pem::LineEnding;
use ed25519_dalek::pkcs8::{DecodePublicKey, EncodePublicKey};
use ed25519_dalek::{Signature, Signer as _};

use crate::{Commitment, Error, Hash, Result, SIGNATURE_BYTES, Signed};

/// Bytes of the seed that a signing key is made from.
pub const SEED_BYTES: usize = 32;

/// What is signed begins with this, so that a signature under a commitment is one under nothing else.
const PREFIX: &[u8; 32] = b"guardsplat commitment signature\0";

/// What commitments are signed with. `Debug` shows nothing of it, and it is wiped when dropped.
pub struct SigningKey(ed25519_dalek::SigningKey);

impl SigningKey {
    /// The key of a seed: [`SEED_BYTES`] bytes, drawn at random.
    ///
    /// # Errors
    /// `NotASigningKey` for another number of bytes.
    pub fn from_seed(seed: &[u8]) -> Result<Self> {
        let bytes: &[u8; SEED_BYTES] = seed.try_into().map_err(|_| Error::NotASigningKey {
            found: seed.len(),
            wanted: SEED_BYTES,
        })?;
        Ok(Self(ed25519_dalek::SigningKey::from_bytes(bytes)))
    }

    /// The half that signatures are checked with.
    pub fn public_key(&self) -> PublicKey {
        PublicKey(self.0.verifying_key())
    }

    /// Signs a commitment.
    pub fn sign(&self, commitment: Commitment) -> Signed {
        let signature = self.0.sign(&message(&commitment.hash())).to_bytes();
        Signed { commitment, signature }
    }
}

impl fmt::Debug for SigningKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SigningKey")
            .field("public_key", &self.public_key())
            .finish_non_exhaustive()
    }
}

/// What signatures are checked with.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct PublicKey(ed25519_dalek::VerifyingKey);

impl PublicKey {
    /// Bytes of a public key.
    pub const BYTES: usize = 32;

    /// From its bytes.
    ///
    /// # Errors
    /// `NotAPublicKey` for another number of bytes, those of no point of the curve, or of a weak one, under which
    /// some signatures hold for several texts.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let bytes: &[u8; Self::BYTES] = bytes
            .try_into()
            .map_err(|_| Error::NotAPublicKey("it must have 32 bytes"))?;
        let key = ed25519_dalek::VerifyingKey::from_bytes(bytes)
            .map_err(|_| Error::NotAPublicKey("its bytes are no point of the curve"))?;
        Self::strong(key)
    }

    /// From 64 hexadecimal digits.
    ///
    /// # Errors
    /// As [`Self::from_bytes`].
    pub fn from_hex(digits: &str) -> Result<Self> {
        let mut bytes = [0; Self::BYTES];
        hex::decode_to_slice(digits.trim(), &mut bytes)
            .map_err(|_| Error::NotAPublicKey("it must be 64 hexadecimal digits"))?;
        Self::from_bytes(&bytes)
    }

    /// From PEM, as [`Self::to_pem`] writes it and OpenSSL does.
    ///
    /// # Errors
    /// `NotAPublicKey`.
    pub fn from_pem(text: &str) -> Result<Self> {
        let key = ed25519_dalek::VerifyingKey::from_public_key_pem(text.trim())
            .map_err(|_| Error::NotAPublicKey("it must be PEM of a public key"))?;
        Self::strong(key)
    }

    fn strong(key: ed25519_dalek::VerifyingKey) -> Result<Self> {
        if key.is_weak() {
            return Err(Error::NotAPublicKey("it is weak"));
        }
        Ok(Self(key))
    }

    /// Its bytes.
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        self.0.to_bytes()
    }

    /// 64 hexadecimal digits in lower case.
    pub fn to_hex(&self) -> String {
        hex::encode(self.to_bytes())
    }

    /// PEM (`SubjectPublicKeyInfo`, RFC 8410).
    ///
    /// # Errors
    /// `Pem`, which no key gives.
    pub fn to_pem(&self) -> Result<String> {
        self.0.to_public_key_pem(LineEnding::LF).map_err(|_| Error::Pem)
    }

    /// Whether the signature is this key's over a commitment with this hash. Only the one canonical form of a
    /// signature holds.
    pub(crate) fn holds(&self, hash: &Hash, signature: &[u8; SIGNATURE_BYTES]) -> bool {
        let signature = Signature::from_bytes(signature);
        self.0.verify_strict(&message(hash), &signature).is_ok()
    }
}

impl fmt::Debug for PublicKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "PublicKey({})", self.to_hex())
    }
}

fn message(hash: &Hash) -> Vec<u8> {
    [PREFIX.as_slice(), hash].concat()
}
