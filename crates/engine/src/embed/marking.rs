//! Admits and verifies a mark, whatever the marked scene is kept in: a file, or memory.
use super::learned_offsets::LearnedOffsets;
use super::optimise::Optimised;
use super::progress::Progress;
use super::resources::{measure_view, model_bytes, predict_memory};
use super::settings::Settings;
use super::verify::{Verification, verify};
use crate::error::Result;
use crate::extract::Engine;
use crate::memory::{MemoryRequirements, SceneSize};
use crate::message::Message;
use crate::scene::{Format, Gaussians, Ignored, Scene};
use crate::view::Camera;

/// Times that a mark is made weaker where held-out views show it more than they may. Once is enough where the file keeps
/// changes as they are; where it rounds them, what is left is not as much less as was asked for (compressed PLY).
const WEAKENED: usize = 4;

/// How to embed.
pub(super) struct Work<'a> {
    pub settings: &'a Settings,
    pub cameras: &'a [Camera],
}

/// What became of a job.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// What the verification of the file found.
    pub verification: Verification,
    /// What misses the target, in words.
    pub missed: Vec<String>,
    /// Whether the output was written, or handed out.
    pub written: bool,
    /// The format of input and output.
    pub format: Format,
    /// Steps taken.
    pub steps: usize,
    /// Views drawn in all steps.
    pub view_steps: usize,
    /// Memory that was predicted.
    pub memory: MemoryRequirements,
    /// Gaussians of the scene.
    pub gaussians: usize,
    /// Rows of the file that are none, where some were ignored.
    pub ignored: Option<Ignored>,
    /// Gaussians that training views show; the others were left alone.
    pub seen: usize,
    /// Training views that it took to find them.
    pub covering_views: usize,
    /// Gaussians whose colours changed.
    pub changed: usize,
}

/// Predicts what memory so many marks at once will need, and refuses what does not fit.
pub(super) fn admit(engine: &Engine, scene: &Scene, work: &Work<'_>, marks: usize) -> Result<MemoryRequirements> {
    let settings = work.settings;
    let view = measure_view(engine, &scene.gaussians, settings, work.cameras)?;
    let memory = predict_memory(
        SceneSize::of(scene),
        view,
        settings,
        model_bytes(engine, settings),
        marks,
        engine.on_cpu(),
    );
    engine.limits.admit(&memory)?;
    Ok(memory)
}

/// Verifies a mark on what `marked` makes of it: the scene as others will have it. One that shows more than it may is made
/// weaker. Nothing is said to be written.
pub(super) fn verified(
    engine: &Engine,
    scene: &Scene,
    work: &Work<'_>,
    memory: MemoryRequirements,
    message: &Message,
    mut optimised: Optimised,
    progress: &mut dyn FnMut(Progress),
    marked: &dyn Fn(&LearnedOffsets) -> Result<Gaussians>,
) -> Result<(LearnedOffsets, Outcome)> {
    let settings = work.settings;
    let (mut verification, mut missed);
    let mut weakened = 0;
    loop {
        engine.stop.check()?;
        progress(Progress::Writing);
        let marked = marked(&optimised.learned)?;
        let total = settings.verify.views;
        verification = verify(
            engine,
            &scene.gaussians,
            &marked,
            message,
            settings,
            work.cameras,
            |done| progress(Progress::Verifying { done, total }),
        )?;
        missed = settings.target.missed(&verification, &engine.claim_rule());
        match settings.target.weaken(&verification) {
            Some(factor) if weakened < WEAKENED => optimised.learned.scale(factor, scene),
            _ => break,
        }
        weakened += 1;
    }
    if !missed.is_empty()
        && work.cameras.is_empty()
        && let Some(kind) = settings.kind
    {
        missed.push(format!(
            "views were those of the kind {kind}: where viewers stand elsewhere, give cameras or another kind"
        ));
    }
    let outcome = Outcome {
        verification,
        missed,
        written: false,
        format: scene.format(),
        steps: optimised.steps,
        view_steps: optimised.view_steps,
        gaussians: scene.gaussians.len(),
        ignored: scene.ignored().cloned(),
        memory,
        seen: optimised.learned.learnable.rows().len(),
        covering_views: optimised.covering_views,
        changed: optimised.learned.changed(&scene.gaussians.sh),
    };
    Ok((optimised.learned, outcome))
}
