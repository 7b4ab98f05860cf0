//! What a mark says: whose key, and which entry of its registry.
use sha2::{Digest, Sha256};

use serde::{Deserialize, Serialize};

use crate::code::Code;
use crate::error::{Error, Result};
use crate::limits::VERSION;

/// Bits of the version, in every layout: so a reader knows the rules before it knows anything else.
const VERSION_BITS: u32 = 2;

/// How many of a code's information bits each number has, most significant first: version, key, payload number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Bits of the version.
    pub version: u32,
    /// Bits of the key number.
    pub key: u32,
    /// Bits of the payload number.
    pub number: u32,
}

impl Layout {
    /// The layout in a code's information bits.
    pub fn of(code: Code) -> Self {
        let key = match code {
            Code::Bch45 => 13,
            Code::Bch36 => 10,
            Code::Bch30 => 8,
        };
        Self {
            version: VERSION_BITS,
            key,
            number: code.information_bits() - VERSION_BITS - key,
        }
    }

    /// The largest key number.
    pub fn largest_key(self) -> u32 {
        largest(self.key) as u32
    }

    /// The largest payload number.
    pub fn largest_number(self) -> u32 {
        largest(self.number) as u32
    }
}

/// What a mark says, in the current [`VERSION`]. The registry of the key maps the number to owner and asset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Payload {
    /// The owner's key, by its number in the registry; below 2^13, 2^10 or 2^8 by the code.
    pub key: u32,
    /// The entry of the key's registry; below 2^30, 2^24 or 2^20 by the code.
    pub number: u32,
}

impl Payload {
    /// The payload of a number of a key. Keys have no numbers: theirs is the first bits of the SHA-256 of their id, which
    /// is enough, since nothing is looked up by it.
    pub fn of_key(code: Code, key: &[u8; 16], number: u32) -> Self {
        let [a, b, c, d, ..]: [u8; 32] = Sha256::digest(key).into();
        let key = u32::from_be_bytes([a, b, c, d]) >> (32 - Layout::of(code).key);
        Self { key, number }
    }

    /// The payload as information bits of `code`, in the lowest [`Code::information_bits`].
    ///
    /// # Errors
    /// [`Error::TooLarge`] for numbers that the code's [`Layout`] has no room for.
    pub fn pack(self, code: Code) -> Result<u64> {
        let layout = Layout::of(code);
        check("key number", self.key, layout.largest_key())?;
        check("payload number", self.number, layout.largest_number())?;
        let head = u64::from(VERSION) << layout.key | u64::from(self.key);
        Ok(head << layout.number | u64::from(self.number))
    }

    /// The payload of information bits of `code`.
    ///
    /// # Errors
    /// [`Error::UnknownVersion`] for other rules than today's, and [`Error::TooLarge`] for more bits than the code has.
    pub fn unpack(code: Code, information: u64) -> Result<Self> {
        let layout = Layout::of(code);
        let limit = largest(code.information_bits());
        if information > limit {
            return Err(Error::TooLarge {
                field: "information bits",
                value: information,
                limit,
            });
        }
        let version = (information >> (layout.key + layout.number)) as u8;
        if version != VERSION {
            return Err(Error::UnknownVersion { version });
        }
        Ok(Self {
            key: (information >> layout.number & largest(layout.key)) as u32,
            number: (information & largest(layout.number)) as u32,
        })
    }
}

/// The largest number of so many bits, at most 63.
fn largest(bits: u32) -> u64 {
    (1 << bits) - 1
}

fn check(field: &'static str, value: u32, limit: u32) -> Result<()> {
    if value <= limit {
        return Ok(());
    }
    Err(Error::TooLarge {
        field,
        value: value.into(),
        limit: limit.into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_layout_of_the_default_code_is_what_marks_out_there_have() {
        let payload = Payload {
            key: 0x2a5,
            number: 0xc0_ffee,
        };
        // 01, 10_1010_0101, 1100_0000_1111_1111_1110_1110.
        assert_eq!(
            payload.pack(Code::Bch36).unwrap(),
            0b0110_1010_0101_1100_0000_1111_1111_1110_1110
        );
    }

    #[test]
    fn numbers_that_do_not_fit_are_errors_that_say_the_limit() {
        for (code, keys, numbers) in [
            (Code::Bch45, 8192, 1 << 30),
            (Code::Bch36, 1024, 1 << 24),
            (Code::Bch30, 256, 1 << 20),
        ] {
            let last = Payload {
                key: keys - 1,
                number: numbers - 1,
            };
            assert_eq!(Payload::unpack(code, last.pack(code).unwrap()), Ok(last));
            let error = Payload { key: keys, number: 0 }.pack(code).unwrap_err().to_string();
            assert_eq!(error, format!("key number: {keys} is above {}", keys - 1));
            let error = Payload {
                key: 0,
                number: numbers,
            }
            .pack(code)
            .unwrap_err()
            .to_string();
            assert_eq!(error, format!("payload number: {numbers} is above {}", numbers - 1));
        }
    }

    proptest! {
        #[test]
        fn information_is_a_payload_packed_or_refused(information: u64, narrow in 0_u32..64) {
            for code in Code::ALL {
                let information = information >> narrow;
                match Payload::unpack(code, information) {
                    Ok(payload) => prop_assert_eq!(payload.pack(code).unwrap(), information),
                    Err(Error::UnknownVersion { version }) => prop_assert_ne!(version, VERSION),
                    Err(_) => prop_assert!(information >> code.information_bits() > 0),
                }
            }
        }
    }
}
