//! Changes of tones that are tried: along each coordinate, tints, and what a ground tells.
use crate::extract::photometric::{COORDINATES, ToneChange};

/// What is swept, from where to where, and in what steps; of gains and of what is told by its factor, logarithms. A step moves
/// colours by about a hundredth. First what is common to all channels.
const SWEPT: [Sweep; 9] = [
    sweep(&ToneChange::GAINS, [-0.7, 0.5]),
    sweep(&[ToneChange::GAMMA], [-0.36, 0.36]),
    sweep(&[ToneChange::SATURATION], [-0.36, 0.36]),
    sweep(&[ToneChange::CONTRAST], [-0.36, 0.36]),
    sweep(&[ToneChange::BEND], [-0.42, 0.84]),
    sweep(&ToneChange::FADES, [-0.3, 0.3]),
    sweep(&[ToneChange::GAINS[0]], TINT),
    sweep(&[ToneChange::GAINS[1]], TINT),
    sweep(&[ToneChange::GAINS[2]], TINT),
];
/// Those of them that are common to all channels and do not make white another colour.
const WHITE_STAYS: std::ops::Range<usize> = 1..6;
/// Steps of sweeps along each coordinate.
const STEPS: [f32; COORDINATES] = [0.02, 0.02, 0.02, 0.03, 0.04, 0.03, 0.06, 0.02, 0.02, 0.02];
/// Fades of one channel, which are looked at about a fade only.
const FADES: [Sweep; 3] = [
    sweep(&[ToneChange::FADES[0]], [0.0; 2]),
    sweep(&[ToneChange::FADES[1]], [0.0; 2]),
    sweep(&[ToneChange::FADES[2]], [0.0; 2]),
];
/// How far a single gain is swept.
const TINT: [f32; 2] = [-0.08, 0.08];
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
/// Largest gain, a logarithm, of a channel whose ground is white beside others whose is not.
const CUT: f32 = 0.24;
/// Bends and blacks of filters, from where to where, and steps of gains: where at most one channel was cut, and where two were.
const ONE_CUT: Filters = Filters {
    bends: ([-0.3, 0.6], 0.1),
    blacks: ([0.0, 0.12], 0.03),
    gain: 0.02,
};
const TWO_CUT: Filters = Filters {
    bends: ([-0.15, 0.6], 0.15),
    blacks: ([0.0, 0.1], 0.05),
    gain: 0.04,
};

/// What filters are tried: ranges with their steps, and the step of gains that a ground does not tell.
struct Filters {
    bends: ([f32; 2], f32),
    blacks: ([f32; 2], f32),
    gain: f32,
}

/// A direction in which what was done may lie.
#[derive(Clone, Copy)]
pub(super) struct Sweep {
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
    /// A change, moved by so many steps.
    pub fn moved(&self, change: &ToneChange, steps: f32) -> ToneChange {
        change.moved(&self.direction, steps * self.step)
    }

    /// All steps from a change but itself.
    fn from(self, start: ToneChange) -> impl Iterator<Item = ToneChange> {
        let distances = values((self.reach, self.step)).filter(|distance| *distance != 0.0);
        distances.map(move |distance| start.moved(&self.direction, distance))
    }
}

/// The directions in which a refinement looks about a change.
pub(super) fn about(change: &ToneChange) -> impl Iterator<Item = &'static Sweep> {
    let single: &[Sweep] = if change.is_fade() { &FADES } else { &[] };
    SWEPT.iter().chain(single)
}

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
    let change = |steps: [i32; 3]| ToneChange::of_gains(steps.map(|steps| steps as f32 * GRID));
    (first..=last).flat_map(tints).map(change).collect()
}

/// Tints under which the `cut` channels of a ground stayed white, for what was beyond was cut, and the others did not, alone
/// and with a curve and a fade as filters have them. `anchor` makes a change fit the ground: of the channels that are not cut
/// it tells the gain, those of the others are tried.
pub(super) fn filters(anchor: &dyn Fn(ToneChange) -> ToneChange, cut: [bool; 3]) -> Vec<ToneChange> {
    let tried = if cut.iter().filter(|cut| **cut).count() < 2 {
        ONE_CUT
    } else {
        TWO_CUT
    };
    let none = ToneChange::default();
    let shapes =
        values(tried.bends).flat_map(|bend| values(tried.blacks).map(move |black| ToneChange::of_shape(bend, black)));
    let shapes = shapes.filter(|shape| *shape != none);
    let shaped = shapes.flat_map(|shape| gains_of(anchor(shape), cut, tried.gain));
    let tinted = gains_of(anchor(none), cut, STEPS[ToneChange::GAINS[0]]);
    tinted.into_iter().chain(shaped).collect()
}

/// All values of a range, in steps.
fn values(([first, last], step): ([f32; 2], f32)) -> impl Iterator<Item = f32> {
    let [first, last] = [first, last].map(|end| (end / step).round() as i16);
    (first..=last).map(move |i| f32::from(i) * step)
}

/// A change with all gains of some channels from what they are on, up to [`CUT`], in steps.
fn gains_of(change: ToneChange, channels: [bool; 3], step: f32) -> Vec<ToneChange> {
    let count = (CUT / step).round() as u16 + 1;
    let mut all = vec![change];
    for (place, _) in ToneChange::GAINS.into_iter().zip(channels).filter(|(_, cut)| *cut) {
        let more = |change: &ToneChange, i: u16| {
            let mut change = *change;
            change.coordinates[place] += f32::from(i) * step;
            change
        };
        all = all
            .iter()
            .flat_map(|change| (0..count).map(|i| more(change, i)))
            .collect();
    }
    all
}

/// Colours laid over a picture, of all thicknesses, which a ground of this colour tells.
pub(super) fn overlays(ground: [f32; 3]) -> impl Iterator<Item = ToneChange> {
    let shares = (1..=OVERLAYS).map(|i| f32::from(i) * STEPS[ToneChange::FADES[0]]);
    shares.filter_map(move |share| ToneChange::overlay(ground, share))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::Picture;

    /// The picture after a tint, and a curve and a fade of all channels, cut to [0, 1].
    fn filtered(tint: [f32; 3], bend: f32, black: f32) -> Picture {
        let tau = std::f32::consts::TAU;
        let after = |v: f32| black + (1.0 - black) * v;
        let bent = |v: f32| v - bend * (tau * v).sin() / tau;
        // A scene of greys on a white ground.
        let before = (0..64).map(|i| if i < 32 { 1.0 } else { 0.2 + 0.01 * i as f32 });
        Picture {
            width: 8,
            height: 8,
            pixels: before
                .flat_map(|v| tint.map(|gain| bent(after((gain * v).min(1.0)))))
                .collect(),
        }
    }

    #[test]
    fn a_filter_is_near_one_of_those_tried() {
        for (tint, bend, black) in [
            ([1.08, 1.0, 0.9], 0.3, 0.05),
            ([0.92, 0.97, 1.06], 0.45, 0.08),
            ([0.95, 0.9, 0.85], -0.2, 0.0),
            ([1.15, 1.1, 0.95], 0.0, 0.0),
        ] {
            let picture = filtered(tint, bend, black);
            let ground = [picture.pixels[0], picture.pixels[1], picture.pixels[2]];
            let anchor = |change: ToneChange| change.with_white(ground, &picture);
            let cut = std::array::from_fn(|c| ground[c] > 0.985);
            let tried = filters(&anchor, cut);
            let mut done = ToneChange::of_shape(bend, black);
            done.coordinates[..3].copy_from_slice(&tint.map(f32::ln));
            let nearest = tried
                .iter()
                .map(|change| distance(change, &done))
                .fold(f32::MAX, f32::min);
            assert!(nearest < 2.0 * APART, "{tint:?} {bend} {black}: {nearest}");
            // None is tried twice.
            for (i, change) in tried.iter().enumerate() {
                assert!(!tried[..i].contains(change), "{change}");
            }
        }
    }

    #[test]
    fn a_colour_laid_over_a_picture_is_near_one_of_those_tried() {
        let (share, over) = (0.15, [0.8, 0.85, 1.0]);
        let ground = over.map(|v| 1.0 - share + share * v);
        let done = ToneChange::overlay(ground, share).unwrap();
        let nearest = overlays(ground)
            .map(|change| distance(&change, &done))
            .fold(f32::MAX, f32::min);
        assert!(nearest < APART, "{nearest}");
        assert_eq!(overlays([0.3, 1.0, 1.0]).count(), 0);
    }
}
