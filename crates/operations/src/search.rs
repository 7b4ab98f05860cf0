//! Which of many messages a suspect carries, every one of them paid for.
use guardsplat_codeword::{Message, Verdict, shares};
use guardsplat_engine::Result;
use guardsplat_engine::extract::{Comparison, Engine, PooledLogits};

use crate::suspect::Suspect;
use crate::thumbnails::Thumbnails;
use crate::verification::{Views, read, read_hypotheses};

/// The message that agrees best.
#[derive(Clone)]
pub struct Nearest {
    /// Its place among those that were compared.
    pub index: usize,
    /// How it compares: the p-value and what a match needs are those of the best of all messages and all ways to read.
    pub comparison: Comparison,
}

/// Reads `suspect` and finds the nearest of `messages`, none of which may follow from the suspect itself. As in
/// [`read_and_compare`](crate::verification::read_and_compare) half of the rate is for pictures as they are. `None` without
/// messages.
///
/// # Errors
/// Those of reading, and of messages that are not of the key's length.
pub fn read_and_search(
    engine: &Engine,
    suspect: &Suspect,
    views: &Views,
    messages: &[Message],
    mut progress: impl FnMut(usize, usize),
) -> Result<Option<Nearest>> {
    let mut shown = Thumbnails::default();
    let (reading, _) = read(engine, suspect, views, &mut shown, &mut progress)?;
    // Without pictures there is nothing to guess.
    let given = if suspect.pictures.is_empty() { 1 } else { 2 };
    let mut best = nearest(engine, &reading, messages, given)?;
    let matches =
        |best: &Option<Nearest>| matches!(best, Some(best) if best.comparison.decision.verdict == Verdict::Match);
    if given == 1 || best.is_none() || matches(&best) {
        return Ok(best);
    }
    let read = read_hypotheses(engine, suspect, views, &mut shown, progress)?.readings;
    let tries = shares(&read.iter().map(|(hypothesis, _)| *hypothesis).collect::<Vec<_>>());
    for ((_, reading), tries) in read.iter().zip(tries).skip(1) {
        let found = nearest(engine, reading, messages, tries as usize)?;
        let p_value = |nearest: &Option<Nearest>| nearest.as_ref().map_or(1.0, |n| n.comparison.decision.p_value);
        if p_value(&found) < p_value(&best) {
            best = found;
        }
    }
    Ok(best)
}

fn nearest(engine: &Engine, reading: &PooledLogits, messages: &[Message], tries: usize) -> Result<Option<Nearest>> {
    let rule = engine.acceptance_rule(tries.saturating_mul(messages.len()));
    let mut best: Option<Nearest> = None;
    for (index, message) in messages.iter().enumerate() {
        let comparison = reading.compare(&engine.message_code, message, &rule)?;
        let nearer = |best: &Nearest| comparison.decision.rank_sum > best.comparison.decision.rank_sum;
        if best.as_ref().is_none_or(nearer) {
            best = Some(Nearest { index, comparison });
        }
    }
    Ok(best)
}
