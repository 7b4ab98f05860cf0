//! Keys: the secret, the decoder trained for it and the CLIP that both belong to; their files, and how they are made.
mod create;
mod create_hidden;
mod file;
pub mod natural_images;

use std::fmt;
use std::path::Path;

use guardsplat_distortion::RobustTo;
use rand::TryRng;
use rand::rngs::SysRng;
use serde::{Deserialize, Serialize};

pub use create::{KeyProgress, create_key};
pub use create_hidden::{HIDDEN, HiddenKeyOptions, create_hidden_key};
pub use file::MAX_BYTES as MAX_KEY_BYTES;

use crate::error::{Error, Result};
use crate::message::decoder::DecoderWeights;
use crate::message::projection::Projection;
use crate::message::tokens::{TokenTable, fewest_bits_per_token, hmac_sha256};
use crate::message::training::TrainingOptions;
use guardsplat_codeword::{Message, MessageCode, MessageLength};

/// Which CLIP a key belongs to; for keys that read pictures without one, how their decoder is made.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClipIdentity {
    /// Its name, for people.
    pub name: String,
    /// SHA-256 of its weights in hexadecimal; what counts.
    pub hash: String,
}

/// What a key is made from, besides a CLIP.
#[derive(Clone, Debug, PartialEq)]
pub struct KeyOptions {
    /// Bits of its messages, 1 to [`MAX_BITS`](guardsplat_codeword::MAX_BITS).
    pub bits: usize,
    /// Puts messages into words of 64 bits ([`MessageCode`]), of which a fifth may be read wrong; for messages of up to 16.
    pub coded: bool,
    /// Bits that one CLIP token stands for; `None` takes the fewest that make room.
    pub bits_per_token: Option<usize>,
    /// Makes the key reproducible, and only as secret as the seed; `None` asks the operating system for a secret.
    pub seed: Option<u64>,
    /// Distortions of natural pictures that the projection is to stand: what they do to features is variation like
    /// any other.
    pub robust_to: RobustTo,
    /// How to train the decoder; its own seed is replaced.
    pub training: TrainingOptions,
}

impl KeyOptions {
    /// Bits of what is embedded.
    pub fn word_bits(&self) -> usize {
        match self.coded {
            true => MessageLength::CODED.bits() as usize,
            false => self.bits,
        }
    }

    /// Bits a token, as asked for or the fewest that make room.
    pub fn bits_per_token(&self) -> usize {
        self.bits_per_token.unwrap_or(fewest_bits_per_token(self.word_bits()))
    }
}

/// 32 secret bytes that do not show up in logs.
#[derive(Clone, PartialEq, Eq)]
pub struct Secret([u8; 32]);

impl Secret {
    /// These bytes.
    pub fn new(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }

    /// A secret from the operating system's random numbers.
    pub fn random() -> Result<Self> {
        let mut bytes = [0; 32];
        SysRng.try_fill_bytes(&mut bytes).map_err(|e| Error::BadOption {
            field: "seed",
            reason: format!("the operating system has no random numbers ({e}); give a seed"),
        })?;
        Ok(Self(bytes))
    }

    /// The secret of a seed: as easy to guess as the seed.
    pub fn from_seed(seed: u64) -> Self {
        Self(hmac_sha256(b"guardsplat key secret v1", &[&seed.to_le_bytes()]))
    }

    /// The secret of a seed, or a random one without a seed.
    ///
    /// # Errors
    /// Those of [`Secret::random`].
    fn draw(seed: Option<u64>) -> Result<Self> {
        seed.map_or_else(Self::random, |seed| Ok(Self::from_seed(seed)))
    }

    /// A seed that follows from the secret; `label` tells the uses apart.
    fn derived_seed(&self, label: &[u8]) -> u64 {
        let [a, b, c, d, e, f, g, h, ..] = hmac_sha256(&self.0, &[label]);
        u64::from_le_bytes([a, b, c, d, e, f, g, h])
    }

    /// The bytes, for who may have them.
    pub fn expose(&self) -> &[u8; 32] {
        &self.0
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret(..)")
    }
}

/// How a key's messages are read from pictures.
#[derive(Clone, Debug, PartialEq)]
pub enum Decoding {
    /// From CLIP's features of a picture.
    Clip {
        /// What happens to features before the decoder.
        projection: Projection,
        /// The decoder.
        decoder: DecoderWeights,
    },
    /// By a convolutional decoder from the picture itself.
    Hidden(guardsplat_hidden::Weights),
}

/// What embedding and extraction need besides a scene and a CLIP.
#[derive(Clone, Debug, PartialEq)]
pub struct Key {
    /// Decides which tokens stand for which bits.
    pub secret: Secret,
    /// The seed that the secret came from, if it did.
    pub seed: Option<u64>,
    /// Bits of its messages, where they are put into longer words ([`MessageCode`]); `None` where a message is embedded bit by
    /// bit.
    pub coded_bits: Option<usize>,
    /// Bits that one CLIP token stands for.
    pub bits_per_token: usize,
    /// The CLIP whose features the decoder reads.
    pub clip: ClipIdentity,
    /// How messages are read.
    pub decoding: Decoding,
    /// Share of right bits on text features of messages not seen in training; `None` for lengths of so few messages
    /// that none could be kept apart. Of a convolutional decoder: in pictures that it did not see.
    pub accuracy_unseen: Option<f64>,
    /// The same under the noise of the training; of a convolutional decoder: in pictures that were turned, zoomed and
    /// moved.
    pub accuracy_unseen_noisy: Option<f64>,
}

impl Key {
    /// Bits of its messages.
    pub fn bits(&self) -> usize {
        self.coded_bits.unwrap_or_else(|| self.word_bits())
    }

    /// Bits of what is embedded, and read from pictures.
    pub fn word_bits(&self) -> usize {
        match &self.decoding {
            Decoding::Clip { decoder, .. } => decoder.bits(),
            Decoding::Hidden(weights) => weights.bits(),
        }
    }

    /// How its messages become words, and are read from logits.
    ///
    /// # Errors
    /// Coded messages of a length that is not coded.
    pub fn message_code(&self) -> Result<MessageCode> {
        let Some(bits) = self.coded_bits else {
            return Ok(MessageCode::Plain);
        };
        Ok(MessageCode::coded(
            bits,
            self.secret.derived_seed(b"guardsplat word pad v1"),
        )?)
    }

    /// 32 hexadecimal digits that name the key and give nothing of the secret away: an HMAC over everything in it.
    pub fn id(&self) -> String {
        let bits = (self.bits() as u64).to_le_bytes();
        let tensors: Vec<Vec<u8>> = file::tensors(self).iter().map(file::Named::little_endian).collect();
        let mut parts: Vec<&[u8]> = vec![b"guardsplat key id v1", &bits, self.clip.hash.as_bytes()];
        // Keys of one bit a token came first, and keep their names.
        let per_token = [self.bits_per_token as u8];
        if self.bits_per_token != 1 {
            parts.extend([b" bits a token ".as_slice(), &per_token]);
        }
        let word_bits = (self.word_bits() as u64).to_le_bytes();
        if self.coded_bits.is_some() {
            parts.extend([b" in words of ".as_slice(), &word_bits]);
        }
        parts.extend(tensors.iter().map(Vec::as_slice));
        hex::encode(&hmac_sha256(self.secret.expose(), &parts)[..16])
    }

    /// The key's token table.
    pub fn tokens(&self) -> Result<TokenTable> {
        TokenTable::new(self.secret.expose(), self.word_bits(), self.bits_per_token)
    }

    /// Parses a message of the key's length from hexadecimal.
    pub fn message(&self, text: &str) -> Result<Message> {
        Ok(Message::parse(text, self.bits())?)
    }

    /// Fails unless the key belongs to the CLIP with these weights; `path` is the key's file, for the message.
    pub fn require_clip(&self, path: &Path, clip: &ClipIdentity) -> Result<()> {
        if self.clip.hash == clip.hash {
            return Ok(());
        }
        let short = |hash: &str| hash.chars().take(12).collect::<String>();
        Err(Error::BadKey {
            path: path.into(),
            reason: format!(
                "it belongs to the CLIP {:?} ({}), not to {:?} ({})",
                self.clip.name,
                short(&self.clip.hash),
                clip.name,
                short(&clip.hash)
            ),
        })
    }

    /// Writes the key file, readable by its owner only; a file that is there is replaced whole, or not at all.
    pub fn write(&self, path: &Path) -> Result<()> {
        file::write(self, path)
    }

    /// Reads a key file and checks every part of it. Damage of any kind is [`Error::BadKey`].
    pub fn read(path: &Path) -> Result<Self> {
        file::read(path)
    }

    /// The bytes of the key file. They hold the secret.
    pub fn to_bytes(&self) -> Result<Vec<u8>> {
        file::serialize(self).map_err(|reason| Error::BadKey {
            path: self.id().into(),
            reason,
        })
    }

    /// A key from the bytes of its file, checked as [`Key::read`] does; `name` is for messages.
    pub fn from_bytes(name: &str, bytes: &[u8]) -> Result<Self> {
        file::deserialize(bytes).map_err(|reason| Error::BadKey {
            path: name.into(),
            reason,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(seed: Option<u64>) -> Key {
        Key {
            secret: Secret::draw(seed).unwrap(),
            seed,
            coded_bits: None,
            bits_per_token: fewest_bits_per_token(8),
            clip: ClipIdentity {
                name: "tiny".into(),
                hash: "ab".repeat(32),
            },
            decoding: Decoding::Clip {
                projection: Projection::identity(8),
                decoder: DecoderWeights::seeded(8, 8, 1),
            },
            accuracy_unseen: None,
            accuracy_unseen_noisy: None,
        }
    }

    #[test]
    fn a_seed_decides_the_secret_and_no_seed_is_always_another() {
        let (a, b) = (key(Some(1)), key(Some(1)));
        assert_eq!(a, b);
        assert_eq!(a.id(), b.id());
        assert_ne!(key(Some(2)).id(), a.id());
        assert_ne!(key(None).secret, key(None).secret);
        let seed = |label: &[u8]| a.secret.derived_seed(label);
        assert_ne!(seed(b"one"), seed(b"two"));
    }

    #[test]
    fn another_clip_is_an_error_that_names_both() {
        let key = key(Some(1));
        let path = Path::new("mine.key");
        key.require_clip(path, &key.clip).unwrap();
        let other = ClipIdentity {
            name: "large".into(),
            hash: "cd".repeat(32),
        };
        let text = key.require_clip(path, &other).unwrap_err().to_string();
        let expected = r#"belongs to the CLIP "tiny" (abababababab), not to "large" (cdcdcdcdcdcd)"#;
        assert!(text.starts_with("key mine.key: ") && text.ends_with(expected), "{text}");
    }

    #[test]
    fn secrets_are_not_printed_and_messages_have_the_keys_length() {
        let key = key(Some(1));
        let printed = format!("{key:?}");
        assert!(printed.contains("Secret(..)") && !printed.contains(&format!("{:?}", key.secret.expose())));
        assert_eq!(key.message("a5").unwrap().to_string(), "a5");
        assert!(
            key.message("a5a5")
                .unwrap_err()
                .to_string()
                .contains("longer than the key's 8 bits")
        );
        assert_eq!(key.tokens().unwrap().bits(), 8);
    }
}
