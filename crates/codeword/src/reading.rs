//! The word that logits decide for, once, and the bits that they leave undecided.
use crate::error::{Error, Result};
use crate::message::{LIMBS, Message, MessageLength};

/// A word that was read.
///
/// A bit is 1 where its logit is above 0, and 0 where it is below, infinities included. A logit of exactly 0, of either
/// sign, and NaN leave a bit *undecided*: it matches no target. That only ever lowers the number of matches, so that
/// p-values stay true; guessing such bits would let a reader that read nothing match half of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reading {
    word: Message,
    /// Ones where a bit was decided.
    decided: Message,
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
        Ok(Self { word, decided })
    }

    /// A reading that decided every bit.
    pub fn of(word: Message) -> Self {
        let mut decided = Message::zeros(word.length());
        (0..word.length().bits()).for_each(|position| decided.set(position, true));
        Self { word, decided }
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
        }
    }
}
