//! Embedding from file to file: the marked scene is written aside, read back and verified before it gets its name.
use std::collections::HashSet;
use std::path::Path;

use super::aside::Aside;
use super::learned_offsets::LearnedOffsets;
use super::marking::{Outcome, Work, admit, verified};
use super::optimise::optimise_together;
use super::progress::Progress;
use super::resources::model_bytes;
use super::settings::Settings;
use crate::error::{Error, Result};
use crate::extract::Engine;
use crate::memory::{MemoryRequirements, admission};
use crate::message::Message;
use crate::scene::{BadRows, Gaussians, Scene, StreamedSog};
use crate::view::Camera;

/// What to embed where.
pub struct Job<'a> {
    /// The scene file to mark.
    pub input: &'a Path,
    /// Where the marked scene goes, in the format of the input; a file there is replaced.
    pub output: &'a Path,
    /// The message, of the key's length.
    pub message: &'a Message,
    /// How.
    pub settings: &'a Settings,
    /// Where its viewers are; where none are given the kind of scene says where.
    pub cameras: &'a [Camera],
    /// Writes a scene that misses its target all the same.
    pub force: bool,
    /// What becomes of rows with values that are not legal; ignored ones are in the output as they were.
    pub bad_rows: BadRows,
}

/// Marks a scene file. A result that misses its target is not written, unless the job forces it.
///
/// # Errors
/// Whatever reading, optimising, verifying and writing may fail with, [`Error::Stopped`] when the engine is asked to
/// stop; the output is then as it was before.
pub fn embed(engine: &Engine, job: &Job<'_>, progress: &mut dyn FnMut(Progress)) -> Result<Outcome> {
    let read = |memory| Scene::read_within(job.input, job.bad_rows, memory);
    embed_one(engine, job, &read, progress)
}

/// Marks a scene as [`embed`], which may be in more files than one: a glTF with its buffers beside it, or the folder of a
/// SOG. Only for scenes that their user chose on this machine ([`Scene::read_with_files`]).
///
/// # Errors
/// Those of [`embed`].
pub fn embed_with_files(engine: &Engine, job: &Job<'_>, progress: &mut dyn FnMut(Progress)) -> Result<Outcome> {
    let read = |memory| Scene::read_with_files(job.input, job.bad_rows, memory);
    embed_one(engine, job, &read, progress)
}

/// Marks a level of detail of a SOG that is streamed, in all tiles, as [`embed_with_files`]. The output is a folder with a
/// `lod-meta.json` of that level alone.
///
/// # Errors
/// Those of [`embed`].
pub fn embed_level(
    engine: &Engine,
    job: &Job<'_>,
    streamed: &StreamedSog,
    level: usize,
    progress: &mut dyn FnMut(Progress),
) -> Result<Outcome> {
    let read = |memory| streamed.read(level, job.bad_rows, memory);
    embed_one(engine, job, &read, progress)
}

/// Marks copies of one scene, as [`embed_with_files`] does each by itself, with views that are prepared once for all: only the
/// messages and outputs of the jobs may differ. Outcomes are in the order of the jobs; `progress` is told which it is about.
///
/// # Errors
/// Those of [`embed`], of any job: outputs that have their names by then stay. [`Error::BadOption`] for jobs that differ
/// otherwise, or have one output.
pub fn embed_together(
    engine: &Engine,
    jobs: &[Job<'_>],
    progress: &mut dyn FnMut(usize, Progress),
) -> Result<Vec<Outcome>> {
    let Some((first, others)) = jobs.split_first() else {
        return Ok(Vec::new());
    };
    let refuse = |field, reason: &str| {
        Err(Error::BadOption {
            field,
            reason: reason.into(),
        })
    };
    let alike = |job: &Job<'_>| {
        (job.input, job.settings, job.cameras, job.bad_rows)
            == (first.input, first.settings, first.cameras, first.bad_rows)
    };
    if !others.iter().all(alike) {
        return refuse(
            "jobs",
            "only messages and outputs of jobs that are done together may differ",
        );
    }
    let outputs: HashSet<&Path> = jobs.iter().map(|job| job.output).collect();
    if outputs.len() < jobs.len() {
        return refuse("OUT", "two marks would be written to one file");
    }
    let read = |memory| Scene::read_with_files(first.input, first.bad_rows, memory);
    embed_scene(engine, jobs, &read, progress)
}

fn embed_one(
    engine: &Engine,
    job: &Job<'_>,
    read: &dyn Fn(u64) -> crate::scene::Result<Scene>,
    progress: &mut dyn FnMut(Progress),
) -> Result<Outcome> {
    let progress = &mut |_: usize, event| progress(event);
    Ok(embed_scene(engine, std::slice::from_ref(job), read, progress)?.swap_remove(0))
}

/// Marks the scene that all jobs, one at least, are of.
fn embed_scene(
    engine: &Engine,
    jobs: &[Job<'_>],
    read: &dyn Fn(u64) -> crate::scene::Result<Scene>,
    progress: &mut dyn FnMut(usize, Progress),
) -> Result<Vec<Outcome>> {
    let Job {
        input,
        settings,
        cameras,
        ..
    } = jobs[0];
    settings.check()?;
    let stop = &engine.stop;
    stop.check()?;
    let rest = MemoryRequirements {
        models: model_bytes(engine, settings).learning,
        ..MemoryRequirements::of_program()
    };
    admission::admit_marking(input, &engine.limits, rest)?;
    let scene = read(engine.limits.left(&rest))?;
    stop.check()?;
    let settings = &settings.for_scene(&scene.gaussians, cameras)?;
    let work = Work { settings, cameras };
    let memory = admit(engine, &scene, &work, jobs.len())?;
    let asides = jobs
        .iter()
        .map(|job| reserve(job, &scene))
        .collect::<Result<Vec<_>>>()?;
    (0..jobs.len()).for_each(|place| progress(place, Progress::Admitted(memory)));
    let messages: Vec<&Message> = jobs.iter().map(|job| job.message).collect();
    let optimised = optimise_together(engine, &scene, &messages, settings, cameras, progress)?;
    let mut outcomes = Vec::with_capacity(jobs.len());
    for (place, ((job, aside), optimised)) in jobs.iter().zip(asides).zip(optimised).enumerate() {
        let progress = &mut |event| progress(place, event);
        let marked = |learned: &LearnedOffsets| write(job, &scene, learned, &aside);
        let (_, mut outcome) = verified(engine, &scene, &work, memory, job.message, optimised, progress, &marked)?;
        outcome.written = outcome.missed.is_empty() || job.force;
        if outcome.written {
            aside.persist(job.output)?;
        }
        outcomes.push(outcome);
    }
    Ok(outcomes)
}

/// Writes the scene with what was learned to the file aside, and reads back what it shows.
fn write(job: &Job<'_>, scene: &Scene, learned: &LearnedOffsets, aside: &Aside) -> Result<Gaussians> {
    let colours = learned.colours(&scene.gaussians.sh);
    // The new file is complete before it replaces the reserved one, so free that one's space first.
    aside.clear().map_err(Error::io(job.output))?;
    scene.write(aside.path(), &colours).map_err(|e| named(e, job.output))?;
    drop(colours);
    // The rows that were bad are so in the marked file too, and no others may be.
    let marked = match scene.is_one_file() {
        true => Scene::read_with(aside.path(), job.bad_rows),
        false => Scene::read_with_files(aside.path(), job.bad_rows, u64::MAX),
    };
    let marked = marked.map_err(|e| named(e, job.output))?;
    check_geometry(job.output, scene, &marked)?;
    Ok(marked.into_gaussians())
}

/// A file beside the output that holds as much as the output will; about as much in formats that are compressed. A
/// folder that is missing, read-only or full is thereby known before the work, not after it, as is a name that says
/// another format. It is deleted when dropped.
fn reserve(job: &Job<'_>, scene: &Scene) -> Result<Aside> {
    let suits = scene.format().check_name(job.output);
    suits.map_err(|reason| Error::BadOption { field: "OUT", reason })?;
    let refuse = |reason: &str| Err(Error::io(job.output)(std::io::Error::other(reason.to_owned())));
    match std::fs::metadata(job.output) {
        Ok(there) if !there.is_file() => return refuse("exists and is not a regular file"),
        Ok(_) if same_file(job.input, job.output) => {
            return refuse("is the input; the unmarked scene would be lost");
        }
        _ => {}
    }
    let aside = Aside::beside(job.output, scene.is_one_file()).map_err(Error::io(job.output))?;
    scene
        .write(aside.path(), &scene.gaussians.sh)
        .map_err(|e| named(e, job.output))?;
    Ok(aside)
}

fn same_file(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    }
}

/// The error of the file aside, told of the output that the user knows.
fn named(error: impl Into<Error>, output: &Path) -> Error {
    match error.into() {
        Error::Io { source, .. } => Error::io(output)(source),
        Error::BadScene { reason, .. } => Error::BadScene {
            path: output.into(),
            reason,
        },
        other => other,
    }
}

fn check_geometry(output: &Path, scene: &Scene, read_back: &Scene) -> Result<()> {
    let (original, marked) = (&scene.gaussians, &read_back.gaussians);
    let same = scene.ignored() == read_back.ignored()
        && original.positions == marked.positions
        && original.rotations == marked.rotations
        && original.log_scales == marked.log_scales
        && original.opacity_logits == marked.opacity_logits
        && original.sh.degree >= marked.sh.degree;
    if same {
        return Ok(());
    }
    Err(Error::BadScene {
        path: output.into(),
        reason: "the file reads back with other geometry than was written; the disk may be failing".into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::embed::Preset;
    use crate::sample::sample;

    #[test]
    fn places_that_cannot_be_written_are_known_before_the_work() {
        let folder = tempfile::tempdir().unwrap();
        let scene = sample(10, 0, 1).unwrap();
        let input = folder.path().join("in.ply");
        scene.write(&input, &scene.gaussians.sh).unwrap();
        let message = Message::parse("a", 4).unwrap();
        let settings = Preset::Draft.settings();
        let reserve = |output: &Path| {
            let job = Job {
                input: &input,
                output,
                message: &message,
                settings: &settings,
                cameras: &[],
                force: false,
                bad_rows: BadRows::Refuse,
            };
            reserve(&job, &scene)
        };
        let reason = |output: &Path| reserve(output).unwrap_err().to_string();
        assert!(reason(&input).contains("is the input"));
        assert!(reason(folder.path()).contains("not a regular file"));
        let other = reason(&folder.path().join("out.spz"));
        assert!(
            other.contains("out.spz would pass for SPZ") && other.contains("PLY: name it *.ply"),
            "{other}"
        );
        let missing = folder.path().join("none/out.ply");
        assert!(reason(&missing).starts_with(missing.to_str().unwrap()));
        let aside = reserve(&folder.path().join("out.ply")).unwrap();
        assert_eq!(
            std::fs::metadata(aside.path()).unwrap().len(),
            std::fs::metadata(&input).unwrap().len()
        );
        drop(aside);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn other_geometry_is_noticed() {
        let scene = sample(10, 0, 1).unwrap();
        let mut marked = scene.clone();
        marked.gaussians.sh.coefficients[0] += 1.0;
        let output = Path::new("out.ply");
        check_geometry(output, &scene, &marked).unwrap();
        marked.gaussians.positions[3][1] += 1e-3;
        assert!(check_geometry(output, &scene, &marked).is_err());
    }
}
