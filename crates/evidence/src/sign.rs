//! Signing: Ed25519 over the hash of the canonical JSON, and over the hash of the page.
use crate::error::Result;
use crate::evidence::Evidence;
use crate::hash::{Sha256, bytes_of_hex};
use crate::html;
use crate::json::{SignedFile, canonical};
use crate::signature::Signature;
use ed25519_dalek::{Signer, SigningKey, VerifyingKey};

/// The only algorithm.
const ALGORITHM: &str = "ed25519";
/// What stands around the signature of a page, which is its last line.
const PAGE_START: &str = "<!-- page signature ed25519 ";
const PAGE_END: &str = " -->";

/// Both documents of a report.
#[derive(Clone, Debug, PartialEq)]
pub struct Signed {
    /// `{"evidence":…,"signature":…}`, canonical.
    pub json: String,
    /// The page: the same JSON, the pictures, and all of it in words.
    pub html: String,
}

/// Which of the two documents a signature is for, so that one never passes as the other.
#[derive(Clone, Copy)]
enum Part {
    Json,
    Page,
}

/// Signs a report with a key of the service. Pictures that have their bytes are inside the page.
///
/// The JSON's signature is over the ASCII text `guardsplat evidence 1 json sha256:` and the SHA-256, in lower-case
/// hexadecimal, of the canonical JSON of the evidence ([`Evidence::to_json`]). The page's is over
/// `guardsplat evidence 1 page sha256:` and that of all its bytes before the last line, which holds it. Ed25519 is
/// deterministic (RFC 8032): the same report and key give the same bytes.
///
/// # Errors
/// [`crate::Error::BadField`], [`crate::Error::TooLarge`].
pub fn sign(evidence: &Evidence, key: &SigningKey) -> Result<Signed> {
    let signature = Signature {
        algorithm: ALGORITHM.into(),
        public_key: hex::encode(key.verifying_key().as_bytes()),
        value: signed_value(key, Part::Json, evidence.to_json()?.as_bytes()),
    };
    let evidence = evidence.clone();
    let file = SignedFile { evidence, signature };
    let json = canonical(&file)?;
    let mut html = html::page(&file.evidence, &json, Some(&file.signature));
    let value = signed_value(key, Part::Page, html.as_bytes());
    html += &format!("{PAGE_START}{value}{PAGE_END}\n");
    Ok(Signed { json, html })
}

impl Evidence {
    /// The page of a report that nobody signed, which it says.
    ///
    /// # Errors
    /// As [`sign`].
    pub fn to_html(&self) -> Result<String> {
        Ok(html::page(self, &self.to_json()?, None))
    }
}

impl Signature {
    /// Whose signature it says that it is; `None` for what is no public key or another algorithm.
    pub fn signer(&self) -> Option<VerifyingKey> {
        let bytes = bytes_of_hex(&self.public_key).filter(|_| self.algorithm == ALGORITHM)?;
        VerifyingKey::from_bytes(&bytes).ok()
    }

    /// Whether `signer` signed this canonical JSON.
    pub fn is_of_json(&self, json: &str, signer: &VerifyingKey) -> bool {
        is_signed(&self.value, Part::Json, json.as_bytes(), signer)
    }
}

/// Whether `signer` signed this page, up to white space at its end.
pub(crate) fn is_signed_page(html: &str, signer: &VerifyingKey) -> bool {
    let signed = html.trim_end().strip_suffix(PAGE_END);
    let parts = signed.and_then(|text| text.rsplit_once(PAGE_START));
    parts.is_some_and(|(page, value)| is_signed(value, Part::Page, page.as_bytes(), signer))
}

fn signed_value(key: &SigningKey, part: Part, document: &[u8]) -> String {
    hex::encode(key.sign(statement(part, document).as_bytes()).to_bytes())
}

fn is_signed(value: &str, part: Part, document: &[u8], signer: &VerifyingKey) -> bool {
    let value = bytes_of_hex::<64>(value).map(|bytes| ed25519_dalek::Signature::from_bytes(&bytes));
    // Strict: no second signature for the same document, and none by keys of small order.
    value.is_some_and(|value| {
        signer
            .verify_strict(statement(part, document).as_bytes(), &value)
            .is_ok()
    })
}

/// What is signed.
fn statement(part: Part, document: &[u8]) -> String {
    let part = match part {
        Part::Json => "json",
        Part::Page => "page",
    };
    format!("guardsplat evidence 1 {part} sha256:{}", Sha256::of(document))
}
