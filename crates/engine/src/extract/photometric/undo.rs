//! Undoes a change of tones: pixels by blocks, whose channels fill vector registers.
use super::change::ToneChange;
use super::curve;
use super::tone::GREY;
use crate::power::power_of;
use crate::simd::Vectorised;

/// Values this near to black or white were cut there by what was done, and say nothing of what they had been.
pub(super) const CUT: f32 = 0.5 / 255.0;
/// The same of values that were averaged or compressed since.
const NEARLY_CUT: f32 = 1.5 / 255.0;
/// Where undoing moves a value that was cut by more than this, nobody knows what it had been. Its colour is made white, which
/// says nothing: as one colour of many pixels it would say something wrong.
const UNKNOWN: f32 = 4.0 / 255.0;
/// How far beyond black and white a change may have put values: what compression does besides.
const BEYOND: f32 = 0.03;
/// What black may have become at least and at most.
const MOST_FADED: [f32; 2] = [-0.5, 0.5];
/// Pixels of a block.
const BLOCK: usize = 64;

/// Red, green and blue of some pixels.
type Channels<const N: usize> = [[f32; N]; 3];

/// What undoes a change, worked out once for all pixels. A part that was not done is `None`.
#[derive(Clone, Copy)]
pub(super) struct Before {
    /// The mean grey, and one over the contrast.
    contrast: Option<(f32, f32)>,
    /// One over the saturation.
    saturation: Option<f32>,
    /// Of a curve.
    bend: Option<f32>,
    /// What black became in each channel, and one over how far it is from white then.
    fades: Option<[(f32, f32); 3]>,
    /// One over gamma.
    exponent: Option<f64>,
    /// One over each gain.
    gains: [f32; 3],
}

impl Before {
    /// Of a picture with this mean grey before its contrast was changed.
    pub fn new(change: &ToneChange, mean: f32) -> Self {
        let done = |place: usize| Some(change.coordinates[place]).filter(|amount| *amount != 0.0);
        let inverse = |log: f32| (-log).exp();
        let [least, most] = MOST_FADED;
        let fade = |black: f32| {
            let black = black.clamp(least, most);
            (black, 1.0 / (1.0 - black))
        };
        Self {
            contrast: done(ToneChange::CONTRAST).map(|log| (mean, inverse(log))),
            saturation: done(ToneChange::SATURATION).map(inverse),
            bend: done(ToneChange::BEND).map(curve::limited),
            fades: change.is_fade().then(|| change.fades().map(fade)),
            exponent: done(ToneChange::GAMMA).map(|log| f64::from(-log).exp()),
            gains: ToneChange::GAINS.map(|place| inverse(change.coordinates[place])),
        }
    }

    /// A colour before the change was done to it, not cut; what was cut when it was done stays cut.
    pub fn of(&self, colour: [f32; 3]) -> [f32; 3] {
        let mut channels = colour.map(|v| [v]);
        self.undo(&mut channels);
        channels.map(|[v]| v)
    }

    /// The same of many colours.
    #[inline(always)]
    fn undo<const N: usize>(&self, channels: &mut Channels<N>) {
        if let Some((mean, contrast)) = self.contrast {
            for v in channels.as_flattened_mut() {
                *v = mean + (*v - mean) * contrast;
            }
        }
        if let Some(saturation) = self.saturation {
            let [red, green, blue] = channels;
            for ((red, green), blue) in red.iter_mut().zip(green).zip(blue) {
                let grey = *red * GREY[0] + *green * GREY[1] + *blue * GREY[2];
                *red = grey + (*red - grey) * saturation;
                *green = grey + (*green - grey) * saturation;
                *blue = grey + (*blue - grey) * saturation;
            }
        }
        if let Some(bend) = self.bend {
            for v in channels.as_flattened_mut() {
                *v = curve::before(*v, bend);
            }
        }
        if let Some(fades) = self.fades {
            for (channel, (black, stretched)) in channels.iter_mut().zip(fades) {
                channel.iter_mut().for_each(|v| *v = (*v - black) * stretched);
            }
        }
        if let Some(exponent) = self.exponent {
            for v in channels.as_flattened_mut() {
                *v = power_of(if *v > 0.0 { *v } else { 0.0 }, exponent);
            }
        }
        for (channel, gain) in channels.iter_mut().zip(self.gains) {
            channel.iter_mut().for_each(|v| *v *= gain);
        }
    }
}

/// Undoes a change, makes white what was cut by it, and counts values that it can't have been done to. Nothing is fused: the
/// bytes are the same on every instruction set of an architecture.
pub(super) struct Undo<'a> {
    pub before: Before,
    pub pixels: &'a [[f32; 3]],
    /// How often each is there; once where that is not given.
    pub counts: Option<&'a [f32]>,
    pub out: &'a mut [[f32; 3]],
}

impl Vectorised for Undo<'_> {
    type Output = f32;

    #[inline(always)]
    fn run<const FUSED: bool>(self) -> f32 {
        let mut outside = [0.0; BLOCK];
        let mut times = [1.0; BLOCK];
        for (block, (out, pixels)) in self.out.chunks_mut(BLOCK).zip(self.pixels.chunks(BLOCK)).enumerate() {
            if let Some(counts) = self.counts {
                let counts = &counts[block * BLOCK..][..pixels.len()];
                times[..counts.len()].copy_from_slice(counts);
            }
            let mut now: Channels<BLOCK> = [[0.0; BLOCK]; 3];
            for (k, pixel) in pixels.iter().enumerate() {
                (0..3).for_each(|c| now[c][k] = pixel[c]);
            }
            let mut was = now;
            self.before.undo(&mut was);
            let mut lost = [0.0_f32; BLOCK];
            // What a block is filled up with is black, which counts as cut.
            for (now, was) in now.iter().zip(&mut was) {
                for k in 0..BLOCK {
                    let seen = (now[k] > CUT) & (now[k] < 1.0 - CUT);
                    let possible = (was[k] >= -BEYOND) & (was[k] <= 1.0 + BEYOND);
                    outside[k] += if seen & !possible { times[k] } else { 0.0 };
                    was[k] = was[k].clamp(0.0, 1.0);
                    let sure = (now[k] > NEARLY_CUT) & (now[k] < 1.0 - NEARLY_CUT);
                    let is_lost = !sure & ((was[k] - now[k]).abs() > UNKNOWN);
                    lost[k] = if is_lost { 1.0 } else { lost[k] };
                }
            }
            for (k, out) in out.iter_mut().enumerate() {
                *out = [0, 1, 2].map(|c| was[c][k].max(lost[k]));
            }
        }
        outside.iter().sum()
    }
}
