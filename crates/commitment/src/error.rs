//! What can be wrong with commitments. No variant holds any part of a secret.

/// A result of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// What is wrong.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// The bytes of a commitment have another length than all of them have.
    #[error("a commitment has {wanted} bytes, and this one {found}")]
    Length {
        /// Bytes given.
        found: usize,
        /// Bytes that it must have.
        wanted: usize,
    },
    /// The bytes are of something else.
    #[error("these are not the bytes of a commitment")]
    NotACommitment,
    /// A format that this version does not know.
    #[error("version {found} of commitments is not known, only {known} is")]
    UnknownVersion {
        /// The version given.
        found: u64,
        /// The version that is known.
        known: u8,
    },
    /// A document that is no document of a commitment at all.
    #[error("not the document of a commitment: {0}")]
    NotADocument(String),
    /// A field of a document is not what it must be.
    #[error("{field}: {reason}")]
    Field {
        /// Its name.
        field: &'static str,
        /// What is wrong with it, and what it must be.
        reason: String,
    },
    /// Not a public key.
    #[error("not a public key of Ed25519: {0}")]
    NotAPublicKey(&'static str),
    /// A public key could not be written as PEM.
    #[error("a public key could not be written as PEM")]
    Pem,
    /// Not the seed of a signing key.
    #[error("a signing key has {wanted} bytes, and this one {found}")]
    NotASigningKey {
        /// Bytes given.
        found: usize,
        /// Bytes that it must have.
        wanted: usize,
    },
    /// Not a nonce with its blinding.
    #[error("a nonce and its blinding have {wanted} bytes, and these {found}")]
    NotAnOpening {
        /// Bytes given.
        found: usize,
        /// Bytes that they must have.
        wanted: usize,
    },
    /// A document names another public key than the one that is trusted.
    #[error("signed with the key {found}, and the one that is trusted is {trusted}")]
    OtherKey {
        /// The key that the document names.
        found: String,
        /// The key that is trusted.
        trusted: String,
    },
    /// The signature is not of this key over this commitment.
    #[error("the signature of commitment {sequence} does not hold")]
    BadSignature {
        /// Place of the commitment in the chain.
        sequence: u64,
    },
    /// A commitment is missing, or is there twice.
    #[error("commitment {wanted} was to follow, and {found} does")]
    OutOfOrder {
        /// The place that is next.
        wanted: u64,
        /// The place that the commitment says it has.
        found: u64,
    },
    /// A commitment follows on another one than the one that is there.
    #[error("commitment {sequence} follows on {found}, and the one before it is {wanted}")]
    NotLinked {
        /// Place of the commitment in the chain.
        sequence: u64,
        /// Hash that it names as the one before, hexadecimal.
        found: String,
        /// Hash of the one before, hexadecimal.
        wanted: String,
    },
    /// A commitment is dated before the one that it follows.
    #[error("commitment {sequence} is dated {earlier} us before the one that it follows")]
    BackDated {
        /// Place of the commitment in the chain.
        sequence: u64,
        /// By how many microseconds.
        earlier: u64,
    },
    /// The nonce is not the one that was committed to.
    #[error("this nonce is not the one that was committed to")]
    WrongOpening,
}
