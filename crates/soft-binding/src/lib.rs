//! Soft bindings of content credentials (C2PA): the name of the watermark, and a value that names the key and seals the
//! message, so that who has the key finds credentials by a mark, and who has not learns no bit of it.
//!
//! A value is the base64 of `key id [16] | tag [16] | sealed message [ceil(bits / 8)]`. The tag is an HMAC-SHA256 over the
//! message, and the message is sealed with a pad that follows from the tag (a synthetic initialisation vector, as in
//! RFC 5297): the same key and message always give the same value, so that it can be looked up.
pub mod resolution;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
pub use guardsplat_codeword::Message;
use guardsplat_codeword::MessageLength;
use hmac::{Hmac, Mac as _};
use sha2::Sha256;

/// The name of the watermark in `alg`, as the C2PA's list of soft binding algorithms has names. It is not on that list.
pub const ALGORITHM: &str = "org.guardsplat.sh.1";

/// Bytes of a key's id.
const ID: usize = 16;
/// Bytes of the tag.
const TAG: usize = 16;
/// Longest base64 of a value: of 150 bits.
const MAX_TEXT: usize = (ID + TAG + 19).div_ceil(3) * 4;

/// Why a value is none.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// Not base64, or of another length than values have.
    #[error("the value of the soft binding is not one of {ALGORITHM}: {0}")]
    NotAValue(&'static str),
    /// A key's id that is not 32 hexadecimal digits.
    #[error("{0:?} is not the id of a key")]
    KeyId(String),
}

/// A key's id and its 32 secret bytes.
#[derive(Clone, Copy)]
pub struct BindingKey<'a> {
    /// As reports have it: 32 hexadecimal digits.
    pub id: &'a str,
    /// What the key is made from.
    pub secret: &'a [u8; 32],
}

/// The value of a soft binding.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Value {
    key_id: [u8; ID],
    tag: [u8; TAG],
    sealed: Vec<u8>,
}

impl Value {
    /// The value of a message under a key.
    ///
    /// # Errors
    /// [`Error::KeyId`].
    pub fn seal(key: BindingKey<'_>, message: &Message) -> Result<Self, Error> {
        let bytes = bytes_of(message);
        let tag = tag_of(key, message.len(), &bytes);
        Ok(Self {
            key_id: id_bytes(key.id)?,
            tag,
            sealed: padded(key, &tag, &bytes),
        })
    }

    /// Reads the base64 that a manifest has.
    ///
    /// # Errors
    /// [`Error::NotAValue`].
    pub fn parse(text: &str) -> Result<Self, Error> {
        if text.len() > MAX_TEXT {
            return Err(Error::NotAValue("it is too long"));
        }
        let bytes = BASE64_STANDARD
            .decode(text)
            .map_err(|_| Error::NotAValue("it is not base64"))?;
        let short = Error::NotAValue("it is too short");
        let (key_id, rest) = bytes.split_first_chunk::<ID>().ok_or(short.clone())?;
        let (tag, sealed) = rest.split_first_chunk::<TAG>().ok_or(short.clone())?;
        if sealed.is_empty() {
            return Err(short);
        }
        Ok(Self {
            key_id: *key_id,
            tag: *tag,
            sealed: sealed.to_vec(),
        })
    }

    /// The base64 that a manifest has.
    pub fn text(&self) -> String {
        BASE64_STANDARD.encode([&self.key_id, &self.tag, &self.sealed[..]].concat())
    }

    /// The id of the key: 32 hexadecimal digits.
    pub fn key_id(&self) -> String {
        hex::encode(self.key_id)
    }

    /// The message of `bits` bits, if it was sealed with this key.
    pub fn open(&self, key: BindingKey<'_>, bits: usize) -> Option<Message> {
        let length = MessageLength::new(bits).ok()?;
        if hex::encode(self.key_id) != key.id || self.sealed.len() != bits.div_ceil(8) {
            return None;
        }
        let bytes = padded(key, &self.tag, &self.sealed);
        mac(key, b"authenticate", &parts(length.bits() as usize, &bytes))
            .verify_truncated_left(&self.tag)
            .ok()?;
        let bit = |position: usize| bytes[position / 8] >> (7 - position % 8) & 1 == 1;
        Message::from_bits(&(0..bits).map(bit).collect::<Vec<_>>()).ok()
    }
}

fn id_bytes(id: &str) -> Result<[u8; ID], Error> {
    let mut bytes = [0; ID];
    hex::decode_to_slice(id, &mut bytes).map_err(|_| Error::KeyId(id.into()))?;
    Ok(bytes)
}

/// The bits of a message, most significant first; what is left of the last byte is 0.
fn bytes_of(message: &Message) -> Vec<u8> {
    let mut bytes = vec![0; message.len().div_ceil(8)];
    for (position, bit) in message.bits().enumerate() {
        bytes[position / 8] |= u8::from(bit) << (7 - position % 8);
    }
    bytes
}

/// What is authenticated: the number of bits, at most 150, and the bits.
fn parts(bits: usize, bytes: &[u8]) -> Vec<u8> {
    [&[bits as u8], bytes].concat()
}

fn tag_of(key: BindingKey<'_>, bits: usize, bytes: &[u8]) -> [u8; TAG] {
    let full: [u8; 32] = mac(key, b"authenticate", &parts(bits, bytes))
        .finalize()
        .into_bytes()
        .into();
    let mut tag = [0; TAG];
    tag.copy_from_slice(&full[..TAG]);
    tag
}

/// `bytes`, at most 32, with the pad of this tag put on or taken off.
fn padded(key: BindingKey<'_>, tag: &[u8; TAG], bytes: &[u8]) -> Vec<u8> {
    let pad: [u8; 32] = mac(key, b"seal", tag).finalize().into_bytes().into();
    bytes.iter().zip(pad).map(|(byte, pad)| byte ^ pad).collect()
}

/// An HMAC over `data`, under a key of its own for each use.
fn mac(key: BindingKey<'_>, what: &[u8], data: &[u8]) -> Hmac<Sha256> {
    let begin = |secret: &[u8; 32]| <Hmac<Sha256> as hmac::KeyInit>::new(&block(secret));
    let mut derived = begin(key.secret);
    derived.update(b"guardsplat soft binding v1 ");
    derived.update(what);
    let mut mac = begin(&derived.finalize().into_bytes().into());
    mac.update(data);
    mac
}

/// A key of HMAC as long as a block of SHA-256, which is what shorter ones are filled up to.
fn block(secret: &[u8; 32]) -> hmac::digest::Key<Hmac<Sha256>> {
    let mut block = hmac::digest::Key::<Hmac<Sha256>>::default();
    block[..32].copy_from_slice(secret);
    block
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const KEY: BindingKey<'_> = BindingKey {
        id: "00112233445566778899aabbccddeeff",
        secret: &[7; 32],
    };

    fn message(text: &str, bits: usize) -> Message {
        Message::parse(text, bits).unwrap()
    }

    #[test]
    fn a_value_stays_what_it_is() {
        // What manifests hold that were handed out must be found again by every later version.
        let value = Value::seal(KEY, &message("c0ffee42", 32)).unwrap();
        assert_eq!(value.text(), "ABEiM0RVZneImaq7zN3u/26/lQiL7oK86zTNnhnW0FUnSul2");
        assert_eq!(Value::parse(&value.text()).unwrap(), value);
        assert_eq!(value.key_id(), KEY.id);
    }

    #[test]
    fn other_keys_and_other_lengths_open_nothing() {
        let value = Value::seal(KEY, &message("c0ffee42", 32)).unwrap();
        assert_eq!(value.open(KEY, 32), Some(message("c0ffee42", 32)));
        assert_eq!(value.open(KEY, 31), None);
        assert_eq!(value.open(KEY, 0), None);
        let secret = &[8; 32];
        assert_eq!(value.open(BindingKey { secret, ..KEY }, 32), None);
        let id = "00112233445566778899aabbccddeefe";
        assert_eq!(value.open(BindingKey { id, ..KEY }, 32), None);
        let bad = BindingKey { id: "website", ..KEY };
        assert_eq!(Value::seal(bad, &message("0", 1)), Err(Error::KeyId("website".into())));
    }

    #[test]
    fn a_message_shows_in_no_bit_of_its_value() {
        // Neighbouring messages differ everywhere: about half of the bits of tag and sealed message.
        let of = |text| Value::seal(KEY, &message(text, 64)).unwrap();
        let (one, other) = (of("0000000000000000"), of("0000000000000001"));
        let differ = |a: &[u8], b: &[u8]| a.iter().zip(b).map(|(a, b)| (a ^ b).count_ones()).sum::<u32>();
        assert!((40..=88).contains(&differ(&one.tag, &other.tag)));
        assert!((14..=50).contains(&differ(&one.sealed, &other.sealed)));
    }

    proptest! {
        #[test]
        fn what_was_sealed_is_opened(bits in prop::collection::vec(any::<bool>(), 1..=150)) {
            let message = Message::from_bits(&bits).unwrap();
            let value = Value::seal(KEY, &message).unwrap();
            prop_assert!(value.text().len() <= MAX_TEXT);
            let read = Value::parse(&value.text()).unwrap();
            prop_assert_eq!(read.open(KEY, bits.len()), Some(message));
        }

        #[test]
        fn a_strangers_value_is_refused_or_opens_nothing(text in "[A-Za-z0-9+/=]{0,90}", bits in 0_usize..200) {
            if let Ok(value) = Value::parse(&text) {
                prop_assert_eq!(value.open(KEY, bits), None);
            }
        }
    }
}
