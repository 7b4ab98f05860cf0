//! The loop: offsets on the colours of frozen Gaussians, until the message is read from views never used.
use std::sync::Arc;
use std::thread;

use super::early_stopping::EarlyStopping;
use super::learned_offsets::LearnedOffsets;
use super::pooled_view::PooledView;
use super::preparing::Preparing;
use super::progress::Progress;
use super::run::Run;
use super::settings::Settings;
use super::step_timer::{Stage, StepTimer};
use super::view_pool::ViewPool;
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
    let progress = &mut |_: usize, event| progress(event);
    let mut all = optimise_together(engine, scene, &[message], settings, cameras, progress)?;
    Ok(all.swap_remove(0))
}

/// [`optimise`] for each of some messages, with views that are prepared once for all. Each gets the offsets that it would get
/// by itself. `progress` is told whose event it is, by the place of its message.
///
/// # Errors
/// Those of [`optimise`], of any message.
pub fn optimise_together(
    engine: &Engine,
    scene: &Scene,
    messages: &[&Message],
    settings: &Settings,
    cameras: &[Camera],
    progress: &mut dyn FnMut(usize, Progress),
) -> Result<Vec<Optimised>> {
    settings.check()?;
    let settings = &settings.for_scene(&scene.gaussians, cameras)?;
    for message in messages {
        let word = engine.message_code.word(message)?;
        if word.len() != engine.bits {
            return Err(Error::BadOption {
                field: "message",
                reason: format!("{} bits, but the key has {}", word.len(), engine.bits),
            });
        }
    }
    let gaussians = &scene.gaussians;
    let geometry = Arc::new(Geometry::new(gaussians));
    let mut sampler = ViewSampler::seen_from(gaussians, settings.seed, settings.viewpoints(cameras))?;
    if let Some(ring) = settings.ring {
        sampler.train_on_ring(ring.elevation.to_radians())?;
    }
    let held_out = settings
        .early_stop
        .map(|stop| EarlyStopping::new(engine, &geometry, &sampler, settings, stop))
        .transpose()?;
    let of_parts = sampler.shows_parts();
    let mut pool = ViewPool::new(sampler, settings);
    let coverage = pool.cover(engine, &geometry)?;
    let mut watched = Vec::with_capacity(messages.len());
    for (place, message) in messages.iter().enumerate() {
        watched.push(Watched {
            run: Run::new(engine, scene, message, settings, &coverage, of_parts)?,
            message,
            held_out: held_out.clone(),
            timing: StepTimer::new(),
            steps: 0,
            enough: false,
        });
        progress(
            place,
            Progress::Covered {
                views: coverage.views,
                seen: coverage.count(),
                gaussians: gaussians.len(),
            },
        );
    }
    thread::scope(|scope| {
        let mut preparing = Preparing::new(scope);
        loop {
            let going: Vec<usize> = (0..watched.len()).filter(|place| watched[*place].left() > 0).collect();
            let (Some(&first), Some(&last)) = (going.first(), going.last()) else {
                break;
            };
            engine.stop.check()?;
            watched[first].timing.start();
            let views = pool.batch(engine, &geometry)?;
            let left = watched.iter().map(Watched::left).max().unwrap_or_default();
            preparing.begin(engine, &geometry, left - 1, |after| pool.upcoming(after));
            watched[first].timing.lap(Stage::Prepare);
            for place in going {
                let one = &mut watched[place];
                if place != first {
                    one.timing.start();
                }
                let meanwhile = || match place == last {
                    true => pool.prepared(engine, preparing.next()?),
                    false => Ok(()),
                };
                let progress = &mut |event| progress(place, event);
                one.step(engine, &views, meanwhile, progress)?;
            }
        }
        Ok::<_, Error>(())
    })?;
    let optimised = watched.into_iter().map(|mut one| {
        one.run.fetch()?;
        Ok(Optimised {
            learned: one.run.into_learned(),
            covering_views: coverage.views,
            view_steps: one.steps * settings.views_per_step,
            steps: one.steps,
        })
    });
    optimised.collect()
}

/// A run with what looks after it.
struct Watched<'a> {
    run: Run<'a>,
    message: &'a Message,
    held_out: Option<EarlyStopping>,
    timing: StepTimer,
    /// Steps taken.
    steps: usize,
    /// Whether held-out views show that there need be no more.
    enough: bool,
}

impl Watched<'_> {
    /// Steps that are left to take, as far as is known.
    fn left(&self) -> usize {
        if self.enough { 0 } else { self.run.steps() - self.steps }
    }

    /// The next step, with the look at held-out views where it is due.
    fn step(
        &mut self,
        engine: &Engine,
        views: &[Arc<PooledView>],
        meanwhile: impl FnOnce() -> Result<()>,
        progress: &mut dyn FnMut(Progress),
    ) -> Result<()> {
        self.steps += 1;
        progress(Progress::Step(self.run.step(
            self.steps,
            views,
            &mut self.timing,
            meanwhile,
        )?));
        if let Some(held_out) = self.held_out.as_mut().filter(|held_out| held_out.due(self.steps)) {
            let pictures = self.run.pictures(&held_out.views())?;
            let (check, enough) = held_out.check(engine, &pictures, self.message, self.steps)?;
            self.run.heed(&check);
            self.enough = enough;
            progress(Progress::Check(check));
        }
        self.timing.lap(Stage::Check);
        progress(Progress::Timed(self.timing.end_step(self.steps, TIMED_STEPS)));
        if self.enough {
            progress(Progress::Stopped { step: self.steps });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::embed::run::tests::engine;
    use crate::embed::{EarlyStop, Preset};
    use crate::sample::sample;

    #[test]
    fn marks_that_are_made_together_are_those_that_are_made_alone() {
        let (engine, scene) = (engine(), sample(400, 1, 3).unwrap());
        let messages = ["6", "9", "0"].map(|text| Message::parse(text, 4).unwrap());
        // Looked at often, and enough at different steps.
        let settings = Settings {
            steps: 12,
            early_stop: Some(EarlyStop {
                every: 2,
                views: 2,
                min_steps: 2,
                bit_accuracy: 0.75,
                margin: -100.0,
                psnr_db: 0.0,
                patience: 1,
            }),
            ..Preset::Draft.settings()
        };
        let alone = |message: &Message| optimise(&engine, &scene, message, &settings, &[], &mut |_| {}).unwrap();
        let alone: Vec<Optimised> = messages.iter().map(alone).collect();
        let mut told = [0; 3];
        let borrowed: Vec<&Message> = messages.iter().collect();
        let together = optimise_together(&engine, &scene, &borrowed, &settings, &[], &mut |place, event| {
            told[place] += usize::from(matches!(event, Progress::Step(_)));
        });
        let together = together.unwrap();
        assert!(together == alone);
        assert_eq!(told.to_vec(), alone.iter().map(|one| one.steps).collect::<Vec<_>>());
        assert!(told.iter().any(|steps| *steps != told[0]), "{told:?}");
    }
}
