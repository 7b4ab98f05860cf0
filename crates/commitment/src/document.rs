//! A commitment as a JSON document that stands for itself: all that is signed, and what it is checked with.
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use crate::{Commitment, Error, PublicKey, Result, SIGNATURE_BYTES, Signed, VERSION};

/// What says that a document is one of these.
const FORMAT: &str = "guardsplat.commitment";

/// Longest document that is read; all of them are far shorter.
pub const MAX_DOCUMENT_BYTES: usize = 16 << 10;

/// A signed commitment, and the public key that it names.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Document {
    /// The commitment.
    pub signed: Signed,
    /// The key that it says it was signed with. It proves nothing by itself: anybody can sign with a key of their own.
    pub public_key: PublicKey,
}

/// The document's fields. Bytes are hexadecimal, names those of the API.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Fields {
    format: String,
    version: u64,
    name: String,
    sequence: u64,
    previous: String,
    asset: String,
    owner: String,
    sha256: String,
    key: String,
    payload: u64,
    nonce_hash: String,
    time_micros: i64,
    canonical: String,
    hash: String,
    signature: String,
    public_key: String,
}

/// What alone is read first, as the rest depends on it.
#[derive(Deserialize)]
pub(crate) struct Kind {
    pub format: String,
    version: u64,
}

impl Kind {
    /// Sees that a text is a document of `format` in the one `version` that is known.
    pub fn check(text: &str, format: &str, version: u8) -> Result<()> {
        if text.len() > MAX_DOCUMENT_BYTES {
            let reason = format!("it has {} bytes, at most {MAX_DOCUMENT_BYTES} are read", text.len());
            return Err(Error::NotADocument(reason));
        }
        let kind: Self = serde_json::from_str(text).map_err(|error| Error::NotADocument(error.to_string()))?;
        if kind.format != format {
            return Err(Error::Field {
                field: "format",
                reason: format!("must be {format}"),
            });
        }
        if kind.version != u64::from(version) {
            return Err(Error::UnknownVersion {
                found: kind.version,
                known: version,
            });
        }
        Ok(())
    }
}

impl Document {
    /// The document as JSON text.
    ///
    /// # Errors
    /// `NotADocument`, which no commitment gives.
    pub fn to_json(&self) -> Result<String> {
        let Commitment {
            sequence,
            previous,
            id,
            asset,
            owner,
            sha256,
            key,
            payload,
            nonce_hash,
            time,
        } = &self.signed.commitment;
        let fields = Fields {
            format: FORMAT.into(),
            version: VERSION.into(),
            name: format!("commitments/{id}"),
            sequence: *sequence,
            previous: hex::encode(previous),
            asset: format!("assets/{asset}"),
            owner: format!("owners/{owner}"),
            sha256: hex::encode(sha256),
            key: format!("keys/{key}"),
            payload: *payload,
            nonce_hash: hex::encode(nonce_hash),
            time_micros: *time,
            canonical: hex::encode(self.signed.commitment.canonical()),
            hash: hex::encode(self.signed.hash()),
            signature: hex::encode(self.signed.signature),
            public_key: self.public_key.to_hex(),
        };
        let json = serde_json::to_string_pretty(&fields).map_err(|error| Error::NotADocument(error.to_string()))?;
        Ok(json + "\n")
    }

    /// Reads a document. That it can be read says nothing of its signature: see [`Self::verify`].
    ///
    /// # Errors
    /// `NotADocument`, `UnknownVersion`, `Field`, `NotAPublicKey`.
    pub fn from_json(text: &str) -> Result<Self> {
        Kind::check(text, FORMAT, VERSION)?;
        let not = |error: serde_json::Error| Error::NotADocument(error.to_string());
        let fields: Fields = serde_json::from_str(text).map_err(not)?;
        let commitment = Commitment {
            sequence: fields.sequence,
            previous: bytes("previous", &fields.previous)?,
            id: id("name", "commitments/", &fields.name)?,
            asset: id("asset", "assets/", &fields.asset)?,
            owner: id("owner", "owners/", &fields.owner)?,
            sha256: bytes("sha256", &fields.sha256)?,
            key: id("key", "keys/", &fields.key)?,
            payload: fields.payload,
            nonce_hash: bytes("nonce_hash", &fields.nonce_hash)?,
            time: fields.time_micros,
        };
        // Both follow from the rest; a document that says otherwise would be read as one thing and checked as another.
        follows("canonical", &fields.canonical, &commitment.canonical())?;
        follows("hash", &fields.hash, &commitment.hash())?;
        let signature: [u8; SIGNATURE_BYTES] = bytes("signature", &fields.signature)?;
        Ok(Self {
            signed: Signed { commitment, signature },
            public_key: PublicKey::from_bytes(&bytes::<{ PublicKey::BYTES }>("public_key", &fields.public_key)?)?,
        })
    }

    /// Checks the signature with a key that is trusted, because it was got from elsewhere than the document.
    ///
    /// # Errors
    /// `OtherKey`, `BadSignature`.
    pub fn verify(&self, trusted: &PublicKey) -> Result<()> {
        if self.public_key != *trusted {
            return Err(Error::OtherKey {
                found: self.public_key.to_hex(),
                trusted: trusted.to_hex(),
            });
        }
        self.signed.verify(trusted)
    }
}

fn bytes<const N: usize>(field: &'static str, digits: &str) -> Result<[u8; N]> {
    let mut bytes = [0; N];
    let read = hex::decode_to_slice(digits, &mut bytes).is_ok();
    // One spelling only, so that equal commitments are equal texts.
    if read && hex::encode(bytes) == digits {
        return Ok(bytes);
    }
    Err(Error::Field {
        field,
        reason: format!("must be {} hexadecimal digits in lower case", 2 * N),
    })
}

fn id(field: &'static str, collection: &str, name: &str) -> Result<Uuid> {
    let id = name
        .strip_prefix(collection)
        .and_then(|text| Some((text, Uuid::try_parse(text).ok()?)))
        .filter(|(text, id)| id.hyphenated().encode_lower(&mut Uuid::encode_buffer()) == *text);
    id.map(|(_, id)| id).ok_or_else(|| Error::Field {
        field,
        reason: format!("must be {collection} and a UUID in lower case"),
    })
}

fn follows(field: &'static str, digits: &str, wanted: &[u8]) -> Result<()> {
    if digits == hex::encode(wanted) {
        return Ok(());
    }
    Err(Error::Field {
        field,
        reason: "is not what follows from the other fields".into(),
    })
}
