//! The blind choice: what was done to a picture, and which part of it shows the scene, estimated from the picture and the
//! key alone.
//!
//! Whatever is claimed, the same reading is chosen. So under the null hypothesis the claimed word is independent of it,
//! and one reading is paid for, however many were looked at. A mark makes the logits of the right reading large ([`score`]),
//! and pictures of one scene carry the same message, so that the right readings of several agree ([`joint`]).
mod joint;
mod parts;
mod score;
mod search;

use std::fmt;

use super::photometric::ToneChange;
use super::{Engine, photometric::ground};
use crate::error::Result;
use crate::picture::Picture;
pub(super) use joint::chosen;
use parts::{Part, parts};

/// Corrected pictures that are read together.
const BATCH: usize = 16;
/// Parts of a picture whose tones are searched.
const SEARCHED: usize = 2;
/// How much better a part must look than the whole, as the logarithm of the size of logits.
const BETTER: f64 = 0.05;

/// What may have been done to a picture, and what is read once it is undone.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    part: Part,
    white: bool,
    change: ToneChange,
    logits: Vec<f32>,
    score: f64,
}

/// A picture as given, and the best candidates for what was done to it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BlindReading {
    pub as_given: Vec<f32>,
    candidates: Vec<Candidate>,
}

impl Candidate {
    /// Logits of the picture once this is undone.
    pub fn logits(&self) -> &[f32] {
        &self.logits
    }
}

/// In words.
impl fmt::Display for Candidate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.change)?;
        if self.white {
            f.write_str(", ground made white")?;
        }
        match self.part {
            Part::Whole => Ok(()),
            Part::Trimmed => f.write_str(", without borders"),
            Part::Window(window) => write!(f, ", {window}"),
        }
    }
}

impl BlindReading {
    /// Reads a picture, and looks for what was done to it.
    ///
    /// # Errors
    /// A picture without pixels, a failing device, or [`Error::Stopped`](crate::Error::Stopped).
    pub fn read(engine: &Engine, picture: &Picture) -> Result<Self> {
        let as_given = engine.read_logits(std::slice::from_ref(picture))?.swap_remove(0);
        let whole = engine.resized(picture)?;
        let parts = parts(engine, picture, &whole)?;
        let pictures: Vec<Picture> = parts.iter().map(|(_, small)| small.clone()).collect();
        let logits = engine.read_logits(&pictures)?;
        let mut found: Vec<Candidate> = parts
            .iter()
            .zip(logits)
            .map(|((part, _), logits)| Candidate {
                part: *part,
                white: false,
                change: ToneChange::default(),
                score: score::of_logits(&logits) - part.cost(),
                logits,
            })
            .collect();
        // The whole, or what is within its borders, comes first; then the best.
        let mut order: Vec<usize> = (0..parts.len()).collect();
        order[1..].sort_by(|a, b| found[*b].score.total_cmp(&found[*a].score));
        order.truncate(SEARCHED);
        for place in order {
            let (part, small) = &parts[place];
            found.extend(searched(engine, *part, small, &whole)?);
        }
        found.retain(|candidate| candidate.score.is_finite());
        found.sort_by(|a, b| b.score.total_cmp(&a.score));
        found.truncate(joint::MOST);
        Ok(Self {
            as_given,
            candidates: found,
        })
    }
}

/// A part of a picture with changes of its tones undone, the best first.
fn searched(engine: &Engine, part: Part, small: &Picture, whole: &Picture) -> Result<Vec<Candidate>> {
    let ground = ground::colour(small);
    let anchor = ground.map(|ground| move |change: super::photometric::ToneChange| change.with_white(ground, whole));
    let mut read = |changes: &[ToneChange]| {
        engine.stop.check()?;
        let undone = engine.each(changes, |change| {
            let undone = change.undone(small, whole);
            Ok(undone.map(|undone| ground::whitened(&undone).unwrap_or(undone)))
        })?;
        let possible: Vec<Picture> = undone.iter().flatten().cloned().collect();
        let mut logits = Vec::with_capacity(possible.len());
        for chunk in possible.chunks(BATCH) {
            logits.extend(engine.read_logits(chunk)?);
        }
        let mut logits = logits.into_iter();
        Ok(undone.iter().map(|undone| undone.as_ref().and_then(|_| logits.next())).collect())
    };
    let anchor = anchor.as_ref().map(|anchor| anchor as &dyn Fn(ToneChange) -> ToneChange);
    let found = search::search(&mut read, anchor)?;
    let candidate = |read: search::Read| Candidate {
        part,
        white: ground.is_some(),
        change: read.change,
        score: read.score - part.cost(),
        logits: read.logits,
    };
    Ok(found.into_iter().map(candidate).collect())
}
