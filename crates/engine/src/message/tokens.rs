//! The keyed token table: which CLIP tokens stand for the values of the bits at each position of a message.
use hmac::{Hmac, KeyInit, Mac};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha20Rng;
use sha2::Sha256;

use crate::error::{Error, Result};
use guardsplat_codeword::{Message, MessageLength};

/// Length of a CLIP token sequence.
pub const CONTEXT: usize = 77;
/// Tokens that a message may take: all but the start and end tokens.
pub const POSITIONS: usize = CONTEXT - 2;
/// Most bits that one token stands for: 16 tokens a position.
pub const MAX_BITS_PER_TOKEN: usize = 4;
/// CLIP's start-of-text token.
pub const START: i64 = 49406;
/// CLIP's end-of-text token; the text tower's feature is taken there.
pub const END: i64 = 49407;
/// Highest token a table may use; 0 pads, 49406 and 49407 are control tokens.
pub const LAST_TOKEN: u16 = 49405;

/// HMAC-SHA256 of `parts`, one after the other, under `key`.
pub(crate) fn hmac_sha256(key: &[u8], parts: &[&[u8]]) -> [u8; 32] {
    // HMAC takes keys of any length, so this never fails.
    let mut mac = Hmac::<Sha256>::new_from_slice(key).expect("HMAC takes keys of any length");
    parts.iter().for_each(|part| mac.update(part));
    mac.finalize().into_bytes().into()
}

/// The fewest bits a token that make room for a message of `bits`.
pub fn fewest_bits_per_token(bits: usize) -> usize {
    bits.div_ceil(POSITIONS).max(1)
}

/// `2^k` distinct tokens a position, one for each value of its k bits; all tokens of a table are distinct.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TokenTable {
    bits: usize,
    bits_per_token: usize,
    /// `[positions][2^k]`.
    tokens: Vec<u16>,
}

impl TokenTable {
    /// The table of a 32-byte secret: the first entries of a permutation of 1..=[`LAST_TOKEN`], with `bits_per_token`
    /// (1 to [`MAX_BITS_PER_TOKEN`]) bits a token; the last token may stand for fewer.
    ///
    /// Fisher-Yates from the front, drawn from ChaCha20 that is seeded with HMAC-SHA256 of the secret; a longer
    /// table of the same secret and bits a token begins with the shorter one.
    ///
    /// # Errors
    /// `bits` outside 1 to [`MAX_BITS`](guardsplat_codeword::MAX_BITS), or more than [`POSITIONS`] tokens hold.
    pub fn new(secret: &[u8; 32], bits: usize, bits_per_token: usize) -> Result<Self> {
        MessageLength::new(bits)?;
        check_bits_per_token(bits, bits_per_token)?;
        let count = bits.div_ceil(bits_per_token) << bits_per_token;
        let mut rng = ChaCha20Rng::from_seed(hmac_sha256(secret, &[b"guardsplat token table v1"]));
        let mut tokens: Vec<u16> = (1..=LAST_TOKEN).collect();
        for i in 0..count {
            let j = i + below(&mut rng, (tokens.len() - i) as u32) as usize;
            tokens.swap(i, j);
        }
        tokens.truncate(count);
        Ok(Self {
            bits,
            bits_per_token,
            tokens,
        })
    }

    /// Number of bits it can express.
    pub fn bits(&self) -> usize {
        self.bits
    }

    /// Tokens of a message.
    pub fn positions(&self) -> usize {
        self.bits.div_ceil(self.bits_per_token)
    }

    /// The token sequence of a message: start, the tokens of its bits, end, zeros. Fails on another length.
    pub fn sequence(&self, message: &Message) -> Result<[i64; CONTEXT]> {
        if message.len() != self.bits() {
            return Err(Error::BadOption {
                field: "message",
                reason: format!("{} bits, but the key has {}", message.len(), self.bits()),
            });
        }
        let mut sequence = [0; CONTEXT];
        sequence[0] = START;
        let values = self.tokens.chunks_exact(1 << self.bits_per_token);
        let bits: Vec<bool> = message.bits().collect();
        let positions = values.zip(bits.chunks(self.bits_per_token));
        for (slot, (values, bits)) in sequence[1..].iter_mut().zip(positions) {
            // Most significant first.
            let value = bits.iter().fold(0, |value, bit| 2 * value + usize::from(*bit));
            *slot = i64::from(values[value]);
        }
        sequence[1 + self.positions()] = END;
        Ok(sequence)
    }
}

/// Fails unless so many bits a token are allowed, and make room for `bits`.
pub fn check_bits_per_token(bits: usize, bits_per_token: usize) -> Result<()> {
    let least = fewest_bits_per_token(bits);
    if (least..=MAX_BITS_PER_TOKEN).contains(&bits_per_token) {
        return Ok(());
    }
    Err(Error::BadOption {
        field: "bits per token",
        reason: format!("{bits_per_token} is outside {least} to {MAX_BITS_PER_TOKEN} for a message of {bits} bits"),
    })
}

/// A number below `n` without bias. Our own, because a key must give the same table with every release of `rand`.
fn below(rng: &mut impl Rng, n: u32) -> u32 {
    let limit = u32::MAX - u32::MAX % n; // the largest multiple of n that fits
    loop {
        let draw = rng.next_u32();
        if draw < limit {
            return draw % n;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn tokens_are_distinct_and_in_range() {
        for secret in [[0; 32], [7; 32], [255; 32]] {
            for (bits_per_token, expected) in [(1, 150), (2, 4 * 38), (4, 16 * 19)] {
                let table = TokenTable::new(&secret, 75, bits_per_token).unwrap();
                let tokens: HashSet<u16> = table.tokens.iter().copied().collect();
                assert_eq!(tokens.len(), expected);
                assert!(tokens.iter().all(|t| (1..=LAST_TOKEN).contains(t)));
            }
        }
    }

    #[test]
    fn the_secret_decides_and_the_length_only_cuts() {
        let long = TokenTable::new(&[1; 32], 75, 1).unwrap();
        let short = TokenTable::new(&[1; 32], 8, 1).unwrap();
        assert_eq!(long.tokens[..16], short.tokens[..]);
        let other = TokenTable::new(&[2; 32], 75, 1).unwrap();
        let shared = long.tokens.iter().zip(&other.tokens).filter(|(a, b)| a == b).count();
        assert_eq!(shared, 0);
        let refused = |bits, per_token| TokenTable::new(&[1; 32], bits, per_token).unwrap_err().to_string();
        assert!(refused(0, 1).contains("1 to 150") && refused(151, 3).contains("1 to 150"));
        assert!(refused(76, 1).contains("1 is outside 2 to 4") && refused(8, 5).contains("5 is outside 1 to 4"));
    }

    #[test]
    fn sequence_has_start_bits_end_and_padding() {
        let table = TokenTable::new(&[3; 32], 4, 1).unwrap();
        let sequence = table.sequence(&Message::parse("5", 4).unwrap()).unwrap();
        assert_eq!(sequence[0], START);
        let expected: Vec<i64> = (0..4).map(|i| i64::from(table.tokens[2 * i + i % 2])).collect();
        assert_eq!(sequence[1..5], expected[..]);
        assert_eq!(sequence[5], END);
        assert!(sequence[6..].iter().all(|&t| t == 0));
        assert!(table.sequence(&Message::parse("05", 8).unwrap()).is_err());
        let full = TokenTable::new(&[3; 32], 75, 1).unwrap();
        let message = Message::from_bits(&[true; 75]).unwrap();
        assert_eq!(full.sequence(&message).unwrap()[76], END);
    }

    #[test]
    fn tokens_of_several_bits_are_chosen_by_their_value() {
        // 0b10, 0b01, and a last token of one bit.
        let table = TokenTable::new(&[3; 32], 5, 2).unwrap();
        let sequence = table.sequence(&Message::parse("13", 5).unwrap()).unwrap();
        let token = |position: usize, value: usize| i64::from(table.tokens[4 * position + value]);
        assert_eq!(sequence[1..5], [token(0, 2), token(1, 1), token(2, 1), END]);
        assert_eq!((table.bits(), table.positions()), (5, 3));
        for (bits, least) in [(1, 1), (75, 1), (76, 2), (128, 2), (150, 2)] {
            assert_eq!(fewest_bits_per_token(bits), least);
        }
    }

    #[test]
    fn draws_cover_the_range_evenly() {
        let mut rng = ChaCha20Rng::seed_from_u64(5);
        let mut counts = [0_u32; 7];
        (0..70_000).for_each(|_| counts[below(&mut rng, 7) as usize] += 1);
        assert!(counts.iter().all(|c| (9_600..10_400).contains(c)), "{counts:?}");
    }
}
