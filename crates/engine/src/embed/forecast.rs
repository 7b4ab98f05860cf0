//! What marking a scene will come to, told from a short trial: an eighth of the steps, kept in memory and read from
//! held-out views.
//!
//! What makes scenes hard (few colours, little to see, darkness, thin parts, walls on all sides) works together in ways that
//! figures of a scene do not tell: a trial meets all of them. It ends with more wrong bits than the whole run, by a factor
//! that scenes share ([`LEFT`]), so it is the rest that is forecast, and not the mark.
//!
//! In a few scenes they hardly share it: colours of a surface differ so much between views that what turns a bit in one view does
//! nothing in others. There the trial moves wrong bits less than it would take to turn them, and more steps bring little
//! ([`LEFT_OF_STUCK`]).
use std::time::{Duration, Instant};

use serde::Serialize;

use super::loss_weight_controller::LossWeightControl;
use super::optimise::optimise;
use super::progress::Progress;
use super::settings::{Extension, Settings, Verify};
use super::verify::verify;
use crate::error::Result;
use crate::extract::Engine;
use crate::message::Message;
use crate::scene::{Gaussians, Scene};
use crate::view::{Camera, ViewSampler};

/// The trial's share of the steps.
const SHARE: usize = 8;
/// Its steps at least: fewer are over before the weights of the loss have found their balance.
const LEAST_STEPS: usize = 30;
/// Most views that it keeps.
const POOL: usize = 40;
/// Wrong bits of the trial that the whole run loses, whatever the scene.
const LOST: f64 = 0.05;
/// Of the trial's wrong bits beyond [`LOST`], the share that is left at the end: fitted by hand to guitar, biker, donut and
/// pod of docs/evaluation/forecast-today.csv.
const LEFT: f64 = 0.13;
/// The same among cameras that were given. This and [`LOST`] were fitted to the marks of docs/evaluation/forecast.csv that
/// are `fitted` there.
const LEFT_OF_GIVEN: f64 = 0.2;
/// The same where wrong bits are stuck. This, [`STUCK`] and [`MOVED`] were fitted by hand to the marks of
/// docs/evaluation/forecast-stuck.csv that are `fitted` there.
const LEFT_OF_STUCK: f64 = 0.6;
/// Reach at which bits are stuck, and from which on they move as in other scenes: see [`reach`].
const STUCK: f64 = 1.2;
/// See [`STUCK`].
const MOVED: f64 = 1.7;
/// Wrong bits that hardly a mark goes below.
const BEST: f64 = 0.003;
/// Held-out views at the size of the verification have so much less than training views, which stand for larger pictures,
/// dB.
const HELD_OUT_DB: f64 = 1.1;
/// A mark that yields gives up so much in the mean, dB.
const YIELDED_DB: f64 = 1.0;

/// What can be expected of a mark.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Forecast {
    /// Mean share of right bits of a held-out view.
    pub bit_accuracy: f64,
    /// Mean PSNR of held-out views, dB; none where settings hold none.
    pub psnr_db: Option<f64>,
    /// The same over the pixels that the scene covers.
    pub psnr_covered_db: Option<f64>,
    /// How far a change as large as the mark's moves bits that the unmarked scene reads wrong, against how far bits of that are
    /// from zero; none where no bit is.
    pub reach: Option<f64>,
    /// Seconds of marking and verifying on this machine, with all steps.
    pub seconds: f64,
    /// Share of right bits that is asked for.
    pub wanted: f64,
    /// Seconds of the trial.
    pub trial_seconds: f64,
}

impl Forecast {
    /// Whether the mark is expected to be written.
    pub fn meets_target(&self) -> bool {
        self.bit_accuracy >= self.wanted
    }

    /// Whether wrong bits hardly move: what turns one in one view does nothing in others. More steps bring little then; a key
    /// or a message of which the scene reads more by itself may do.
    pub fn is_stuck(&self) -> bool {
        self.reach.is_some_and(|reach| reach < MOVED)
    }
}

/// Settings of the trial.
fn trial(settings: &Settings) -> Settings {
    let views = settings.verify.views.min(10);
    Settings {
        steps: (settings.steps / SHARE).clamp(LEAST_STEPS.min(settings.steps), settings.steps),
        pool_views: settings.pool_views.min(POOL),
        early_stop: None,
        extension: None,
        // In so few steps a change that may only be small has not got anywhere.
        balance: settings.balance.map(|balance| LossWeightControl {
            covered_psnr_db: None,
            ..balance
        }),
        verify: Verify {
            views,
            message_views: settings.verify.message_views.min(views),
            ..settings.verify
        },
        ..*settings
    }
}

/// Tries to mark a scene with `message`, and says what the settings would come to. The same arguments on the same device
/// give the same bits and PSNR; seconds are those of this machine now.
///
/// # Errors
/// Those of [`optimise`] and [`verify`].
pub fn forecast(
    engine: &Engine,
    scene: &Scene,
    message: &Message,
    settings: &Settings,
    cameras: &[Camera],
    progress: &mut dyn FnMut(Progress),
) -> Result<Forecast> {
    let start = Instant::now();
    let settings = &settings.for_scene(&scene.gaussians, cameras)?;
    let trial = trial(settings);
    let mut covered_at = None;
    let optimised = optimise(engine, scene, message, &trial, cameras, &mut |event| {
        if matches!(event, Progress::Covered { .. }) {
            covered_at = Some(start.elapsed());
        }
        progress(event);
    })?;
    let learned_at = start.elapsed();
    let marked = Gaussians {
        sh: optimised.learned.kept_colours(&scene.gaussians.sh),
        ..scene.gaussians.clone()
    };
    let found = verify(engine, &scene.gaussians, &marked, message, &trial, cameras, |_| {})?;
    let marked_time = start.elapsed();
    let unmarked = &scene.gaussians;
    let natural = verify(engine, unmarked, unmarked, message, &trial, cameras, |_| {})?;
    let trial_time = start.elapsed();

    let sampler = ViewSampler::seen_from(&scene.gaussians, settings.seed, settings.viewpoints(cameras))?;
    let left = if sampler.given().is_some() { LEFT_OF_GIVEN } else { LEFT };
    let of_whole = 10.0 * found.covered.max(f64::MIN_POSITIVE).log10();
    // PSNR of held-out views that a mark has after giving up so many dB.
    let held = |given_db: f64| {
        let balance = settings.balance?;
        // A mark with less is held weaker while it is made.
        let whole = (balance.target_psnr_db - HELD_OUT_DB - given_db).max(settings.target.psnr_db);
        let least = balance.covered_psnr_db.filter(|_| found.covered > 0.0);
        Some(least.map_or(whole, |db| whole.max(db - HELD_OUT_DB - of_whole)))
    };
    let more = match (found.quality.psnr.psnr_db, held(0.0)) {
        (Some(trial_db), Some(held_db)) => 10_f64.powf((trial_db - held_db) / 20.0).max(1.0),
        _ => 1.0,
    };
    let targets: Vec<f32> = engine.message_code.word(message)?.targets().collect();
    let moved = moved(&natural.reading.views, &found.reading.views, &targets);
    let reach = moved.map(|moved| more * moved);
    let bit_accuracy = expected(found.comparison.bit_accuracy, left_at(reach, left));
    let yields = |balance: LossWeightControl| balance.yielding.is_some_and(|yielding| bit_accuracy < yielding.below);
    let given_db = if settings.balance.is_some_and(yields) {
        YIELDED_DB
    } else {
        0.0
    };
    let psnr = held(given_db).map(|whole| (whole, whole + of_whole));
    let before = covered_at.unwrap_or(Duration::ZERO).as_secs_f64();
    let steps = settings.steps as f64
        * settings
            .extension
            .map_or(1.0, |extension| times(extension, bit_accuracy));
    let steps = (learned_at.as_secs_f64() - before) * steps / trial.steps as f64;
    let verified = (marked_time - learned_at).as_secs_f64() * settings.verify.views as f64 / trial.verify.views as f64;
    Ok(Forecast {
        bit_accuracy,
        psnr_db: psnr.map(|(whole, _)| whole),
        psnr_covered_db: psnr
            .map(|(_, over_covered)| over_covered)
            .filter(|_| found.covered > 0.0),
        reach,
        seconds: before + steps + verified,
        wanted: settings.target.wanted(message.len(), &engine.claim_rule()),
        trial_seconds: trial_time.as_secs_f64(),
    })
}

/// What steps are multiplied by where a mark ends with so many right bits: at the end half of those that were wrong at the
/// look that decides are right, and a quarter at the next.
fn times(extension: Extension, bit_accuracy: f64) -> f64 {
    let times = f64::from(extension.times);
    let reached = |k: &u32| 1.0 - bit_accuracy > (1.0 - extension.below) / 2.0 * times.powi(2 * *k as i32);
    times.powi((0..extension.most).take_while(reached).count() as i32)
}

/// Bit accuracy at the end, of that of the trial.
fn expected(trial: f64, left: f64) -> f64 {
    1.0 - (left * (1.0 - trial - LOST)).clamp(BEST, 0.5)
}

/// Share of the trial's wrong bits that is left at the end, which is `left` where bits move.
fn left_at(reach: Option<f64>, left: f64) -> f64 {
    let reach = reach.unwrap_or(f64::INFINITY);
    left + (LEFT_OF_STUCK - left).max(0.0) * ((MOVED - reach) / (MOVED - STUCK)).clamp(0.0, 1.0)
}

/// The reach of a trial: how far it moved bits that the unmarked scene reads wrong, against how far bits of that are from zero:
/// the mean move of their means over views, over the root mean square of the means of all bits. With a change as large as the
/// whole mark's that decides whether they turn. `natural` and `marked` hold the logits of each view, `targets` the bits, 0 or
/// 1. None where no bit is wrong.
fn moved(natural: &[Vec<f32>], marked: &[Vec<f32>], targets: &[f32]) -> Option<f64> {
    let means = |views: &[Vec<f32>]| -> Vec<f64> {
        let right = |bit: usize, target: &f32| {
            let side = if *target > 0.5 { 1.0 } else { -1.0 };
            let sum: f64 = views.iter().map(|view| f64::from(view[bit])).sum();
            side * sum / views.len() as f64
        };
        (targets.iter().enumerate())
            .map(|(bit, target)| right(bit, target))
            .collect()
    };
    let (natural, marked) = (means(natural), means(marked));
    let squares: f64 = natural.iter().map(|mean| mean * mean).sum();
    let moves: Vec<f64> = (natural.iter().zip(&marked))
        .filter(|(before, _)| **before < 0.0)
        .map(|(before, after)| after - before)
        .collect();
    if moves.is_empty() {
        return None;
    }
    let mean = moves.iter().sum::<f64>() / moves.len() as f64;
    Some(mean / (squares / targets.len() as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::embed::Preset;

    #[test]
    fn a_trial_is_an_eighth_and_never_longer_than_the_whole() {
        for preset in Preset::ALL {
            let settings = preset.settings();
            let trial = trial(&settings);
            trial.check().unwrap();
            assert!(trial.steps <= settings.steps && trial.steps >= 30, "{preset:?}");
        }
        let short = Settings {
            steps: 7,
            ..Preset::Draft.settings()
        };
        assert_eq!(trial(&short).steps, 7);
    }

    #[test]
    fn more_wrong_bits_take_more_steps() {
        let extension = Preset::Standard.settings().extension.unwrap();
        let found = [1.0, 0.99, 0.98, 0.95, 0.93, 0.5].map(|accuracy| times(extension, accuracy));
        assert_eq!(found, [1.0, 2.0, 2.0, 4.0, 4.0, 4.0]);
    }

    /// Two bits that start wrong, one of them far, and one that starts right: means over two views.
    #[test]
    fn reach_is_how_far_wrong_bits_move() {
        let natural = [vec![-1.0, 4.0, 5.0], vec![-3.0, 6.0, 3.0]];
        let marked = [vec![2.0, 1.0, 9.0], vec![2.0, 1.0, 9.0]];
        let targets = [1.0, 0.0, 1.0];
        let expected = (4.0 + 4.0) / 2.0 / f64::sqrt((4.0 + 25.0 + 16.0) / 3.0);
        assert!((moved(&natural, &marked, &targets).unwrap() - expected).abs() < 1e-9);
        assert_eq!(moved(&natural, &natural, &targets), Some(0.0));
        assert_eq!(moved(&natural[..1], &marked, &[0.0, 1.0, 1.0]), None);
    }

    #[test]
    fn where_bits_hardly_move_more_stay_wrong() {
        let reaches = [0.0, STUCK, 1.3, 1.5, MOVED];
        let left: Vec<f64> = (reaches.map(Some).into_iter().chain([None]))
            .map(|reach| left_at(reach, LEFT))
            .collect();
        assert!(left.is_sorted_by(|a, b| a >= b), "{left:?}");
        assert_eq!((left[0], left[1], left[5]), (LEFT_OF_STUCK, LEFT_OF_STUCK, LEFT));
        assert_eq!(left_at(Some(0.0), 0.9), 0.9);
    }

    #[test]
    fn more_right_bits_in_the_trial_are_more_at_the_end() {
        let ends: Vec<f64> = [0.5, 0.8, 0.9, 0.94, 0.97, 1.0]
            .map(|trial| expected(trial, 1.0))
            .to_vec();
        assert!(ends.is_sorted(), "{ends:?}");
        assert!((0.5..=1.0 - BEST).contains(&ends[0]) && ends[5] == 1.0 - BEST);
    }
}
