//! What a change of tones must gain to be believed, in logarithms of the size of logits.
//!
//! The size of logits is largest a little beside the truth, and plain colours have large ones under some wrong change. Most
//! people change one thing or nothing; and what had been a white or black ground tells what can hardly have been done to it.
use crate::extract::photometric::{ToneChange, ground};
use crate::picture::Picture;

/// A change of a coordinate, as a logarithm, that costs half as much as the largest.
const SMALL: f32 = 0.1;
/// What the largest change of a coordinate costs.
const COST: f64 = 0.2;
/// A curve moves colours by less than its bend.
const BENT: f32 = 0.3;
/// What a ground costs that had been far from white and black.
const GROUND: f64 = 0.3;
/// Distance of a ground from both that costs half of it: compression and rounding leave a hundredth.
const NEAR: f32 = 0.05;

/// What is known of a picture, or a part of one, before anything is read.
#[derive(Clone, Copy)]
pub(super) struct Prior<'a> {
    /// The colour of the ground that it shows now.
    ground: Option<[f32; 3]>,
    whole: &'a Picture,
}

impl<'a> Prior<'a> {
    /// That of a part of the picture `whole`.
    pub fn of(part: &Picture, whole: &'a Picture) -> Self {
        Self {
            ground: ground::seen(part),
            whole,
        }
    }

    /// What a change must gain. A tint is what channels differ by from the middle one.
    pub fn cost(&self, change: &ToneChange) -> f64 {
        let at = |place: usize| change.coordinates[place];
        let [gains, fades] = [ToneChange::GAINS.map(at), change.fades()].map(from_the_middle);
        let factors = [ToneChange::GAMMA, ToneChange::SATURATION, ToneChange::CONTRAST].map(at);
        let done = gains.into_iter().chain(fades).chain(factors);
        let done = done.chain([BENT * at(ToneChange::BEND)]);
        let share = |v: f32, half: f32| f64::from(v.abs() / (v.abs() + half));
        let ground = self.ground.map_or(0.0, |ground| share(self.off(ground, change), NEAR));
        COST * done.map(|v| share(v, SMALL)).sum::<f64>() + GROUND * ground
    }

    /// How far a ground was from white and black before a change, in the channel that was farthest. What is white now may
    /// have been cut there, and may have been white if it was no brighter than that.
    fn off(&self, ground: [f32; 3], change: &ToneChange) -> f32 {
        let before = change.colour_before(ground, self.whole);
        let farthest = |far: &dyn Fn(usize) -> f32| (0..3).map(far).fold(0.0, f32::max);
        let white = farthest(&|c| match ground[c] >= ground::NEARLY_WHITE {
            true => (before[c] - 1.0).max(0.0),
            false => (before[c] - 1.0).abs(),
        });
        let black = farthest(&|c| match ground[c] <= 1.0 - ground::NEARLY_WHITE {
            true => (-before[c]).max(0.0),
            false => before[c].abs(),
        });
        white.min(black)
    }
}

/// The middle one of three channels, and what the others differ by from it.
fn from_the_middle(mut channels: [f32; 3]) -> [f32; 3] {
    channels.sort_by(f32::total_cmp);
    let [low, middle, high] = channels;
    [middle, low - middle, high - middle]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_costs_more_under_which_a_ground_had_been_of_no_usual_colour() {
        let on = |ground: [f32; 3]| Picture {
            width: 4,
            height: 4,
            pixels: ground.repeat(16),
        };
        let cost = |ground: [f32; 3], gains: [f32; 3]| {
            let picture = on(ground);
            Prior::of(&picture, &picture).cost(&ToneChange::of_gains(gains.map(f32::ln)))
        };
        // Red stayed white, for what was beyond was cut; blue tells its gain.
        let warm = [1.0, 1.0, 0.9];
        assert!(cost(warm, [1.1, 1.0, 0.9]) + 0.1 < cost(warm, [1.1, 1.0, 1.1]));
        // A white ground may have been made brighter, and not darker.
        assert!(cost([1.0; 3], [1.2; 3]) + 0.1 < cost([1.0; 3], [1.0 / 1.2; 3]));
        // A black one tells no gain.
        assert!((cost([0.0; 3], [1.2; 3]) - cost([0.0; 3], [1.0 / 1.2; 3])).abs() < 1e-6);
    }
}
