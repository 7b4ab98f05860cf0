//! The keyed token table: which two CLIP tokens stand for 0 and 1 at each position of a message.
use hmac::{Hmac, KeyInit, Mac};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha20Rng;
use sha2::Sha256;

use super::bits::{Message, check_bits};
use crate::error::{Error, Result};

/// Length of a CLIP token sequence.
pub const CONTEXT: usize = 77;
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

/// Two distinct tokens a position: `table[position][bit]`; all tokens of a table are distinct.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TokenTable {
    table: Vec<[u16; 2]>,
}

impl TokenTable {
    /// The table of a 32-byte secret: the first 2 x `bits` entries of a permutation of 1..=[`LAST_TOKEN`].
    ///
    /// Fisher-Yates from the front, drawn from ChaCha20 that is seeded with HMAC-SHA256 of the secret; a longer
    /// table of the same secret begins with the shorter one. Fails when `bits` is outside 1 to 75.
    pub fn new(secret: &[u8; 32], bits: usize) -> Result<Self> {
        check_bits(bits)?;
        let mut rng = ChaCha20Rng::from_seed(hmac_sha256(secret, &[b"guardsplat token table v1"]));
        let mut ids: Vec<u16> = (1..=LAST_TOKEN).collect();
        for i in 0..2 * bits {
            let j = i + below(&mut rng, (ids.len() - i) as u32) as usize;
            ids.swap(i, j);
        }
        Ok(Self {
            table: ids[..2 * bits].chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect(),
        })
    }

    /// Number of bits it can express.
    pub fn bits(&self) -> usize {
        self.table.len()
    }

    /// The token sequence of a message: start, one token a bit, end, zeros. Fails on another length.
    pub fn sequence(&self, message: &Message) -> Result<[i64; CONTEXT]> {
        if message.len() != self.bits() {
            return Err(Error::BadOption {
                field: "message",
                reason: format!("{} bits, but the key has {}", message.len(), self.bits()),
            });
        }
        let mut sequence = [0; CONTEXT];
        sequence[0] = START;
        for (slot, (pair, &bit)) in sequence[1..].iter_mut().zip(self.table.iter().zip(message.bits())) {
            *slot = i64::from(pair[usize::from(bit)]);
        }
        sequence[1 + self.bits()] = END;
        Ok(sequence)
    }
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
            let table = TokenTable::new(&secret, 75).unwrap();
            let tokens: HashSet<u16> = table.table.iter().flatten().copied().collect();
            assert_eq!(tokens.len(), 150);
            assert!(tokens.iter().all(|t| (1..=LAST_TOKEN).contains(t)));
        }
    }

    #[test]
    fn the_secret_decides_and_the_length_only_cuts() {
        let long = TokenTable::new(&[1; 32], 75).unwrap();
        let short = TokenTable::new(&[1; 32], 8).unwrap();
        assert_eq!(long.table[..8], short.table[..]);
        let other = TokenTable::new(&[2; 32], 75).unwrap();
        let shared = long.table.iter().zip(&other.table).filter(|(a, b)| a == b).count();
        assert_eq!(shared, 0);
        assert!(TokenTable::new(&[1; 32], 0).is_err() && TokenTable::new(&[1; 32], 76).is_err());
    }

    #[test]
    fn sequence_has_start_bits_end_and_padding() {
        let table = TokenTable::new(&[3; 32], 4).unwrap();
        let sequence = table.sequence(&Message::parse("5", 4).unwrap()).unwrap();
        assert_eq!(sequence[0], START);
        let expected: Vec<i64> = (0..4).map(|i| i64::from(table.table[i][i % 2])).collect();
        assert_eq!(sequence[1..5], expected[..]);
        assert_eq!(sequence[5], END);
        assert!(sequence[6..].iter().all(|&t| t == 0));
        assert!(table.sequence(&Message::parse("05", 8).unwrap()).is_err());
        let full = TokenTable::new(&[3; 32], 75).unwrap();
        let message = Message::from_bits(vec![true; 75]).unwrap();
        assert_eq!(full.sequence(&message).unwrap()[76], END);
    }

    #[test]
    fn draws_cover_the_range_evenly() {
        let mut rng = ChaCha20Rng::seed_from_u64(5);
        let mut counts = [0_u32; 7];
        (0..70_000).for_each(|_| counts[below(&mut rng, 7) as usize] += 1);
        assert!(counts.iter().all(|c| (9_600..10_400).contains(c)), "{counts:?}");
    }
}
