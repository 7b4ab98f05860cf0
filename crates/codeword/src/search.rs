//! Finding the nearest of many registered words.
use std::cmp::Reverse;
use std::collections::BinaryHeap;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::message::{Message, MessageLength};
use crate::reading::Reading;
use crate::signed_rank;

/// Words of one length, as compact as their bits allow: 8, 16 or 24 bytes each.
///
/// The words are those that were embedded, under their pads. Every word searched is a hypothesis: give [`Index::len`] as
/// [`Claim::targets_tried`](crate::Claim::targets_tried) when the nearest are put to the test.
#[derive(Clone, Debug)]
pub struct Index {
    length: MessageLength,
    /// Words one after the other, as integers, least significant limb first.
    limbs: Vec<u64>,
}

/// A word that was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hit {
    /// Its row, in the order in which words were added.
    pub row: u64,
    /// The reading that it is near to, by its place among those searched for.
    pub reading: u32,
    /// The sum of the ranks of the bits that match.
    pub rank_sum: u32,
}

/// Orders hits from worst to best: by rank sum, then the earlier reading, then the earlier row.
type Order = (u32, Reverse<u32>, Reverse<u64>);

impl Index {
    /// An index without words.
    pub fn new(length: MessageLength) -> Self {
        Self {
            length,
            limbs: Vec::new(),
        }
    }

    /// Adds a word and returns its row.
    ///
    /// # Errors
    /// [`Error::OtherLength`] for a word of another length.
    pub fn push(&mut self, word: &Message) -> Result<u64> {
        if word.length() != self.length {
            return Err(Error::OtherLength {
                what: "the word".into(),
                bits: word.length().bits(),
                expected: self.length.bits(),
            });
        }
        let row = self.len();
        self.limbs.extend(word.limbs().iter().take(self.length.limbs()));
        Ok(row)
    }

    /// Words in the index.
    pub fn len(&self) -> u64 {
        (self.limbs.len() / self.length.limbs()) as u64
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.limbs.is_empty()
    }

    /// The `count` best pairs of a reading and a word, best first; of equal ones the earlier reading, then the earlier
    /// row. Undecided bits match nothing.
    ///
    /// # Errors
    /// [`Error::OtherLength`] for a reading of another length.
    pub fn nearest(&self, readings: &[Reading], count: usize) -> Result<Vec<Hit>> {
        let mut best = Best {
            count,
            heap: BinaryHeap::new(),
        };
        for (place, reading) in (0_u32..).zip(readings) {
            reading.require(&format!("reading {place}"), self.length)?;
            match self.length.limbs() {
                1 => self.scan::<1>(place, reading, &mut best),
                2 => self.scan::<2>(place, reading, &mut best),
                _ => self.scan::<3>(place, reading, &mut best),
            }
        }
        let sorted = best.heap.into_sorted_vec(); // best first, because the heap holds them reversed
        let hit = |Reverse((rank_sum, Reverse(reading), Reverse(row))): Reverse<Order>| Hit { row, reading, rank_sum };
        Ok(sorted.into_iter().map(hit).collect())
    }

    /// Offers all words of so many limbs.
    fn scan<const LIMBS: usize>(&self, place: u32, reading: &Reading, best: &mut Best) {
        let largest = reading.largest_rank_sum();
        let (word, decided) = reading.limbs();
        let weights = Weights::<LIMBS>::of(reading);
        let (words, _) = self.limbs.as_chunks::<LIMBS>();
        for (row, target) in (0_u64..).zip(words) {
            let differ: [u64; LIMBS] = std::array::from_fn(|limb| (target[limb] ^ word[limb]) & decided[limb]);
            // So many bits have at least these ranks: few words are near enough to look at them.
            let bits = differ.iter().map(|limb| limb.count_ones()).sum();
            if largest - signed_rank::largest(bits) >= best.least() {
                best.offer((largest - weights.sum(differ), Reverse(place), Reverse(row)));
            }
        }
    }
}

/// Sums of the ranks of the bits that a byte has, for each byte of so many limbs: eight bits cost one look.
struct Weights<const LIMBS: usize>(Box<[[[u16; 256]; 8]; LIMBS]>);

impl<const LIMBS: usize> Weights<LIMBS> {
    fn of(reading: &Reading) -> Self {
        let mut ranks = reading.ranks_of_limbs();
        let mut sums = Box::new([[[0; 256]; 8]; LIMBS]);
        for byte in sums.as_flattened_mut() {
            for bit in 0..8 {
                let rank = u16::from(ranks.next().unwrap_or(0));
                let (without, with) = byte.split_at_mut(1 << bit);
                with.iter_mut()
                    .zip(without)
                    .for_each(|(with, without)| *with = *without + rank);
            }
        }
        Self(sums)
    }

    fn sum(&self, limbs: [u64; LIMBS]) -> u32 {
        let of_limb = |(limb, sums): (u64, &[[u16; 256]; 8])| {
            let bytes = limb.to_le_bytes().into_iter().zip(sums);
            bytes
                .map(|(byte, sums)| u32::from(sums[usize::from(byte)]))
                .sum::<u32>()
        };
        limbs.into_iter().zip(self.0.iter()).map(of_limb).sum()
    }
}

/// The best hits so far, the worst of them on top.
struct Best {
    count: usize,
    heap: BinaryHeap<Reverse<Order>>,
}

impl Best {
    /// The rank sum that a hit needs.
    fn least(&self) -> u32 {
        let worst = self.heap.peek().filter(|_| self.heap.len() >= self.count);
        worst.map_or(0, |Reverse((rank_sum, ..))| *rank_sum)
    }

    fn offer(&mut self, hit: Order) {
        if self.heap.len() < self.count {
            self.heap.push(Reverse(hit));
        } else if let Some(mut worst) = self.heap.peek_mut()
            && worst.0 < hit
        {
            *worst = Reverse(hit);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn word(bits: &[bool], length: usize) -> Message {
        Message::from_bits(&bits[..length]).unwrap()
    }

    fn naive(words: &[Message], readings: &[Reading], count: usize) -> Vec<Hit> {
        let mut hits = Vec::new();
        for (reading, read) in (0..).zip(readings) {
            for (row, word) in (0..).zip(words) {
                hits.push(Hit {
                    row,
                    reading,
                    rank_sum: read.rank_sum(word).unwrap(),
                });
            }
        }
        hits.sort_by_key(|hit| Reverse(hit.rank_sum)); // stable: what came first stays first
        hits.truncate(count);
        hits
    }

    proptest! {
        #[test]
        fn the_nearest_are_those_of_a_plain_search(
            length in prop_oneof![1_usize..12, 60_usize..70, 120_usize..=150],
            words in prop::collection::vec(prop::collection::vec(any::<bool>(), 150), 0..60),
            logits in prop::collection::vec(prop::collection::vec(-9_i8..=9, 150), 0..4),
            count in 0_usize..20,
        ) {
            let words: Vec<Message> = words.iter().map(|bits| word(bits, length)).collect();
            let readings: Vec<Reading> = logits
                .iter()
                .map(|logits| logits[..length].iter().map(|&l| f32::from(l)).collect::<Vec<_>>())
                .map(|logits| Reading::from_logits(&logits).unwrap())
                .collect();
            let mut index = Index::new(MessageLength::new(length).unwrap());
            for (row, word) in words.iter().enumerate() {
                prop_assert_eq!(index.push(word).unwrap(), row as u64);
            }
            prop_assert_eq!(index.len() as usize, words.len());
            prop_assert_eq!(index.is_empty(), words.is_empty());
            prop_assert_eq!(index.nearest(&readings, count).unwrap(), naive(&words, &readings, count));
        }
    }

    #[test]
    fn other_lengths_are_errors_and_words_are_compact() {
        let mut index = Index::new(MessageLength::CODED);
        assert!(index.push(&word(&[true; 150], 63)).is_err());
        index.push(&Message::from_u64(5)).unwrap();
        assert_eq!(size_of_val(index.limbs.as_slice()), 8);
        let other = Reading::of(word(&[true; 150], 65));
        let error = index
            .nearest(&[Reading::of(Message::from_u64(0)), other], 1)
            .unwrap_err();
        assert_eq!(error.to_string(), "reading 1 has 65 bits, not 64");
    }
}
