//! The word that logits decide for, once, with how clearly each bit was read.
use crate::error::{Error, Result};
use crate::message::{LIMBS, Message, MessageLength};
use crate::signed_rank::{self, Ranks};

/// A word that was read.
///
/// A bit is 1 where its logit is above 0, and 0 where it is below, infinities included. A logit of exactly 0, of either
/// sign, and NaN leave a bit *undecided*: it matches no target. That only ever lowers the number of matches, so that
/// p-values stay true; guessing such bits would let a reader that read nothing match half of them. Bits are ranked by the
/// size of their logits ([`signed_rank`]), undecided ones lowest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    word: Message,
    /// Ones where a bit was decided.
    decided: Message,
    /// How clearly each bit was read: 1 for the least clear.
    ranks: Ranks,
}

impl Reading {
    /// The decision on logits, one a bit, that were summed over the views before.
    ///
    /// # Errors
    /// [`Error::Length`] unless there are 1 to [`MAX_BITS`](crate::MAX_BITS) of them.
    pub fn from_logits(logits: &[f32]) -> Result<Self> {
        let length = MessageLength::new(logits.len())?;
        let (mut word, mut decided) = (Message::zeros(length), Message::zeros(length));
        for (position, &logit) in logits.iter().enumerate() {
            word.set(position as u32, logit > 0.0);
            decided.set(position as u32, logit.abs() > 0.0); // false for NaN
        }
        Ok(Self {
            word,
            decided,
            ranks: signed_rank::ranks(logits),
        })
    }

    /// A reading that decided every bit, later ones more clearly.
    pub fn of(word: Message) -> Self {
        let mut decided = Message::zeros(word.length());
        (0..word.length().bits()).for_each(|position| decided.set(position, true));
        Self {
            word,
            decided,
            ranks: signed_rank::ranks(&vec![1.0; word.len()]),
        }
    }

    /// The bits read; undecided ones are 0.
    pub fn message(&self) -> Message {
        self.word
    }

    /// Bits that were decided.
    pub fn decided_bits(&self) -> u32 {
        self.decided.count_ones()
    }

    /// Bits that were not.
    pub fn undecided_bits(&self) -> u32 {
        self.word.length().bits() - self.decided_bits()
    }

    /// Decided bits that equal those of `target`.
    ///
    /// # Errors
    /// [`Error::OtherLength`] for a target of another length.
    pub fn matches(&self, target: &Message) -> Result<u32> {
        self.word.require("the target", target)?;
        let differ = self.differ(target.limbs());
        Ok(self.decided_bits() - differ)
    }

    /// The sum of the ranks of the decided bits that equal those of `target`.
    ///
    /// # Errors
    /// [`Error::OtherLength`] for a target of another length.
    pub fn rank_sum(&self, target: &Message) -> Result<u32> {
        self.word.require("the target", target)?;
        let same = self.word.bits().zip(target.bits()).zip(self.decided.bits());
        let same = same
            .zip(self.ranks)
            .filter(|(((read, wanted), decided), _)| *decided && read == wanted);
        Ok(same.map(|(_, rank)| u32::from(rank)).sum())
    }

    /// The rank sum of a target that equals all decided bits: none has more.
    pub fn largest_rank_sum(&self) -> u32 {
        signed_rank::largest(self.word.length().bits()) - signed_rank::largest(self.undecided_bits())
    }

    /// [`Reading::matches`] as a share of all bits.
    ///
    /// # Errors
    /// [`Error::OtherLength`] for a target of another length.
    pub fn bit_accuracy(&self, target: &Message) -> Result<f64> {
        Ok(f64::from(self.matches(target)?) / f64::from(target.length().bits()))
    }

    /// Decided bits that differ from those of the first limbs of a word of the same length.
    pub(crate) fn differ(&self, target: &[u64]) -> u32 {
        let pairs = self.word.limbs().iter().zip(self.decided.limbs()).zip(target);
        pairs
            .map(|((word, decided), target)| ((word ^ target) & decided).count_ones())
            .sum()
    }

    /// The word and the mask of its decided bits.
    pub(crate) fn limbs(&self) -> (&[u64; LIMBS], &[u64; LIMBS]) {
        (self.word.limbs(), self.decided.limbs())
    }

    /// The ranks of the bits of the word's limbs, in their order: the least significant bit of the first limb first.
    pub(crate) fn ranks_of_limbs(&self) -> impl Iterator<Item = u8> {
        self.ranks[..self.word.len()].iter().rev().copied()
    }

    /// Fails unless the reading has `length`; `what` names it in the message.
    pub(crate) fn require(&self, what: &str, length: MessageLength) -> Result<()> {
        if self.word.length() == length {
            return Ok(());
        }
        Err(Error::OtherLength {
            what: what.into(),
            bits: self.word.length().bits(),
            expected: length.bits(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn zeros_and_nan_are_undecided_and_match_nothing() {
        let logits = [
            1.0,
            -1.0,
            0.0,
            -0.0,
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::MIN_POSITIVE,
        ];
        let reading = Reading::from_logits(&logits).unwrap();
        assert_eq!(reading.message().to_string(), "85");
        assert_eq!((reading.decided_bits(), reading.undecided_bits()), (5, 3));
        // Whatever a target says in the three undecided places.
        for target in ["85", "b5", "95", "bd"] {
            let target = Message::parse(target, 8).unwrap();
            assert_eq!(reading.matches(&target).unwrap(), 5);
        }
        let none = Reading::from_logits(&[f32::NAN; 150]).unwrap();
        assert_eq!(
            none.matches(&Message::zeros(MessageLength::new(150).unwrap())).unwrap(),
            0
        );
    }

    proptest! {
        #[test]
        fn matches_are_counted_as_bit_by_bit(
            pairs in prop::collection::vec((prop::num::f32::ANY, any::<bool>()), 1..=150),
        ) {
            let (logits, bits): (Vec<f32>, Vec<bool>) = pairs.iter().copied().unzip();
            let reading = Reading::from_logits(&logits).unwrap();
            let target = Message::from_bits(&bits).unwrap();
            let expected = pairs.iter().filter(|&&(logit, bit)| if bit { logit > 0.0 } else { logit < 0.0 }).count();
            prop_assert_eq!(reading.matches(&target).unwrap() as usize, expected);
            prop_assert_eq!(Reading::of(target).matches(&target).unwrap(), target.length().bits());
            let ranks = signed_rank::ranks(&logits);
            let right = |place: &usize| if bits[*place] { logits[*place] > 0.0 } else { logits[*place] < 0.0 };
            let sum: u32 = (0..bits.len()).filter(right).map(|place| u32::from(ranks[place])).sum();
            prop_assert_eq!(reading.rank_sum(&target).unwrap(), sum);
            prop_assert_eq!(reading.rank_sum(&reading.message()).unwrap(), reading.largest_rank_sum());
        }
    }
}
