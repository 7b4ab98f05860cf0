//! Marks a SOG that is streamed in levels of detail: one level after the other, each in all tiles, with one message.
//!
//! What viewers show is a mixture: near tiles from a fine level, far ones from a coarse one. So every level carries the
//! mark, and each is verified by itself. Levels are as many pictures of one scene, and views are chosen alike for all: the
//! kind of scene is that of the finest.
use std::path::Path;

use guardsplat_engine::embed::{Job, Outcome, Progress, embed_level};
use guardsplat_engine::extract::Engine;
use guardsplat_engine::memory::MemoryRequirements;
use guardsplat_engine::scene::{StreamedSog, write_folder_whole};
use guardsplat_engine::view::SceneKind;
use guardsplat_engine::{Error, Result};

/// Where a level is written to, in the folder of all.
const LEVEL: &str = ".guardsplat-level";

/// What became of the levels that were marked.
pub struct Levels {
    /// Each with what became of it; those without Gaussians are left out. Without force the first that misses its target is
    /// the last.
    pub outcomes: Vec<(usize, Outcome)>,
    /// Whether the output was written.
    pub written: bool,
}

/// Marks every level of `streamed`, the input of the job, and writes all as a new folder, in which only pictures of
/// colours differ. `each` hears of a level before it is begun, of its progress, and of what became of it.
///
/// # Errors
/// Those of [`embed_level`]; the output is there already. Then, and where a level misses its target and the job does not
/// force it, nothing is written.
pub fn embed_levels(
    engine: &Engine,
    job: &Job<'_>,
    streamed: &StreamedSog,
    each: &mut dyn FnMut(usize, Event<'_>) -> Result<()>,
) -> Result<Levels> {
    let mut levels = Levels {
        outcomes: Vec::new(),
        written: false,
    };
    let outcomes = &mut levels.outcomes;
    match write_folder_whole(job.output, |aside| {
        mark_into(engine, job, streamed, aside, outcomes, each)
    }) {
        Ok(()) => levels.written = true,
        Err(Stopped::Missed) => {}
        Err(Stopped::Failed(error)) => return Err(error),
    }
    Ok(levels)
}

/// What is told of a level.
pub enum Event<'a> {
    /// It is begun, with so many Gaussians.
    Begun(u64),
    /// It goes on.
    Progress(Progress),
    /// What became of it.
    Done(&'a Outcome),
}

/// Why there is no output.
enum Stopped {
    Failed(Error),
    Missed,
}

impl From<Error> for Stopped {
    fn from(error: Error) -> Self {
        Self::Failed(error)
    }
}

impl From<guardsplat_engine::scene::Error> for Stopped {
    fn from(error: guardsplat_engine::scene::Error) -> Self {
        Self::Failed(error.into())
    }
}

fn mark_into(
    engine: &Engine,
    job: &Job<'_>,
    streamed: &StreamedSog,
    aside: &Path,
    outcomes: &mut Vec<(usize, Outcome)>,
    each: &mut dyn FnMut(usize, Event<'_>) -> Result<()>,
) -> std::result::Result<(), Stopped> {
    let levels: Vec<usize> = (0..streamed.levels()).filter(|l| streamed.gaussians(*l) > 0).collect();
    let mut settings = *job.settings;
    if settings.kind.is_none()
        && job.cameras.is_empty()
        && let Some(finest) = levels.first()
    {
        let left = engine.limits.left(&MemoryRequirements::of_program());
        let finest = streamed.read(*finest, job.bad_rows, left)?;
        settings.kind = Some(SceneKind::of(&finest.gaussians)?.0);
    }
    streamed.copy_rest(aside)?;
    for level in levels {
        each(level, Event::Begun(streamed.gaussians(level)))?;
        let output = aside.join(LEVEL);
        let job = Job {
            output: &output,
            settings: &settings,
            ..*job
        };
        let outcome = embed_level(engine, &job, streamed, level, &mut |progress| {
            // Nobody could do anything about it before the level is done.
            let _ = each(level, Event::Progress(progress));
        })?;
        each(level, Event::Done(&outcome))?;
        let written = outcome.written;
        outcomes.push((level, outcome));
        if !written {
            return Err(Stopped::Missed);
        }
        streamed.move_level(level, &output, aside)?;
        std::fs::remove_dir_all(&output).map_err(Error::io(&output))?;
    }
    Ok(())
}
