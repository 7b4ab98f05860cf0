//! Identities: hashes over what identifies a record, never over what was measured.
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// Bytes of the hash that are kept; enough that a billion records do not collide.
const BYTES: usize = 16;

/// Identity of a record: the first 16 bytes of a SHA-256, in hexadecimal.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Id(String);

impl Id {
    /// The digits, 32 of them.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl std::fmt::Display for Id {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

/// Gathers what identifies a record.
pub(super) struct Identity(Sha256);

impl Identity {
    /// Of a record of this kind; kinds never share identities.
    pub fn of(kind: &str) -> Self {
        Self(Sha256::new()).text(kind)
    }

    /// Adds a text. Its length goes first, so that no two lists of texts read the same.
    pub fn text(mut self, text: &str) -> Self {
        self.0.update((text.len() as u64).to_le_bytes());
        self.0.update(text);
        self
    }

    /// Adds a list of texts; its length goes first.
    pub fn texts<'a>(self, texts: impl ExactSizeIterator<Item = &'a str>) -> Self {
        let start = self.number(texts.len() as u64);
        texts.fold(start, Identity::text)
    }

    /// Adds a number.
    pub fn number(mut self, number: u64) -> Self {
        self.0.update(number.to_le_bytes());
        self
    }

    /// The identity.
    pub fn id(self) -> Id {
        let mut digits = hex::encode(self.0.finalize());
        digits.truncate(2 * BYTES);
        Id(digits)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_do_not_run_into_each_other() {
        let of = |texts: &[&str]| Identity::of("mark").texts(texts.iter().copied()).id();
        assert_ne!(of(&["ab", "c"]), of(&["a", "bc"]));
        assert_ne!(of(&["a"]), of(&["a", ""]));
        assert_eq!(of(&["a", "b"]), of(&["a", "b"]));
        assert_eq!(of(&[]).as_str().len(), 32);
    }

    #[test]
    fn identities_stay_the_same_between_releases() {
        // SHA-256 of the length 4 as 8 little-endian bytes, then "mark".
        assert_eq!(Identity::of("mark").id().as_str(), "d5097da552f28dab4e6ddede0c450569");
    }
}
