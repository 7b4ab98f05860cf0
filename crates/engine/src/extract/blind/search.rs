//! The search for what was done to the tones of one part of a picture: changes are read, and the best of them refined.
use super::prior::Prior;
use super::score;
use super::sweep::{self, Sweep};
use crate::error::Result;
use crate::extract::photometric::ToneChange;

/// Rounds of a refinement.
const ROUNDS: usize = 5;
/// How often steps may shrink because nothing was better.
const SHRUNK: usize = 3;

/// A change of tones, and what is read once it is undone.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Read {
    pub change: ToneChange,
    pub logits: Vec<f32>,
    pub score: f64,
}

/// Logits of a picture with each of these changes undone; `None` where one can't have been done to it.
pub(super) type Reader<'a> = dyn FnMut(&[ToneChange]) -> Result<Vec<Option<Vec<f32>>>> + 'a;

/// Changes that could have been done, read.
///
/// # Errors
/// Those of the reader.
pub(super) fn tried(read: &mut Reader<'_>, prior: &Prior<'_>, changes: &[ToneChange]) -> Result<Vec<Read>> {
    let logits = read(changes)?;
    let scored = changes.iter().zip(logits).filter_map(|(change, logits)| {
        let logits = logits?;
        let score = score::of_logits(&logits) - prior.cost(change);
        score.is_finite().then_some(Read {
            change: *change,
            logits,
            score,
        })
    });
    Ok(scored.collect())
}

/// All that is read on the way from a start to where no step is better.
///
/// # Errors
/// Those of the reader.
pub(super) fn refined(read: &mut Reader<'_>, prior: &Prior<'_>, start: Read) -> Result<Vec<Read>> {
    let mut best = start;
    let (mut scale, mut shrunk) = (1.0, 0);
    let mut all = Vec::new();
    for _ in 0..ROUNDS {
        let directions: Vec<&Sweep> = sweep::about(&best.change).collect();
        let sides = directions
            .iter()
            .flat_map(|sweep| [-1.0, 1.0].map(|side| sweep.moved(&best.change, side * scale)));
        let sides: Vec<ToneChange> = sides.collect();
        let mut found = tried(read, prior, &sides)?;
        // Where a parabola through three points of each direction is highest: all at once, half and a quarter of the way.
        let mut vertex = ToneChange::default();
        for (sweep, sides) in directions.iter().zip(sides.as_chunks::<2>().0) {
            let at = |side: ToneChange| found.iter().find(|read| read.change == side).map(|read| read.score);
            let top = at(sides[0])
                .zip(at(sides[1]))
                .map_or(0.0, |(low, high)| top(low, best.score, high));
            vertex = sweep.moved(&vertex, top * scale);
        }
        let jumps = [1.0, 0.5, 0.25].map(|share| best.change.moved(&vertex.coordinates, share));
        found.extend(tried(read, prior, &jumps)?);
        let better = found.iter().filter(|read| read.score > best.score);
        match better.max_by(|a, b| a.score.total_cmp(&b.score)) {
            Some(better) => best = better.clone(),
            None if shrunk == SHRUNK => break,
            None => (scale, shrunk) = (scale / 2.0, shrunk + 1),
        }
        all.extend(found);
    }
    Ok(all)
}

/// Where a parabola through these values at -1, 0 and 1 is highest, within a step and a half.
fn top(low: f64, middle: f64, high: f64) -> f32 {
    let (slope, bend) = ((high - low) / 2.0, low - 2.0 * middle + high);
    let top = match bend < 0.0 {
        true => -slope / bend,
        false => slope.signum(),
    };
    top.clamp(-1.5, 1.5) as f32
}
