//! The search for what was done to the tones of one part of a picture: sweeps, and a refinement of the best of them.
use super::prior::Prior;
use super::score;
use crate::error::Result;
use crate::extract::photometric::{COORDINATES, ToneChange};

/// What is swept, from where to where, and in what steps; of gains and of what is told by its factor, logarithms. A step moves
/// colours by about a hundredth. First what is common to all channels.
const SWEPT: [Sweep; 9] = [
    sweep(&[0, 1, 2], [-0.7, 0.5]),
    sweep(&[3], [-0.36, 0.36]),
    sweep(&[4], [-0.36, 0.36]),
    sweep(&[5], [-0.36, 0.36]),
    sweep(&[6], [-0.42, 0.84]),
    sweep(&[7, 8, 9], [-0.3, 0.3]),
    sweep(&[0], [-0.08, 0.08]),
    sweep(&[1], [-0.08, 0.08]),
    sweep(&[2], [-0.08, 0.08]),
];
/// Those of them that are common to all channels and do not make white another colour.
const WHITE_STAYS: std::ops::Range<usize> = 1..6;
/// Steps of sweeps along each coordinate.
const STEPS: [f32; COORDINATES] = [0.02, 0.02, 0.02, 0.03, 0.04, 0.03, 0.06, 0.02, 0.02, 0.02];
/// Fades of one channel, which are looked at in the refinement of a fade only.
const FADES: [Sweep; 3] = [sweep(&[7], [0.0; 2]), sweep(&[8], [0.0; 2]), sweep(&[9], [0.0; 2])];
/// Shares of a colour that may have been laid over a picture: steps of a fade, so many.
const OVERLAYS: u8 = 20;
/// How far from each other starts lie at least, in such steps.
const APART: f32 = 2.5;
/// Step of the gains that are tried together, and how many steps a tint goes either way: the second where brightness is
/// nearly what it was.
const GRID: f32 = 0.04;
const TINTS: [i32; 2] = [2, 3];
/// Steps of brightness up to which it nearly is.
const NEARLY: i32 = 2;
/// Gains of channels whose ground is white beside others whose is not: from 1 in steps of sweeps, so many.
const CUT: u32 = 12;
/// Rounds of a refinement.
const ROUNDS: usize = 5;
/// How often steps may shrink because nothing was better.
const SHRUNK: usize = 3;

/// A direction in which what was done may lie.
#[derive(Clone, Copy)]
struct Sweep {
    direction: [f32; COORDINATES],
    reach: [f32; 2],
    step: f32,
}

/// Along these coordinates at once, which have one step.
const fn sweep(along: &[usize], reach: [f32; 2]) -> Sweep {
    let (mut direction, mut i) = ([0.0; COORDINATES], 0);
    while i < along.len() {
        direction[along[i]] = 1.0;
        i += 1;
    }
    Sweep {
        direction,
        reach,
        step: STEPS[along[0]],
    }
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

/// A change of tones, and what is read once it is undone.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Read {
    pub change: ToneChange,
    pub logits: Vec<f32>,
    pub score: f64,
}

/// Logits of a picture with each of these changes undone; `None` where one can't have been done to it.
pub(super) type Reader<'a> = dyn FnMut(&[ToneChange]) -> Result<Vec<Option<Vec<f32>>>> + 'a;

/// Changes along each coordinate, nothing done first. `anchor` makes a change fit a ground that had been white, if there
/// is one that is not.
pub(super) fn lines(anchor: Option<&dyn Fn(ToneChange) -> ToneChange>) -> Vec<ToneChange> {
    let none = ToneChange::default();
    let mut changes = vec![none];
    changes.extend(SWEPT.iter().flat_map(|sweep| sweep.from(none)));
    if let Some(anchor) = anchor {
        changes.push(anchor(none));
        changes.extend(SWEPT[WHITE_STAYS].iter().flat_map(|sweep| sweep.from(none)).map(anchor));
    }
    changes
}

/// Brightness with every tint, which lines miss: [`lines`] find a change of one kind only.
pub(super) fn tinted() -> Vec<ToneChange> {
    let [first, last] = SWEPT[0].reach.map(|end| (end / GRID).round() as i32);
    let tints = |brightness: i32| {
        let most = TINTS[usize::from(brightness.abs() <= NEARLY)];
        (-most..=most)
            .flat_map(move |red| (-most..=most).map(move |blue| [brightness + red, brightness, brightness + blue]))
    };
    let change = |steps: [i32; 3]| gains(steps.map(|steps| steps as f32 * GRID));
    (first..=last).flat_map(tints).map(change).collect()
}

/// A tint under which some channels of a ground stayed white, for what was beyond was cut, and others did not: these tell
/// their gain, the logarithms in `told`, and those of the others are tried. None where all channels or none tell.
pub(super) fn half_told(told: [Option<f32>; 3]) -> Vec<ToneChange> {
    let silent = told.iter().filter(|gain| gain.is_none()).count() as u32;
    if silent == 0 || silent == 3 {
        return Vec::new();
    }
    let change = |number: u32| {
        let mut left = number;
        gains(told.map(|gain| {
            gain.unwrap_or_else(|| {
                let steps = left % (CUT + 1);
                left /= CUT + 1;
                steps as f32 * STEPS[0]
            })
        }))
    };
    (0..(CUT + 1).pow(silent)).map(change).collect()
}

/// Colours laid over a picture, of all thicknesses, which a ground of this colour tells.
pub(super) fn overlays(ground: [f32; 3]) -> impl Iterator<Item = ToneChange> {
    let shares = (1..=OVERLAYS).map(|i| f32::from(i) * STEPS[COORDINATES - 1]);
    shares.filter_map(move |share| ToneChange::overlay(ground, share))
}

/// The channels multiplied, by the exponentials of these.
fn gains(logs: [f32; 3]) -> ToneChange {
    let mut change = ToneChange::default();
    change.coordinates[..3].copy_from_slice(&logs);
    change
}

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

/// How far two changes are from each other, in steps of sweeps.
pub(super) fn distance(a: &ToneChange, b: &ToneChange) -> f32 {
    let pairs = a.coordinates.iter().zip(b.coordinates).zip(STEPS);
    pairs.map(|((a, b), step)| ((a - b) / step).powi(2)).sum::<f32>().sqrt()
}

/// Whether two changes are so far from each other that a refinement of one would not find the other.
pub(super) fn apart(a: &ToneChange, b: &ToneChange) -> bool {
    distance(a, b) > APART
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
        let single = if best.change.is_fade() { &FADES[..] } else { &[] };
        let sides: Vec<ToneChange> = (SWEPT.iter().chain(single))
            .flat_map(|sweep| [-1.0, 1.0].map(|side| best.change.moved(&sweep.direction, side * scale * sweep.step)))
            .collect();
        let mut found = tried(read, prior, &sides)?;
        // Where a parabola through three points of each direction is highest: all at once, half and a quarter of the way.
        let mut vertex = ToneChange::default();
        for (sweep, sides) in SWEPT.iter().chain(single).zip(sides.as_chunks::<2>().0) {
            let at = |side: ToneChange| found.iter().find(|read| read.change == side).map(|read| read.score);
            let top = at(sides[0])
                .zip(at(sides[1]))
                .map_or(0.0, |(low, high)| top(low, best.score, high));
            vertex = vertex.moved(&sweep.direction, top * scale * sweep.step);
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
