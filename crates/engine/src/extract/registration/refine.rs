//! Betters a camera that is nearly right: Levenberg's and Marquardt's method, over the numbers of [`moved`].
use rayon::prelude::*;

use super::Original;
use super::fit::{Fit, State};
use super::observed::Observed;
use super::pose::{FREEDOMS, moved};
use crate::error::Result;
use crate::extract::linear::solve;
use crate::view::Camera;

/// How far a number is moved to see what that changes, in about pixels.
const DIFFERENCE: f64 = 0.2;
/// Longest step, in the same unit: further off nothing is linear.
const LONGEST: f64 = 6.0;
/// A step below which a camera is as good as it gets.
const SHORTEST: f64 = 0.02;
/// Damping at first, what it is multiplied by after a step that was good and one that was not, its least, and how often a
/// step is tried.
const DAMPING: f64 = 1e-3;
const GOOD: f64 = 0.3;
const BAD: f64 = 6.0;
const LEAST_DAMPING: f64 = 1e-5;
const TRIES: usize = 8;

/// What of a camera is fitted.
#[derive(Clone, Copy, Debug)]
pub(super) enum Freedoms {
    /// All but its principal point.
    Centred,
    All,
}

impl Freedoms {
    fn count(self) -> usize {
        match self {
            Self::Centred => FREEDOMS - 2,
            Self::All => FREEDOMS,
        }
    }
}

/// The camera made better in up to so many rounds.
///
/// # Errors
/// Those of [`State::of`].
pub(super) fn refined(
    original: &Original<'_>,
    observed: &Observed,
    camera: &Camera,
    freedoms: Freedoms,
    rounds: usize,
) -> Result<Fit> {
    let mut now = State::of(original, observed, observed.camera(camera))?;
    let mut damping = DAMPING;
    for _ in 0..rounds {
        let equations = Equations::of(original, observed, &now, freedoms.count())?;
        let Some((next, length)) = better(original, observed, &now, &equations, &mut damping)? else {
            break;
        };
        now = next;
        if length < SHORTEST {
            break;
        }
    }
    Ok(now.fit)
}

/// The first damped step that explains more, and how long it was.
fn better(
    original: &Original<'_>,
    observed: &Observed,
    now: &State,
    equations: &Equations,
    damping: &mut f64,
) -> Result<Option<(State, f64)>> {
    let camera = &now.fit.camera;
    for _ in 0..TRIES {
        let Some((step, length)) = equations.step(*damping) else {
            return Ok(None);
        };
        let next = State::of(original, observed, moved(camera, original.depth(camera), &step))?;
        if next.fit.cost < now.fit.cost {
            *damping = (*damping * GOOD).max(LEAST_DAMPING);
            return Ok(Some((next, length)));
        }
        *damping *= BAD;
    }
    Ok(None)
}

/// The normal equations of a step.
struct Equations {
    /// Products of slopes, rows and columns of the freedoms.
    products: Vec<f64>,
    /// Slopes times errors, negative.
    towards: Vec<[f64; 1]>,
}

impl Equations {
    fn of(original: &Original<'_>, observed: &Observed, now: &State, count: usize) -> Result<Self> {
        let camera = &now.fit.camera;
        let slopes: Vec<Vec<[f32; 3]>> = (0..count)
            .into_par_iter()
            .map(|freedom| {
                let mut step = [0.0; FREEDOMS];
                step[freedom] = DIFFERENCE;
                let after = now.errors_of(original, observed, &moved(camera, original.depth(camera), &step))?;
                let slope = |(after, now): (&[f32; 3], &[f32; 3])| {
                    std::array::from_fn(|k| (after[k] - now[k]) / DIFFERENCE as f32)
                };
                Ok(after.iter().zip(&now.errors).map(slope).collect())
            })
            .collect::<Result<_>>()?;
        let product = |a: &[[f32; 3]], b: &[[f32; 3]]| -> f64 {
            let pixels = a.iter().zip(b).zip(&now.weights);
            pixels
                .map(|((a, b), weight)| f64::from(*weight) * f64::from(a[0] * b[0] + a[1] * b[1] + a[2] * b[2]))
                .sum()
        };
        let mut products = vec![0.0; count * count];
        for p in 0..count {
            for q in 0..=p {
                products[p * count + q] = product(&slopes[p], &slopes[q]);
            }
        }
        Ok(Self {
            products,
            towards: slopes.iter().map(|slope| [-product(slope, &now.errors)]).collect(),
        })
    }

    /// The step under this damping, and its length before it is cut to [`LONGEST`].
    fn step(&self, damping: f64) -> Option<([f64; FREEDOMS], f64)> {
        let count = self.towards.len();
        let own = |p: usize| self.products[p * count + p];
        let largest = (0..count).map(own).fold(0.0, f64::max);
        let mut damped = self.products.clone();
        for p in 0..count {
            damped[p * count + p] += damping * (own(p) + 1e-4 * largest) + 1e-12;
        }
        let solved = solve(damped, self.towards.clone(), 0.0)?;
        let length = solved.iter().map(|[s]| s.abs()).fold(0.0, f64::max);
        let shorter = (LONGEST / length.max(1e-9)).min(1.0);
        let mut step = [0.0; FREEDOMS];
        step.iter_mut()
            .zip(&solved)
            .for_each(|(step, [solved])| *step = shorter * solved);
        length.is_finite().then_some((step, length))
    }
}
