//! What was read of views: logits that are decided for, or readings of pictures that somebody changed, of which the right
//! one depends on which pictures are read together.
use guardsplat_codeword::Message;
use guardsplat_engine::extract::{Engine, PictureLogits, PooledLogits, hypotheses};

use super::guessed::{blindly_chosen, cross_chosen};
use crate::error::Result;

/// What was read of some views.
pub(super) enum ViewReadings<'a> {
    /// Logits of each, whatever the others are.
    Decided(PooledLogits),
    /// Readings of each under what may have been done to it, and the message.
    Guessed(&'a Engine, Vec<PictureLogits>, Message),
}

impl ViewReadings<'_> {
    /// Each view read by itself.
    pub fn each(&self) -> Result<PooledLogits> {
        match self {
            Self::Decided(logits) => Ok(logits.clone()),
            Self::Guessed(engine, pictures, message) => {
                let alone = pictures
                    .iter()
                    .map(|picture| together(engine, std::slice::from_ref(picture), message));
                Ok(PooledLogits::new(alone.collect::<Result<_>>()?)?)
            }
        }
    }

    /// The first `count` views, read together.
    pub fn of_first(&self, count: usize) -> Result<PooledLogits> {
        match self {
            Self::Decided(logits) => Ok(logits.of_first(count)?),
            Self::Guessed(engine, pictures, message) => {
                let first = &pictures[..count.min(pictures.len())];
                Ok(PooledLogits::new(vec![together(engine, first, message)?])?)
            }
        }
    }
}

/// Logits of pictures together: of a coded message under the hypothesis that a claim about whatever it reads would take, else
/// each bit under that of a claim about the others.
fn together(engine: &Engine, pictures: &[PictureLogits], message: &Message) -> Result<Vec<f32>> {
    let read = hypotheses(engine, pictures)?.into_iter();
    let read: Vec<_> = read.map(|(hypothesis, logits)| (hypothesis, logits.summed)).collect();
    match engine.message_code.messages() {
        Some(_) => blindly_chosen(&engine.message_code, read),
        None => cross_chosen(&read, message),
    }
}
