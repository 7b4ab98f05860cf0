//! What the strength of an attack may be, and how one is drawn.
use std::fmt;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::strength::Strength;

/// Which numbers between its limits a strength may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Grid {
    Real,
    Whole,
    Odd,
}

/// What a strength may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Limits {
    pub least: f64,
    pub most: f64,
    pub grid: Grid,
    /// The strength at which the picture stays as it is, where there is one.
    pub identity: Option<f64>,
}

/// Any number, of which one changes nothing.
pub(super) const fn real(least: f64, most: f64, identity: f64) -> Option<Limits> {
    limits(least, most, Grid::Real, Some(identity))
}

pub(super) const fn limits(least: f64, most: f64, grid: Grid, identity: Option<f64>) -> Option<Limits> {
    Some(Limits {
        least,
        most,
        grid,
        identity,
    })
}

impl Limits {
    /// Whether a strength lies within, with both ends.
    pub fn allow(self, strength: Strength) -> bool {
        [strength.low(), strength.high()].into_iter().all(|value| {
            let on_grid = match self.grid {
                Grid::Real => true,
                Grid::Whole => value.fract() == 0.0,
                Grid::Odd => value.rem_euclid(2.0) == 1.0,
            };
            on_grid && (self.least..=self.most).contains(&value)
        })
    }

    /// One strength of a range, uniform over the numbers that are allowed.
    pub fn draw(self, strength: Strength, random: &mut ChaCha8Rng) -> Strength {
        let (low, high) = (strength.low(), strength.high());
        if strength.is_fixed() {
            return strength;
        }
        let mut whole = |every: f64| low + every * f64::from(random.random_range(0..=((high - low) / every) as u32));
        strength.became(match self.grid {
            Grid::Whole => whole(1.0),
            Grid::Odd => whole(2.0),
            Grid::Real => random.random_range(low..=high),
        })
    }
}

impl fmt::Display for Limits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let numbers = match self.grid {
            Grid::Real => "a number",
            Grid::Whole => "a whole number",
            Grid::Odd => "an odd number",
        };
        write!(f, "{numbers} from {} to {}", self.least, self.most)
    }
}
