//! Opaque tokens, for pages and for watching: versioned, bound to what they were made for, and checked.
//!
//! A token is no secret and gives no rights. The check is there so that a token that was cut, changed or taken from
//! another query is told apart, instead of quietly giving other results.
use sha2::{Digest, Sha256};

const VERSION: u8 = 1;
const CHECK_BYTES: usize = 12;

/// A token for `payload`, good for `purpose` only.
pub fn seal(purpose: &[&[u8]], payload: &[u8]) -> String {
    let mut bytes = vec![VERSION];
    bytes.extend_from_slice(payload);
    bytes.extend_from_slice(&check(purpose, payload));
    hex::encode(bytes)
}

/// The payload of a token made by [`seal`] for the same purpose.
pub fn open<const N: usize>(purpose: &[&[u8]], token: &str) -> Option<[u8; N]> {
    // The length is compared first, so that a long text costs nothing.
    if token.len() != 2 * (1 + N + CHECK_BYTES) {
        return None;
    }
    let bytes = hex::decode(token).ok()?;
    let (version, rest) = bytes.split_first()?;
    let (payload, sum) = rest.split_at_checked(N)?;
    // Case is checked too: one token has one spelling.
    let valid = *version == VERSION && sum == check(purpose, payload) && token == hex::encode(&bytes);
    valid.then(|| payload.try_into().ok()).flatten()
}

fn check(purpose: &[&[u8]], payload: &[u8]) -> [u8; CHECK_BYTES] {
    let mut hash = Sha256::new();
    hash.update([VERSION]);
    for part in purpose.iter().chain([&payload]) {
        hash.update((part.len() as u64).to_be_bytes());
        hash.update(part);
    }
    let digest = hash.finalize();
    std::array::from_fn(|i| digest[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_token_opens_for_its_purpose_only() {
        let token = seal(&[b"jobs", b"a"], &[1, 2, 3]);
        assert_eq!(open(&[b"jobs", b"a"], &token), Some([1, 2, 3]));
        assert_eq!(open::<3>(&[b"jobs", b"b"], &token), None);
        assert_eq!(open::<3>(&[b"jobsa"], &token), None);
        assert_eq!(open::<2>(&[b"jobs", b"a"], &token), None);
    }

    #[test]
    fn no_changed_digit_goes_unnoticed() {
        let token = seal(&[b"x"], &[7; 8]);
        for i in 0..token.len() {
            let mut changed = token.clone().into_bytes();
            changed[i] = if changed[i] == b'0' { b'1' } else { b'0' };
            assert_eq!(
                open::<8>(&[b"x"], std::str::from_utf8(&changed).unwrap()),
                None,
                "digit {i}"
            );
        }
        assert_eq!(open::<8>(&[b"x"], &token[2..]), None);
        assert_eq!(open::<8>(&[b"x"], &token.to_uppercase()), None);
        assert_eq!(open::<8>(&[b"x"], &"é".repeat(token.len() / 2)), None);
        assert_eq!(open::<8>(&[b"x"], ""), None);
    }
}
