//! Numbers of several Gaussians side by side, as registers hold them.
use std::ops::{Add, Mul, Sub};

/// Gaussians side by side: what the widest register holds.
pub(super) const LANES: usize = 16;

/// A number, or one of each of some Gaussians. Nothing is fused: both are rounded alike, on every instruction set.
pub(super) trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Mul<f32, Output = Self>
{
    /// The same number everywhere.
    fn of(value: f32) -> Self;
}

impl Number for f32 {
    #[inline(always)]
    fn of(value: f32) -> Self {
        value
    }
}

/// One number of each of [`LANES`] Gaussians.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lanes(pub [f32; LANES]);

impl Number for Lanes {
    #[inline(always)]
    fn of(value: f32) -> Self {
        Lanes([value; LANES])
    }
}

impl Add for Lanes {
    type Output = Self;

    #[inline(always)]
    fn add(mut self, other: Self) -> Self {
        for i in 0..LANES {
            self.0[i] += other.0[i];
        }
        self
    }
}

impl Sub for Lanes {
    type Output = Self;

    #[inline(always)]
    fn sub(mut self, other: Self) -> Self {
        for i in 0..LANES {
            self.0[i] -= other.0[i];
        }
        self
    }
}

impl Mul for Lanes {
    type Output = Self;

    #[inline(always)]
    fn mul(mut self, other: Self) -> Self {
        for i in 0..LANES {
            self.0[i] *= other.0[i];
        }
        self
    }
}

impl Mul<f32> for Lanes {
    type Output = Self;

    #[inline(always)]
    fn mul(mut self, other: f32) -> Self {
        for i in 0..LANES {
            self.0[i] *= other;
        }
        self
    }
}
