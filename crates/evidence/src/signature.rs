//! What stands in a report as its signature.
use serde::{Deserialize, Serialize};

/// The signature of a report, with the public key of whoever signed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Signature {
    /// `ed25519`; nothing else is known.
    pub algorithm: String,
    /// 32 bytes in hexadecimal.
    pub public_key: String,
    /// 64 bytes in hexadecimal.
    pub value: String,
}
