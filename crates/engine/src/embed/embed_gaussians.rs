//! Embedding in memory: for programs that have Gaussians and no file, such as those that train them.
use super::learned_offsets::LearnedOffsets;
use super::marking::{Outcome, Work, admit, verified};
use super::optimise::optimise;
use super::progress::Progress;
use super::settings::Settings;
use crate::error::Result;
use crate::extract::Engine;
use crate::message::Message;
use crate::scene::{Gaussians, Scene, Sh};
use crate::view::Camera;

/// Marks Gaussians that are in memory, such as a reader of scenes gives: the colours are those that a PLY of them would be
/// marked with. All of them are kept as they are, so nothing is rounded. A mark that misses its target is handed out all
/// the same, and [`Outcome::missed`] says so; [`Outcome::written`] is whether it missed none.
///
/// # Errors
/// Whatever optimising and verifying may fail with, [`Error::Stopped`](crate::Error::Stopped) when the engine is asked to
/// stop.
pub fn embed_gaussians(
    engine: &Engine,
    gaussians: Gaussians,
    message: &Message,
    settings: &Settings,
    cameras: &[Camera],
    progress: &mut dyn FnMut(Progress),
) -> Result<(Sh, Outcome)> {
    settings.check()?;
    engine.stop.check()?;
    let scene = Scene::from_gaussians(gaussians);
    let settings = &settings.for_scene(&scene.gaussians, cameras)?;
    let work = Work { settings, cameras };
    let memory = admit(engine, &scene, &work, 1)?;
    progress(Progress::Admitted(memory));
    let marked = |learned: &LearnedOffsets| {
        let mut sh = learned.colours(&scene.gaussians.sh);
        // As a reader of the file would have it.
        sh.trim();
        Ok(Gaussians {
            sh,
            ..scene.gaussians.clone()
        })
    };
    let optimised = optimise(engine, &scene, message, settings, cameras, progress)?;
    let (learned, mut outcome) = verified(engine, &scene, &work, memory, message, optimised, progress, &marked)?;
    outcome.written = outcome.missed.is_empty();
    Ok((learned.colours(&scene.gaussians.sh), outcome))
}
