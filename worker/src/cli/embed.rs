//! `embed`.
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use guardsplat_distortion::RobustTo;
use guardsplat_engine::device::DeviceChoice;
use guardsplat_engine::embed::{Job, Outcome, Preset, Progress, TrainableCoefficients, Verification, embed_with_files};
use guardsplat_engine::extract::Engine;
use guardsplat_engine::message::Key;
use guardsplat_engine::quality::write_picture;
use guardsplat_engine::scene::BadRows;
use guardsplat_engine::{Error, Result};
use guardsplat_soft_binding::Value;

use super::credentials::{self, Signing};
use super::display::Display;
use super::{Budget, Exit, Kind, embed_copies, embed_levels, print_json, print_line};
use crate::credentials_program::binding_key;
use guardsplat_operations::embed_report::EmbedReport;
use guardsplat_operations::embed_settings::Choices;
use guardsplat_operations::{comparison_sheet, load};

#[derive(Args)]
pub struct Arguments {
    /// The scene to mark: PLY, compressed PLY, SPZ, SOG (also as a folder, and streamed), glTF, .ksplat or .splat
    #[arg(value_name = "IN")]
    pub(super) input: PathBuf,
    /// Where to write the marked scene, in the format of IN; with --messages the folder of the copies
    #[arg(value_name = "OUT")]
    pub(super) output: PathBuf,
    /// The key file
    #[arg(long)]
    key: PathBuf,
    /// The message in hexadecimal, as many bits as the key has
    #[arg(long, value_name = "HEX", required_unless_present = "messages")]
    message: Option<String>,
    /// A file with a message a line, for each of which a copy is marked, OUT/MESSAGE with IN's extension. What copies have in
    /// common is done once for all
    #[arg(long, value_name = "FILE", conflicts_with_all = ["message", "credentials"])]
    messages: Option<PathBuf>,
    /// Copies that are marked at a time; each takes memory
    #[arg(long, value_name = "N", default_value_t = 8, requires = "messages", value_parser = clap::value_parser!(u8).range(1..=64))]
    pub(super) together: u8,
    /// draft, standard, robust, thorough or paper
    #[arg(long, default_value = "standard")]
    pub(super) preset: Preset,
    /// Decides views, backgrounds and augmentation
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Where to compute: auto, wgpu or cpu
    #[arg(long, default_value = "auto")]
    device: DeviceChoice,
    #[command(flatten)]
    budget: Budget,
    /// What the mark is trained to stand, names with commas, all or none: crop, scaling, rotation, brightness, contrast,
    /// jpeg, noise, blur, mask, 8bit, combined; sh-noise, sh-truncation, spz, sog, pruning. sh-truncation unless given
    #[arg(long, value_name = "LIST")]
    robust_to: Option<RobustTo>,
    /// Which coefficients of colours are learned: sh or all, constant (dc), or all others (rest). Geometry never changes
    #[arg(long, value_name = "WHAT", default_value = "all")]
    learn: TrainableCoefficients,
    /// Trains on views on a circle at this elevation in degrees, as the paper's public code does, instead of over the sphere
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true)]
    ring: Option<f32>,
    /// Where the scene's viewers are, from a file (cameras.json, transforms.json or a glTF) or a folder of COLMAP: training views are around and between
    /// these, and every eighth is held out
    #[arg(long, value_name = "FILE", conflicts_with = "ring")]
    cameras: Option<PathBuf>,
    /// The kind of scene, which says where its viewers are; found from the scene unless given
    #[arg(long, value_enum, conflicts_with = "cameras")]
    kind: Option<Kind>,
    /// Side of training views and of those of the verification, in pixels
    #[arg(long, value_name = "PX")]
    size: Option<u32>,
    /// Writes the scene even when it misses its target
    #[arg(long)]
    force: bool,
    /// Leaves Gaussians with NaN and other impossible values alone instead of refusing the scene
    #[arg(long)]
    ignore_bad_rows: bool,
    /// A folder for pictures of original, marked and ten times their difference
    #[arg(long, value_name = "DIR")]
    pub(super) report: Option<PathBuf>,
    #[command(flatten)]
    pub(super) signing: Signing,
    /// A CLIP that was added with `models add`, instead of the one that the key names
    #[arg(long)]
    clip: Option<String>,
    /// A JSON file with settings in place of the preset's, for experiments
    #[arg(long, value_name = "FILE", hide_short_help = true)]
    settings: Option<PathBuf>,
    /// Prints JSON on standard output
    #[arg(long)]
    pub(super) json: bool,
}

pub fn run(arguments: &Arguments) -> crate::error::Result<Exit> {
    let start = Instant::now();
    arguments.signing.check([&arguments.input, &arguments.output])?;
    let streamed = embed_levels::open(arguments)?;
    let settings = choices(arguments)?.settings()?;
    let key = Key::read(&arguments.key)?;
    let copies = copies(arguments, &key, streamed.is_some())?;
    let message = match (&arguments.message, copies.first()) {
        (Some(text), _) => key.message(text)?,
        // The job is a pattern for the copies then.
        (None, Some(copy)) => copy.message,
        (None, None) => key.message("")?,
    };
    let engine = load::engine(
        &arguments.key,
        &key,
        arguments.clip.as_deref(),
        arguments.device,
        load::Work::Marking,
        true,
        arguments.budget.bytes(),
    )?;
    if settings.lambda.lpips > 0.0 && !engine.has_lpips() {
        eprintln!("note: without the weights of LPIPS (`models add`) the loss goes without it");
    }
    let cameras = load::cameras(arguments.cameras.as_deref())?;
    let job = Job {
        input: &arguments.input,
        output: &arguments.output,
        message: &message,
        settings: &settings,
        cameras: &cameras,
        force: arguments.force,
        bad_rows: BadRows::ignored_if(arguments.ignore_bad_rows),
    };
    if !copies.is_empty() {
        return Ok(embed_copies::run(arguments, &engine, &key, &job, &copies)?);
    }
    if let Some(streamed) = streamed {
        return Ok(embed_levels::run(arguments, &engine, &key, &job, &streamed)?);
    }
    let mut display = Display::new("embedding");
    let mut verifying = None;
    let outcome = embed_with_files(&engine, &job, &mut |progress| {
        show(&mut display, &mut verifying, progress);
    })?;
    display.finish();
    drop(verifying);
    if let Some(folder) = &arguments.report {
        write_report(folder, &outcome.verification)?;
    }
    tell(arguments, &engine, &key, &outcome, start)?;
    if outcome.written {
        let value = Value::seal(binding_key(&key, &key.id()), &message)?;
        let said = credentials::sign(&arguments.signing, &arguments.input, &arguments.output, &value)?;
        said.iter().for_each(|line| eprintln!("{line}"));
    }
    Ok(if outcome.missed.is_empty() {
        Exit::Done
    } else {
        Exit::Inconclusive
    })
}

/// The copies that are asked for; none where it is one message.
fn copies(arguments: &Arguments, key: &Key, streamed: bool) -> Result<Vec<embed_copies::Copy>> {
    let Some(file) = &arguments.messages else {
        return Ok(Vec::new());
    };
    if streamed {
        return Err(Error::BadOption {
            field: "--messages",
            reason: "a SOG with a lod-meta.json is marked with one message at a time".into(),
        });
    }
    embed_copies::read(file, key.bits(), &arguments.input, &arguments.output)
}

fn choices(arguments: &Arguments) -> Result<Choices> {
    let read = |path: &PathBuf| std::fs::read_to_string(path).map_err(Error::io(path));
    Ok(Choices {
        preset: arguments.preset,
        seed: arguments.seed,
        size: arguments.size,
        robust_to: arguments.robust_to,
        learn: arguments.learn,
        ring: arguments.ring,
        kind: arguments.kind.map(Kind::scene),
        overrides: arguments.settings.as_ref().map(read).transpose()?,
    })
}

pub(super) fn show(display: &mut Display, verifying: &mut Option<Display>, progress: Progress) {
    match progress {
        Progress::Step(step) => display.set(step.step, step.total, || {
            format!(
                "bits {:.1} %, PSNR {:.1} dB, message loss {:.3}",
                100.0 * step.bit_accuracy,
                step.psnr_db,
                step.terms.message
            )
        }),
        Progress::Admitted(memory) => display.say(&format!("memory: {memory}")),
        Progress::Covered { views, seen, gaussians } => display.say(&format!(
            "{seen} of {gaussians} Gaussians can be seen, as {views} views show; the others are left alone"
        )),
        Progress::Check(check) => display.say(&format!(
            "step {}: held-out bits {:.1} %, PSNR {:.2} dB, weakest bit {:+.2}",
            check.step,
            100.0 * check.bit_accuracy,
            check.psnr_db,
            check.margin
        )),
        Progress::Stopped { step } => {
            display.say(&format!("enough after {step} steps: the held-out margin holds"));
        }
        Progress::Timed(_) => {}
        Progress::Writing => display.finish(),
        Progress::Verifying { done, total } => {
            verifying
                .get_or_insert_with(|| Display::new("verifying"))
                .set(done, total, String::new)
        }
    }
}

pub(super) fn write_report(folder: &Path, verification: &Verification) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(Error::io(folder))?;
    write_picture(
        &folder.join(comparison_sheet::NAME),
        &comparison_sheet::of(&verification.pairs)?,
    )
}

/// Tells what a mark misses of its target, if it does.
pub(super) fn tell_missed(what: &str, outcome: &Outcome) {
    if !outcome.missed.is_empty() {
        eprintln!("{what}: target missed: {}", outcome.missed.join(", "));
    }
}

/// What became of a mark, in a line.
pub(super) fn line(report: &EmbedReport<'_>) -> String {
    let psnr = report.quality.psnr.psnr_db;
    let psnr = psnr.map_or("identical".into(), |db| format!("{db:.2} dB"));
    format!(
        "bits {:.2} % (worst view {:.2} %), message {} {}, PSNR {psnr}, SSIM {:.4}; {} steps, {:.0} s on {}",
        100.0 * report.bit_accuracy,
        100.0 * report.bit_accuracy_worst_view,
        report.message,
        if report.message_recovered {
            "recovered"
        } else {
            "not recovered"
        },
        report.quality.ssim,
        report.steps,
        report.seconds,
        report.device
    )
}

fn tell(arguments: &Arguments, engine: &Engine, key: &Key, outcome: &Outcome, start: Instant) -> Result<()> {
    let report = EmbedReport::of(outcome, engine, key, arguments.preset, start.elapsed());
    if arguments.json {
        print_json(&report)?;
    } else {
        print_line(&line(&report));
        if let Some(ignored) = &outcome.ignored {
            print_line(&ignored.to_string());
        }
        if outcome.written {
            print_line(&format!("written to {}", arguments.output.display()));
        }
    }
    if !outcome.missed.is_empty() {
        let kept = if outcome.written {
            "written all the same"
        } else {
            "nothing was written"
        };
        eprintln!("target missed: {}; {kept}", outcome.missed.join(", "));
    }
    Ok(())
}
