//! The blind choice: what was done to a picture, and which part of it shows the scene, estimated from the picture and the
//! key alone.
//!
//! Whatever is claimed, the same reading is chosen. So under the null hypothesis the claimed word is independent of it,
//! and one reading is paid for, however many were looked at. A mark makes the logits of the right reading large ([`score`]),
//! and pictures of one scene carry the same message, so that the right readings of several agree ([`joint`]).
mod candidates;
mod finer;
mod joint;
mod parts;
mod prior;
mod reader;
mod score;
mod search;
mod sweep;
#[cfg(test)]
mod tests;

use std::fmt;

use super::Engine;
use super::photometric::{ToneChange, ground};
use super::restore::Restored;
use crate::error::Result;
use crate::picture::Picture;
use candidates::Search;
pub(super) use joint::chosen;
use parts::{Part, parts};

/// Corrected pictures, or histograms, that are in memory together: a thousand pictures are a gigabyte.
const BATCH: usize = 64;
/// Places from which a search is refined, unless one is clear before.
const STARTS: usize = 2;
/// Pictures read before whose changes are tried, the last ones.
const HINTS: usize = 8;

/// What may have been done to a picture, and what is read once it is undone.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    part: Part,
    white: bool,
    change: ToneChange,
    logits: Vec<f32>,
    score: f64,
}

/// The best candidates for what was done to a picture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BlindReading {
    bits: usize,
    candidates: Vec<Candidate>,
    is_clear: bool,
    windows: Vec<Vec<f32>>,
}

impl Candidate {
    /// Logits of the picture once this is undone.
    pub fn logits(&self) -> &[f32] {
        &self.logits
    }

    /// Whether it is of another part, or so far from another candidate that a refinement of one would not find the other.
    fn lies_apart_from(&self, other: &Self) -> bool {
        self.part != other.part || sweep::apart(&self.change, &other.change)
    }
}

/// A part of the picture `whole` before that was done to it, its ground made white where it shows one; `None` where it can't
/// have been done.
fn undone_on_white(change: &ToneChange, part: &Picture, whole: &Picture) -> Option<Picture> {
    change.undone(part, whole).map(ground::on_white)
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
            Part::WithoutBackdrop => f.write_str(", without its backdrop"),
            Part::Window(window) => write!(f, ", {window}"),
        }
    }
}

impl BlindReading {
    /// Reads a picture, and looks for what was done to it. What was done to `others` of the same suspect is tried, too.
    ///
    /// # Errors
    /// A picture without pixels, a failing device, or [`Error::Stopped`](crate::Error::Stopped).
    pub fn read(engine: &Engine, restored: &Restored<'_>, others: &[&Self]) -> Result<Self> {
        let whole = engine.resized(&restored.picture)?;
        let parts = parts(engine, restored, &whole)?;
        let mut search = Search::of_parts(engine, &whole, &parts)?;
        let hints = others.iter().rev().filter_map(|other| other.candidates.first());
        let hints: Vec<ToneChange> = hints.take(HINTS).map(|candidate| candidate.change).collect();
        // The whole, or what is within its borders.
        search.sweep(0, &hints)?;
        search.refine(STARTS)?;
        let backdrop = parts.iter().position(|(part, _)| *part == Part::WithoutBackdrop);
        let promising = search.promising().filter(|place| Some(*place) != backdrop);
        for place in [backdrop, promising].into_iter().flatten() {
            if search.is_clear() {
                break;
            }
            search.sweep(place, &hints)?;
            search.refine(1)?;
        }
        Ok(Self {
            bits: engine.bits,
            is_clear: search.is_certain(),
            windows: search.windows(),
            candidates: finer::read(engine, restored, &whole, search.best())?,
        })
    }

    /// Logits of its windows as they are, in their order; none of a picture that is too small for them.
    pub fn windows(&self) -> &[Vec<f32>] {
        &self.windows
    }

    /// The best candidates, best first.
    pub fn candidates(&self) -> impl Iterator<Item = &Candidate> {
        self.candidates.iter()
    }

    /// Whether the best candidate is one that wrong ones never come near to: then what was done need not be guessed.
    pub fn is_clear(&self) -> bool {
        self.is_clear
    }
}
