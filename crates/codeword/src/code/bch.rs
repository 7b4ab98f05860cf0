//! Binary BCH codes of 63 bits: systematic encoding, and decoding of up to t errors.
//!
//! Syndromes, Berlekamp and Massey's iteration, Chien's search. A word is an integer whose bit i is the coefficient of
//! x^i. Source: Lin and Costello, Error Control Coding (2nd edition), sections 6.1 to 6.4.
use super::field::{ORDER, div, generator, mul, power};

/// Most errors that one of the codes corrects.
const MOST: usize = 11;
/// Coefficients of error locators while they are found: their degree stays below 2 t.
const TERMS: usize = 2 * MOST + 1;

/// A BCH code of 63 bits.
#[derive(Clone, Copy, Debug)]
pub struct Bch {
    /// Errors that it corrects.
    pub t: u32,
    /// Information bits.
    pub k: u32,
    generator: u64,
}

impl Bch {
    /// (63, 45), correcting 3.
    pub const T3: Self = Self::new(3);
    /// (63, 36), correcting 5.
    pub const T5: Self = Self::new(5);
    /// (63, 30), correcting 6.
    pub const T6: Self = Self::new(6);
    /// (63, 16), correcting 11.
    pub const T11: Self = Self::new(11);

    const fn new(t: u32) -> Self {
        let generator = generator(t);
        Self {
            t,
            k: ORDER - generator.ilog2(),
            generator,
        }
    }

    /// The codeword whose k highest bits are `information`; bits above those are ignored.
    pub fn encode(&self, information: u64) -> u64 {
        let degree = ORDER - self.k;
        let shifted = (information & ((1 << self.k) - 1)) << degree;
        let mut remainder = shifted;
        for i in (degree..ORDER).rev() {
            if remainder >> i & 1 == 1 {
                remainder ^= self.generator << (i - degree);
            }
        }
        shifted | remainder
    }

    /// The information of a codeword.
    pub fn information(&self, codeword: u64) -> u64 {
        codeword >> (ORDER - self.k) & ((1 << self.k) - 1)
    }

    /// The codeword within t bits of `word`, if there is one.
    pub fn correct(&self, word: u64) -> Option<u64> {
        let syndromes = self.syndromes(word);
        if syndromes.iter().all(|&s| s == 0) {
            return Some(word);
        }
        let (locator, errors) = self.locator(&syndromes)?;
        let mut corrected = word;
        let mut found = 0;
        for i in 0..ORDER {
            // An error at x^i makes α^-i a root.
            let at = power(ORDER - i);
            if locator.iter().rev().fold(0, |sum, &c| mul(sum, at) ^ c) == 0 {
                corrected ^= 1 << i;
                found += 1;
            }
        }
        // A locator with other roots than its degree says that more than t bits are wrong.
        (found == errors).then_some(corrected)
    }

    /// The word at α, α^2, …, α^2t; zeros follow.
    fn syndromes(&self, word: u64) -> [u8; 2 * MOST] {
        let mut syndromes = [0; 2 * MOST];
        for (j, syndrome) in (1..=2 * self.t).zip(&mut syndromes) {
            let mut rest = word;
            while rest != 0 {
                *syndrome ^= power(j * rest.trailing_zeros());
                rest &= rest - 1;
            }
        }
        syndromes
    }

    /// The shortest register that generates the syndromes, and its length; `None` above t.
    fn locator(&self, syndromes: &[u8; 2 * MOST]) -> Option<([u8; TERMS], u32)> {
        let (mut locator, mut before) = ([0_u8; TERMS], [0_u8; TERMS]);
        locator[0] = 1;
        before[0] = 1;
        let (mut length, mut gap, mut last) = (0_usize, 1_usize, 1_u8);
        for n in 0..2 * self.t as usize {
            let discrepancy = (0..=length.min(n)).fold(0, |sum, i| sum ^ mul(locator[i], syndromes[n - i]));
            if discrepancy == 0 {
                gap += 1;
                continue;
            }
            let scale = div(discrepancy, last);
            let shorter = locator;
            for i in gap..TERMS {
                locator[i] ^= mul(scale, before[i - gap]);
            }
            if 2 * length <= n {
                length = n + 1 - length;
                before = shorter;
                last = discrepancy;
                gap = 1;
            } else {
                gap += 1;
            }
        }
        (length <= self.t as usize).then_some((locator, length as u32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn codes_have_their_published_sizes() {
        assert_eq!(
            [Bch::T3, Bch::T5, Bch::T6, Bch::T11].map(|code| (code.k, code.t)),
            [(45, 3), (36, 5), (30, 6), (16, 11)]
        );
    }

    #[test]
    fn codewords_are_multiples_of_the_generator_and_keep_their_information() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for code in [Bch::T3, Bch::T5, Bch::T6, Bch::T11] {
            for _ in 0..500 {
                let information = rng.random::<u64>() >> (64 - code.k);
                let word = code.encode(information);
                assert_eq!(code.information(word), information);
                assert_eq!(word >> ORDER, 0);
                assert!(code.syndromes(word).iter().all(|&s| s == 0));
                // Cyclic: a rotated codeword is a codeword.
                assert_eq!(
                    code.correct(word << 1 & ((1 << 63) - 1) | word >> 62)
                        .map(|w| w.count_ones()),
                    Some(word.count_ones())
                );
            }
        }
    }

    #[test]
    fn no_codeword_is_lighter_than_the_designed_distance() {
        // All combinations of few rows of the generator matrix: light codewords would show up among them.
        for code in [Bch::T3, Bch::T5, Bch::T6, Bch::T11] {
            let rows: Vec<u64> = (0..code.k).map(|i| code.encode(1 << i)).collect();
            let mut lightest = 64;
            for a in 0..rows.len() {
                for b in a..rows.len() {
                    for c in b..rows.len() {
                        let word = rows[a] ^ rows[b] ^ rows[c];
                        lightest = lightest.min(word.count_ones());
                    }
                }
            }
            assert!(lightest > 2 * code.t, "{lightest}");
        }
    }
}
