//! Undoes a change of tones: each pixel for itself, eight or more a register.
use super::change::ToneChange;
use super::curve;
use super::tone::grey;
use crate::simd::Vectorised;

/// Values this near to black or white were cut there by what was done, and say nothing of what they had been.
pub(super) const CUT: f32 = 0.5 / 255.0;
/// How far beyond black and white a change may have put values: what compression does besides.
const BEYOND: f32 = 0.03;
/// What black may have become at least and at most.
const MOST_FADED: [f32; 2] = [-0.5, 0.5];

/// What undoes a change, worked out once for all pixels.
#[derive(Clone, Copy)]
pub(super) struct Before {
    mean: f32,
    contrast: f32,
    saturation: f32,
    /// Of a curve, where there was one.
    bend: Option<f32>,
    /// What black became in each channel.
    blacks: [f32; 3],
    /// One over gamma, where that was changed.
    exponent: Option<f32>,
    gains: [f32; 3],
}

impl Before {
    /// Of a picture with this mean grey before its contrast was changed.
    pub fn new(change: &ToneChange, mean: f32) -> Self {
        let factors = change.coordinates.map(f32::exp);
        let bend = change.coordinates[ToneChange::BEND];
        let [least, most] = MOST_FADED;
        Self {
            mean,
            contrast: factors[ToneChange::CONTRAST],
            saturation: factors[ToneChange::SATURATION],
            bend: (bend != 0.0).then(|| curve::limited(bend)),
            blacks: change.fades().map(|black| black.clamp(least, most)),
            exponent: (change.coordinates[ToneChange::GAMMA] != 0.0).then_some(1.0 / factors[ToneChange::GAMMA]),
            gains: ToneChange::GAINS.map(|place| factors[place]),
        }
    }

    /// Values before the change was done to them, not cut; what was cut when it was done stays cut.
    #[inline(always)]
    pub fn of(&self, now: [f32; 3]) -> [f32; 3] {
        let mut pixel = now;
        for v in &mut pixel {
            *v = self.mean + (*v - self.mean) / self.contrast;
        }
        let grey = grey(&pixel);
        for v in &mut pixel {
            *v = grey + (*v - grey) / self.saturation;
        }
        if let Some(bend) = self.bend {
            for v in &mut pixel {
                *v = curve::before(*v, bend);
            }
        }
        for (v, black) in pixel.iter_mut().zip(self.blacks) {
            *v = (*v - black) / (1.0 - black);
        }
        if let Some(exponent) = self.exponent {
            for v in &mut pixel {
                *v = v.max(0.0).powf(exponent);
            }
        }
        for (v, gain) in pixel.iter_mut().zip(self.gains) {
            *v /= gain;
        }
        pixel
    }
}

/// Undoes a change, and counts values that it can't have been done to.
pub(super) struct Undo<'a> {
    pub before: Before,
    pub pixels: &'a [[f32; 3]],
    pub out: &'a mut [[f32; 3]],
}

impl Vectorised for Undo<'_> {
    type Output = usize;

    #[inline(always)]
    fn run<const FUSED: bool>(self) -> usize {
        let before = self.before;
        // Apart, so that loops without powers have no calls, and those without a curve no iterations.
        let without_power = Before {
            exponent: None,
            ..before
        };
        let plain = Before {
            bend: None,
            ..without_power
        };
        match (before.exponent, before.bend) {
            (None, None) => self.each(plain),
            (None, Some(_)) => self.each(without_power),
            (Some(_), _) => self.each(before),
        }
    }
}

impl Undo<'_> {
    #[inline(always)]
    fn each(self, before: Before) -> usize {
        let mut outside = 0_u32;
        for (out, now) in self.out.iter_mut().zip(self.pixels) {
            let was = before.of(*now);
            for c in 0..3 {
                let seen = (now[c] > CUT) & (now[c] < 1.0 - CUT);
                let possible = (was[c] >= -BEYOND) & (was[c] <= 1.0 + BEYOND);
                outside += u32::from(seen & !possible);
                out[c] = was[c].clamp(0.0, 1.0);
            }
        }
        outside as usize
    }
}
