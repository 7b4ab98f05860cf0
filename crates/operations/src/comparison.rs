//! What a verification finds: whether a raw message is in what was read.
use std::path::Path;

use guardsplat_codeword::{Hypothesis, Message, Verdict, shares};
use guardsplat_engine::extract::{Comparison, Engine, PooledLogits, find_source};
use guardsplat_engine::scene::Ignored;
use guardsplat_engine::{Error, Result};

use crate::registered::{RegisteredReadings, read_registered};
use crate::suspect::Suspect;
use crate::thumbnails::Thumbnails;
use crate::verification::{HypothesisReadings, Views, read, read_hypotheses};

/// What was read, and how it compares with a raw message.
pub struct Compared {
    /// What was read in the way that agrees best.
    pub reading: PooledLogits,
    /// How it compares, if there is a message, or a coded one is read.
    pub comparison: Option<Comparison>,
    /// That way.
    pub way: Hypothesis,
    /// Ways in which the pictures were read.
    pub ways: usize,
    /// What is estimated to have been done to each picture, in words, if it was estimated.
    pub estimates: Vec<String>,
    /// Of each picture how much of it the original explains, if there is an original that was looked at; `None` where it
    /// explains nothing.
    pub explained: Vec<Option<f64>>,
    /// Rows of scenes that were ignored.
    pub ignored: Vec<Ignored>,
}

/// Compares readings with the message, if there is one.
struct Claimed<'a> {
    engine: &'a Engine,
    message: Option<&'a Message>,
}

impl Claimed<'_> {
    /// A reading that has one part in `tries` of the rate; `None` if there is nothing to compare with.
    fn compare(&self, reading: &PooledLogits, tries: u64) -> Result<Option<Comparison>> {
        let code = &self.engine.message_code;
        let (message, tries) = match (self.message, code.messages()) {
            (Some(message), _) => (*message, tries),
            (None, Some(messages)) => (code.read(&reading.summed)?, tries.saturating_mul(messages)),
            (None, None) => return Ok(None),
        };
        let rule = self.engine.acceptance_rule(tries as usize);
        reading.compare(code, &message, &rule).map(Some)
    }
}

impl Compared {
    fn p_value(&self) -> f64 {
        self.comparison.as_ref().map_or(1.0, |found| found.decision.p_value)
    }

    fn is_match(&self) -> bool {
        let found = self.comparison.as_ref();
        found.is_some_and(|found| found.decision.verdict == Verdict::Match)
    }

    /// Keeps a reading that agrees better than all before.
    fn offer(&mut self, claimed: &Claimed<'_>, way: Hypothesis, reading: PooledLogits, tries: u64) -> Result<()> {
        if let Some(comparison) = claimed.compare(&reading, tries)?
            && comparison.decision.p_value < self.p_value()
        {
            (self.reading, self.way, self.comparison) = (reading, way, Some(comparison));
        }
        Ok(())
    }
}

/// Refuses a scene that carries the message itself: whatever is compared with it could match by that.
fn refuse_marked(claimed: &Claimed<'_>, original: &Path, views: &Views) -> Result<()> {
    let scene = Suspect {
        scenes: vec![original.to_owned()],
        pictures: Vec::new(),
    };
    let (reading, _) = read(claimed.engine, &scene, views, &mut Thumbnails::default(), |_, _| {})?;
    let found = claimed.compare(&reading, 1)?;
    if found.is_some_and(|found| found.decision.verdict == Verdict::Match) {
        return Err(Error::BadOption {
            field: "original",
            reason: format!(
                "{} carries the message: give the scene before it was marked",
                original.display()
            ),
        });
    }
    Ok(())
}

/// Reads `suspect` and compares it with `message`. Pictures that do not match as they are given are read under every other
/// hypothesis besides, and so are those of a message that is too short to match, unless all of it is right. Each hypothesis
/// pays by its share of the rate ([`shares`]): half is for pictures as they are, so that those who change nothing hardly pay
/// for those who do. Without a message a coded one is compared with what it reads itself, and pays for all messages.
///
/// With the unmarked `original` at hand pictures that do not match as they are given are compared with it first, for half of
/// the rest of the rate, and hypotheses have what is left if that does not match, either.
///
/// # Errors
/// Those of reading scenes and pictures, a message of another length, and an original that carries the message.
pub fn read_and_compare(
    engine: &Engine,
    suspect: &Suspect,
    views: &Views,
    original: Option<&Path>,
    message: Option<&Message>,
    mut progress: impl FnMut(usize, usize),
) -> Result<Compared> {
    if let Some(original) = original {
        // It is read when it is needed, and told to be missing before.
        find_source(&[original.to_owned()])?;
    }
    // Nobody looks at what was compared with a raw message.
    let mut shown = Thumbnails::default();
    let claimed = Claimed { engine, message };
    let (reading, ignored) = read(engine, suspect, views, &mut shown, &mut progress)?;
    // Without pictures there is nothing to guess. With them the first reading has what it would have among all.
    let given = if suspect.pictures.is_empty() { 1 } else { 2 };
    let mut best = Compared {
        comparison: claimed.compare(&reading, given)?,
        reading,
        way: Hypothesis::default(),
        ways: 1,
        estimates: Vec::new(),
        explained: Vec::new(),
        ignored,
    };
    // Of a message that is too short for a match the best reading is told all the same.
    let all_right = |found: &Comparison| found.decision.matched_bits == found.decision.bits;
    if given == 1 || best.is_match() || best.comparison.as_ref().is_none_or(all_right) {
        return Ok(best);
    }
    let mut tried = Vec::new();
    if let Some(original) = original {
        refuse_marked(&claimed, original, views)?;
        let scene_views = best.reading.views.len() - suspect.pictures.len();
        let of_scenes = best.reading.views[..scene_views].to_vec();
        let RegisteredReadings { readings, explained } =
            read_registered(engine, suspect, views, original, &of_scenes, &mut progress)?;
        best.explained = explained;
        best.ways += readings.len();
        // Half of what pictures as given leave: there are guesses, too.
        let tries = 4 * readings.len() as u64;
        for (way, reading) in readings {
            tried.push(way);
            best.offer(&claimed, way, reading, tries)?;
        }
        if best.is_match() {
            return Ok(best);
        }
    }
    let HypothesisReadings {
        readings, estimates, ..
    } = read_hypotheses(engine, suspect, views, &mut shown, progress)?;
    // As given they were read before.
    best.ways += readings.len() - 1;
    best.estimates = estimates;
    let compared = tried.len();
    tried.extend(readings.iter().map(|(hypothesis, _)| *hypothesis));
    let tries = shares(&tried).split_off(compared);
    for ((hypothesis, reading), tries) in readings.into_iter().zip(tries).skip(1) {
        best.offer(&claimed, hypothesis, reading, tries)?;
    }
    Ok(best)
}
