//! The loop: offsets on the colours of frozen Gaussians, until the message is read from views never used.
use std::thread;

use super::early_stopping::EarlyStopping;
use super::learned_offsets::LearnedOffsets;
use super::preparing::Preparing;
use super::progress::Progress;
use super::run::Run;
use super::settings::Settings;
use super::step_timer::{Stage, StepTimer};
use crate::error::{Error, Result};
use crate::extract::Engine;
use crate::message::Message;
use crate::scene::Scene;
use crate::splat::Geometry;
use crate::view::{Camera, ViewSampler};

/// Steps between two reports of the timing.
const TIMED_STEPS: usize = 20;

/// The outcome of the loop.
#[derive(Clone, Debug, PartialEq)]
pub struct Optimised {
    /// The learned changes.
    pub learned: LearnedOffsets,
    /// Views that it took to find the Gaussians that can be seen.
    pub covering_views: usize,
    /// Steps taken.
    pub steps: usize,
    /// Views drawn in all steps.
    pub view_steps: usize,
}

/// Optimises offsets that make views of the scene read as `message`: views around and between `cameras`, or, without any,
/// where viewers of such a scene are. The same arguments on the same device give the same offsets, bit by bit.
///
/// # Errors
/// Settings out of range, a message of another length than the key's, a scene without Gaussians,
/// [`Error::NotFinite`] when a term stops being a number, [`Error::Stopped`], or a failing device.
pub fn optimise(
    engine: &Engine,
    scene: &Scene,
    message: &Message,
    settings: &Settings,
    cameras: &[Camera],
    progress: &mut dyn FnMut(Progress),
) -> Result<Optimised> {
    settings.check()?;
    let settings = &settings.for_scene(&scene.gaussians, cameras)?;
    let word = engine.message_code.word(message)?;
    if word.len() != engine.bits {
        return Err(Error::BadOption {
            field: "message",
            reason: format!("{} bits, but the key has {}", word.len(), engine.bits),
        });
    }
    let gaussians = &scene.gaussians;
    let geometry = Geometry::new(gaussians);
    let mut sampler = ViewSampler::seen_from(gaussians, settings.seed, settings.viewpoints(cameras))?;
    if let Some(ring) = settings.ring {
        sampler.train_on_ring(ring.elevation.to_radians())?;
    }
    let mut held_out = settings
        .early_stop
        .map(|stop| EarlyStopping::new(engine, &geometry, &sampler, settings, stop))
        .transpose()?;
    let (mut run, coverage) = Run::new(engine, scene, geometry, message, settings, sampler)?;
    progress(Progress::Covered {
        views: coverage.views,
        seen: coverage.count(),
        gaussians: gaussians.len(),
    });
    let mut steps = 0;
    thread::scope(|scope| {
        let (mut timing, mut preparing) = (StepTimer::new(), Preparing::new(scope));
        while steps < run.steps() {
            engine.stop.check()?;
            timing.start();
            steps += 1;
            progress(Progress::Step(run.step(steps, &mut preparing, &mut timing)?));
            let mut enough = false;
            if let Some(held_out) = held_out.as_mut().filter(|h| h.due(steps)) {
                let check;
                run.fetch()?;
                (check, enough) = held_out.check(engine, gaussians, run.changes(), message, steps)?;
                run.heed(&check);
                progress(Progress::Check(check));
            }
            timing.lap(Stage::Check);
            progress(Progress::Timed(timing.end_step(steps, TIMED_STEPS)));
            if enough {
                progress(Progress::Stopped { step: steps });
                break;
            }
        }
        Ok::<_, Error>(())
    })?;
    run.fetch()?;
    Ok(Optimised {
        learned: run.into_learned(),
        covering_views: coverage.views,
        view_steps: steps * settings.views_per_step,
        steps,
    })
}
