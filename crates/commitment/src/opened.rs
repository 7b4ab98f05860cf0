//! A commitment that was opened, as a JSON document for somebody who is to check it: what was signed, and what it hid.
use secrecy::zeroize::Zeroizing;
use serde::{Deserialize, Serialize};

use crate::document::Kind;
use crate::{
    BLINDING_BYTES, Document, Error, MAX_DOCUMENT_BYTES, NONCE_BYTES, OPENING_BYTES, Opening, PublicKey, Result,
};

/// What says that a document is one of these.
const FORMAT: &str = "guardsplat.opened-commitment";
/// The version that is made and read here.
const VERSION: u8 = 1;

/// A signed commitment with the nonce and the blinding that it hid. Whoever has it can compute the asset's word.
#[derive(Debug)]
pub struct OpenedDocument {
    /// The commitment, as it is exported.
    pub document: Document,
    /// What it hid.
    pub opening: Opening,
}

/// The document's fields. Bytes are hexadecimal.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Fields {
    format: String,
    version: u64,
    /// As [`Document`] has it.
    commitment: serde_json::Value,
    nonce: String,
    blinding: String,
}

impl OpenedDocument {
    /// Whether a text says of itself that it is one of these.
    pub fn is_one(text: &str) -> bool {
        let kind: std::result::Result<Kind, _> = serde_json::from_str(text);
        text.len() <= MAX_DOCUMENT_BYTES && kind.is_ok_and(|kind| kind.format == FORMAT)
    }

    /// The document as JSON text.
    ///
    /// # Errors
    /// `NotADocument`, which no commitment gives.
    pub fn to_json(&self) -> Result<String> {
        let not = |error: serde_json::Error| Error::NotADocument(error.to_string());
        let fields = Fields {
            format: FORMAT.into(),
            version: VERSION.into(),
            commitment: serde_json::from_str(&self.document.to_json()?).map_err(not)?,
            nonce: hex::encode(self.opening.nonce()),
            blinding: hex::encode(self.opening.blinding()),
        };
        Ok(serde_json::to_string_pretty(&fields).map_err(not)? + "\n")
    }

    /// Reads a document. That it can be read says nothing of it: see [`Self::verify`].
    ///
    /// # Errors
    /// `NotADocument`, `UnknownVersion`, `Field`, `NotAPublicKey`.
    pub fn from_json(text: &str) -> Result<Self> {
        Kind::check(text, FORMAT, VERSION)?;
        let not = |error: serde_json::Error| Error::NotADocument(error.to_string());
        let fields: Fields = serde_json::from_str(text).map_err(not)?;
        let mut bytes = Zeroizing::new([0; OPENING_BYTES]);
        let (nonce, blinding) = bytes.split_at_mut(NONCE_BYTES);
        read("nonce", &fields.nonce, nonce)?;
        read("blinding", &fields.blinding, blinding)?;
        Ok(Self {
            document: Document::from_json(&fields.commitment.to_string())?,
            opening: Opening::new(bytes.as_slice())?,
        })
    }

    /// Checks the signature with a key that is trusted, and that nonce and blinding are those that were committed to.
    ///
    /// # Errors
    /// `OtherKey`, `BadSignature`, `WrongOpening`.
    pub fn verify(&self, trusted: &PublicKey) -> Result<()> {
        self.document.verify(trusted)?;
        self.document.signed.commitment.opens_with(&self.opening)
    }
}

// Two fields, one after the other, are all that an opening is.
const _: () = assert!(NONCE_BYTES + BLINDING_BYTES == OPENING_BYTES);

fn read(field: &'static str, digits: &str, to: &mut [u8]) -> Result<()> {
    let one_spelling = digits.bytes().all(|b| !b.is_ascii_uppercase());
    if one_spelling && hex::decode_to_slice(digits, to).is_ok() {
        return Ok(());
    }
    Err(Error::Field {
        field,
        reason: format!("must be {} hexadecimal digits in lower case", 2 * to.len()),
    })
}
