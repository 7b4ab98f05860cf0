//! The search for what was done to the tones of one part of a picture: sweeps, and a refinement of the best of them.
use super::score;
use crate::error::Result;
use crate::extract::photometric::{COORDINATES, ToneChange};

/// What is swept, a coordinate or several at once, from where to where, and in what steps; logarithms. A step moves colours
/// by about a hundredth.
const SWEPT: [Sweep; 7] = [
    sweep([1.0, 1.0, 1.0, 0.0, 0.0, 0.0], [-0.7, 0.5], 0.02),
    sweep([0.0, 0.0, 0.0, 1.0, 0.0, 0.0], [-0.36, 0.36], 0.03),
    sweep([0.0, 0.0, 0.0, 0.0, 1.0, 0.0], [-0.36, 0.36], 0.04),
    sweep([0.0, 0.0, 0.0, 0.0, 0.0, 1.0], [-0.36, 0.36], 0.03),
    sweep([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [-0.08, 0.08], 0.02),
    sweep([0.0, 1.0, 0.0, 0.0, 0.0, 0.0], [-0.08, 0.08], 0.02),
    sweep([0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [-0.08, 0.08], 0.02),
];
/// Places from which a search is refined.
const STARTS: usize = 3;
/// How far from each other starts lie at least, in steps of sweeps.
const APART: f32 = 2.5;
/// Rounds of a refinement.
const ROUNDS: usize = 6;
/// How much steps shrink when nothing is better.
const SHRINK: f32 = 0.5;
/// Candidates that are kept.
const KEPT: usize = 12;

/// A direction in which what was done may lie.
#[derive(Clone, Copy)]
struct Sweep {
    direction: [f32; COORDINATES],
    reach: [f32; 2],
    step: f32,
}

const fn sweep(direction: [f32; COORDINATES], reach: [f32; 2], step: f32) -> Sweep {
    Sweep { direction, reach, step }
}

/// A change of tones, and what is read once it is undone.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Read {
    pub change: ToneChange,
    pub logits: Vec<f32>,
    pub score: f64,
}

/// Reads a picture with each of these changes undone; `None` where one can't have been done to it.
pub(super) type Reader<'a> = dyn FnMut(&[ToneChange]) -> Result<Vec<Option<Vec<f32>>>> + 'a;

/// The best readings, best first; nothing done is among those tried. `anchor` makes a change fit a ground that had been
/// white, if there is one.
///
/// # Errors
/// Those of the reader.
pub(super) fn search(read: &mut Reader<'_>, anchor: Option<&dyn Fn(ToneChange) -> ToneChange>) -> Result<Vec<Read>> {
    let none = ToneChange::default();
    let mut swept = vec![none];
    swept.extend(SWEPT.iter().flat_map(|sweep| sweep.from(none)));
    if let Some(anchor) = anchor {
        swept.push(anchor(none));
        swept.extend(SWEPT[1..4].iter().flat_map(|sweep| sweep.from(none)).map(anchor));
    }
    let mut found = tried(read, &swept)?;
    for start in starts(&found) {
        found.extend(refined(read, start)?);
    }
    sort(&mut found);
    found.dedup_by(|a, b| a.change == b.change);
    found.truncate(KEPT);
    Ok(found)
}

impl Sweep {
    /// All steps from a change but itself.
    fn from(&self, start: ToneChange) -> impl Iterator<Item = ToneChange> {
        let Self { direction, reach, step } = *self;
        let [first, last] = reach.map(|end| (end / step).round() as i32);
        let steps = (first..=last).filter(|i| *i != 0);
        steps.map(move |i| start.moved(&direction, i as f32 * step))
    }
}

/// Changes that could have been done, read.
fn tried(read: &mut Reader<'_>, changes: &[ToneChange]) -> Result<Vec<Read>> {
    let logits = read(changes)?;
    let scored = changes.iter().zip(logits).filter_map(|(change, logits)| {
        let logits = logits?;
        let score = score::of_logits(&logits) - score::cost(change);
        score.is_finite().then_some(Read {
            change: *change,
            logits,
            score,
        })
    });
    Ok(scored.collect())
}

/// The best first; of equal ones that which came first.
fn sort(found: &mut [Read]) {
    found.sort_by(|a, b| b.score.total_cmp(&a.score));
}

/// The best that lie apart.
fn starts(found: &[Read]) -> Vec<Read> {
    let mut sorted = found.to_vec();
    sort(&mut sorted);
    let mut starts: Vec<Read> = Vec::new();
    for read in sorted {
        if starts.iter().all(|other| apart(&read.change, &other.change) > APART) {
            starts.push(read);
        }
        if starts.len() == STARTS {
            break;
        }
    }
    starts
}

/// Distance of two changes in steps of sweeps.
fn apart(a: &ToneChange, b: &ToneChange) -> f32 {
    let steps = [0.02, 0.02, 0.02, 0.03, 0.04, 0.03];
    let squares = a.logs.iter().zip(b.logs).zip(steps).map(|((a, b), step)| ((a - b) / step).powi(2));
    squares.sum::<f32>().sqrt()
}

/// All that is read on the way from a start to where no step is better.
fn refined(read: &mut Reader<'_>, start: Read) -> Result<Vec<Read>> {
    let mut best = start;
    let mut scale = 1.0;
    let mut all = Vec::new();
    for _ in 0..ROUNDS {
        let sides: Vec<ToneChange> = SWEPT
            .iter()
            .flat_map(|sweep| [-1.0, 1.0].map(|side| best.change.moved(&sweep.direction, side * scale * sweep.step)))
            .collect();
        let found = tried(read, &sides)?;
        // Where a parabola through three points of each direction is highest, all at once and half of the way.
        let mut vertex = ToneChange::default();
        for (place, sweep) in SWEPT.iter().enumerate() {
            let at = |side: usize| {
                let change = sides[2 * place + side];
                found.iter().find(|read| read.change == change).map(|read| read.score)
            };
            let distance = at(0).zip(at(1)).map_or(0.0, |(low, high)| top(low, best.score, high));
            vertex = vertex.moved(&sweep.direction, distance * scale * sweep.step);
        }
        let jumps = [1.0, 0.5].map(|share| best.change.moved(&vertex.logs, share));
        let mut found = [found, tried(read, &jumps)?].concat();
        sort(&mut found);
        match found.first() {
            Some(better) if better.score > best.score => best = better.clone(),
            _ => scale *= SHRINK,
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
