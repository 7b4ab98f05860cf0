//! Sealed texts: `magic | version | master key id | nonce | ciphertext and tag`.
//!
//! The nonce is random, which XChaCha20's 192 bits allow for any number of texts. Everything before the ciphertext is
//! authenticated with it, and so is the context.
use chacha20poly1305::aead::{Aead, Generate, Payload};
use chacha20poly1305::{KeyInit, XChaCha20Poly1305, XNonce};
use secrecy::SecretSlice;

use super::{ID_BYTES, MasterKey, SecretError, SecretResult};

const MAGIC: &[u8; 4] = b"GSSL";
const VERSION: u8 = 1;
const NONCE_BYTES: usize = 24;
const ID_AT: usize = MAGIC.len() + 1;
const NONCE_AT: usize = ID_AT + ID_BYTES;
const TEXT_AT: usize = NONCE_AT + NONCE_BYTES;

impl MasterKey {
    /// Seals a secret for a context: the text opens with this master key and this context only.
    pub fn seal(&self, context: &str, secret: &[u8]) -> SecretResult<Vec<u8>> {
        let nonce =
            <[u8; NONCE_BYTES]>::try_generate().map_err(|error| SecretError::NoRandomness(error.to_string()))?;
        let mut sealed = Vec::with_capacity(TEXT_AT + secret.len() + 16);
        sealed.extend_from_slice(MAGIC);
        sealed.push(VERSION);
        sealed.extend_from_slice(&self.id);
        sealed.extend_from_slice(&nonce);
        let aad = associated(&sealed, context);
        let text = self
            .cipher()
            .encrypt(&XNonce::from(nonce), Payload { msg: secret, aad: &aad })
            .map_err(|_| SecretError::SealFailed)?;
        sealed.extend_from_slice(&text);
        Ok(sealed)
    }

    /// Opens what was sealed for this context.
    pub fn open(&self, context: &str, sealed: &[u8]) -> SecretResult<SecretSlice<u8>> {
        let (header, text) = sealed.split_at_checked(TEXT_AT).ok_or(SecretError::NotSealed)?;
        let (magic, rest) = header
            .split_first_chunk::<{ MAGIC.len() }>()
            .ok_or(SecretError::NotSealed)?;
        if magic != MAGIC {
            return Err(SecretError::NotSealed);
        }
        if rest[0] != VERSION {
            return Err(SecretError::UnknownVersion {
                found: rest[0],
                known: VERSION,
            });
        }
        let id = &header[ID_AT..NONCE_AT];
        if id != self.id {
            return Err(SecretError::WrongKey {
                needed: hex::encode(id),
                given: self.id(),
            });
        }
        let mut nonce = [0; NONCE_BYTES];
        nonce.copy_from_slice(&header[NONCE_AT..]);
        let aad = associated(header, context);
        self.cipher()
            .decrypt(&XNonce::from(nonce), Payload { msg: text, aad: &aad })
            .map(SecretSlice::from)
            .map_err(|_| SecretError::Altered)
    }

    fn cipher(&self) -> XChaCha20Poly1305 {
        XChaCha20Poly1305::new(self.bytes().into())
    }
}

/// What is authenticated besides the secret. The header has a fixed length, so no two pairs give the same bytes.
fn associated(header: &[u8], context: &str) -> Vec<u8> {
    [header, context.as_bytes()].concat()
}
