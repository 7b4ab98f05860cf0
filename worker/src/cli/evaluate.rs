//! `evaluate`.
use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::evaluate::{Options, Progress, Robustness, Trade, Variant, attacks, plan, run as carry_out, variants};
use clap::Args;
use guardsplat_distortion::{RobustTo, Vae};
use guardsplat_engine::clip::{Parts, ShippedClip};
use guardsplat_engine::device::{Compute, DeviceChoice, open};
use guardsplat_engine::embed::{self, Preset, Settings};
use guardsplat_engine::extract::Engine;
use guardsplat_engine::message::key::{HIDDEN, HiddenKeyOptions, create_hidden_key};
use guardsplat_engine::message::{Key, KeyOptions, TrainingOptions};
use guardsplat_engine::stop::Stop;
use guardsplat_evaluation::report::named::{Experiment, Options as ReportOptions, report};
use guardsplat_evaluation::report::names::VAE;
use guardsplat_evaluation::report::output;
use guardsplat_evaluation::report::selection::Selection;
use guardsplat_evaluation::report::store::Store;

use super::display::Display;
use super::{Budget, Exit, Extractor, print_line};
use crate::error::{Error, Result};
use guardsplat_operations::{create_key, load};

#[derive(Args)]
pub struct Arguments {
    /// A folder for results; what is there already is not done again
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Scene files
    #[arg(long, value_name = "FILE", num_args = 1..)]
    scenes: Vec<PathBuf>,
    /// Which experiments: capacity, robustness, trained, losses, pruning, longer, perturbations, sensitivity, elevation,
    /// formats, security, claims, trade
    #[arg(long, value_name = "NAME", value_delimiter = ',', default_value = "capacity")]
    experiments: Vec<Experiment>,
    /// Only messages of these lengths
    #[arg(long, value_name = "N", value_delimiter = ',')]
    bits: Vec<usize>,
    /// Seeds, each with a key, a message and views of its own
    #[arg(long, value_name = "N", value_delimiter = ',', default_value = "1,2,3")]
    seeds: Vec<u64>,
    /// The settings that are called standard: draft, standard, robust, thorough or paper
    #[arg(long, default_value = "standard")]
    preset: Preset,
    /// A JSON file with settings in place of the preset's
    #[arg(long, value_name = "FILE", hide_short_help = true)]
    settings: Option<PathBuf>,
    /// A JSON file with settings for trade to time besides its own: [{"name": "quick", "preset": "draft", "settings":
    /// {"steps": 60}}]
    #[arg(long, value_name = "FILE")]
    variants: Option<PathBuf>,
    /// Only these variants: those of trade where that is among the experiments, or else of all of them
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    only: Vec<String>,
    /// Only these attacks of robustness, and others that are no line of it: none, jpeg:50..95, tint:1.05/1/0.95, and
    /// occlusion:0.1, or the suites paper, everyday and all
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    attacks: Vec<String>,
    /// Side of the pictures that are read, in pixels
    #[arg(long, value_name = "PX", default_value_t = 160, value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: u32,
    /// Held-out views of each mark
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=1000))]
    views: u32,
    /// What reads pictures: clip, or hidden for convolutional decoders, one trained for each length and seed
    #[arg(long, value_enum, default_value = "clip")]
    extractor: Extractor,
    /// A CLIP that was added with `models add`, instead of the shipped one
    #[arg(long)]
    clip: Option<String>,
    /// Weights of the learned codec that the paper attacks with, as a safetensors file: CompressAI's bmshj2018-factorized,
    /// quality 3. Without them that attack is not measured
    #[arg(long, value_name = "FILE")]
    vae: Option<PathBuf>,
    /// Where to compute: auto, wgpu or cpu
    #[arg(long, default_value = "auto")]
    device: DeviceChoice,
    #[command(flatten)]
    budget: Budget,
    /// Makes the reports of what is there, and nothing new
    #[arg(long)]
    report_only: bool,
    /// A Markdown file whose tables between markers are replaced too
    #[arg(long, value_name = "FILE")]
    document: Option<PathBuf>,
    /// An SVG file for the plots of trade, or of claims
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<Exit> {
    if arguments.plot.is_some() && plotted(arguments).is_none() {
        return Err(Error::bad_option(
            "plot",
            "it is of trade or of claims: name one of them in --experiments, and not both",
        ));
    }
    // What is refused leaves no folder behind.
    let mut tools = None;
    if !arguments.report_only {
        check(arguments)?;
        let compute = match arguments.extractor {
            Extractor::Clip => load::device(
                arguments.device,
                arguments.clip.as_deref().unwrap_or(ShippedClip::NEWEST),
                load::Work::Reading,
            )?,
            Extractor::Hidden => open(arguments.device)?,
        };
        let vae = vae(arguments, &compute)?;
        tools = Some((compute, vae));
    } else if !arguments.folder.is_dir() {
        return Err(Error::bad_option(
            "DIR",
            format!("{} is no folder of results", arguments.folder.display()),
        ));
    }
    let mut store = Store::open(&arguments.folder).map_err(Error::Evaluation)?;
    if let Some((compute, vae)) = tools {
        measure(arguments, &mut store, compute, vae)?;
    }
    write_reports(arguments, &store)?;
    Ok(Exit::Done)
}

/// The experiment whose plots a file of their own gets: the one of two that has any.
fn plotted(arguments: &Arguments) -> Option<Experiment> {
    let asked =
        [Experiment::Trade, Experiment::Claims].map(|kind| arguments.experiments.contains(&kind).then_some(kind));
    match asked {
        [Some(kind), None] | [None, Some(kind)] => Some(kind),
        _ => None,
    }
}

/// Whether there are settings that can be used, and scenes that can be opened: a run of hours should not end at its
/// last scene.
fn check(arguments: &Arguments) -> Result<()> {
    timed(arguments)?;
    robustness(arguments)?;
    if let (Extractor::Hidden, Some(name)) = (arguments.extractor, &arguments.clip) {
        return Err(Error::bad_option(
            "clip",
            format!("--extractor hidden reads without a CLIP, so {name:?} has no use"),
        ));
    }
    if arguments.scenes.is_empty() {
        return Err(Error::bad_option(
            "scenes",
            "name at least one, or ask for --report-only",
        ));
    }
    for scene in &arguments.scenes {
        std::fs::File::open(scene).map_err(Error::io(scene))?;
    }
    Ok(())
}

/// The learned codec, if its weights were given.
fn vae(arguments: &Arguments, compute: &Compute) -> Result<Option<Vae>> {
    let Some(path) = &arguments.vae else {
        if arguments.experiments.contains(&Experiment::Robustness) {
            eprintln!("note: {VAE} is not measured: no weights (--vae FILE)");
        }
        return Ok(None);
    };
    match Vae::load(path, &compute.device) {
        Ok(vae) => Ok(Some(vae)),
        Err(guardsplat_distortion::Error::Io { path, source }) => Err(Error::io(path)(source)),
        Err(other) => Err(Error::bad_option("vae", other.to_string())),
    }
}

fn measure(arguments: &Arguments, store: &mut Store, compute: Compute, vae: Option<Vae>) -> Result<()> {
    let trade = Trade {
        // Without the name of the card.
        device: compute.name.split(':').next().unwrap_or_default().into(),
        variants: timed(arguments)?,
    };
    let mut plan = plan(
        &arguments.experiments,
        &settings(arguments, arguments.preset)?,
        &arguments.bits,
        &trade,
        &robustness(arguments)?,
    )?;
    if !arguments.experiments.contains(&Experiment::Trade) {
        plan.keep_only(&arguments.only)?;
    }
    for missing in plan.missing_programs() {
        eprintln!("note: not all attacks are measured: {missing}");
    }
    let options = Options {
        scenes: arguments.scenes.clone(),
        seeds: arguments.seeds.clone(),
        size: arguments.size,
        views: arguments.views as usize,
        vae,
    };
    let folder = arguments.folder.join("keys");
    std::fs::create_dir_all(&folder).map_err(Error::io(&folder))?;
    let mut display = Display::new("marking");
    let engine = |bits, seed| engine(arguments, &folder, compute.clone(), bits, seed);
    carry_out(&plan, &options, store, engine, |progress| match progress {
        Progress::Mark(done, total, what) => display.say(&format!("mark {done} of {total}: {what}")),
        Progress::Embedding(embed::Progress::Step(step)) => display.set(step.step, step.total, || {
            format!("bits {:.1} %, PSNR {:.1} dB", 100.0 * step.bit_accuracy, step.psnr_db)
        }),
        Progress::Embedding(_) => {}
        Progress::Read(attack, accuracy) => display.say(&format!("  {attack}: {:.2} %", 100.0 * accuracy)),
        Progress::Claimed(about, matches, of) => display.say(&format!("  claims, {about}: {matches} of {of} match")),
        Progress::ReadAll(attacks, time) => {
            display.say(&format!(
                "  read under {attacks} attacks in {:.0} s",
                time.as_secs_f64()
            ));
        }
        Progress::Failed(why) => display.say(&format!("  failed: {why}")),
        Progress::Detected(bits, detector, area) => display.say(&format!("{bits} bits, {detector}: area {area:.3}")),
    })
}

/// The settings of a preset, with those of the file in their place.
fn settings(arguments: &Arguments, preset: Preset) -> Result<Settings> {
    let settings = preset.settings();
    match &arguments.settings {
        None => Ok(settings),
        Some(path) => Ok(settings.overridden(&std::fs::read_to_string(path).map_err(Error::io(path))?)?),
    }
}

/// What trade times, if it is asked for.
fn timed(arguments: &Arguments) -> Result<Vec<Variant>> {
    let base = settings(arguments, arguments.preset)?;
    let own = match &arguments.variants {
        None => None,
        Some(path) => Some(std::fs::read_to_string(path).map_err(Error::io(path))?),
    };
    let only = match arguments.experiments.contains(&Experiment::Trade) {
        true => arguments.only.as_slice(),
        false => &[],
    };
    variants(&base, own.as_deref(), only)
}

/// What robustness measures.
fn robustness(arguments: &Arguments) -> Result<Robustness> {
    if !arguments.attacks.is_empty() && !arguments.experiments.contains(&Experiment::Robustness) {
        return Err(Error::bad_option(
            "attacks",
            "they are of robustness: name it in --experiments",
        ));
    }
    Ok(Robustness {
        robust: settings(arguments, Preset::Robust)?,
        attacks: attacks(&arguments.attacks)?,
    })
}

/// The engine for a length and a seed, with a key that is kept in `folder`, and the seconds that making it took.
fn engine(
    arguments: &Arguments,
    folder: &Path,
    compute: Compute,
    bits: usize,
    seed: u64,
) -> Result<(Engine, Key, Option<f64>)> {
    let clip = arguments.clip.as_deref();
    let start = Instant::now();
    let stop = Stop::default();
    let name = match arguments.extractor {
        Extractor::Clip => clip.unwrap_or(ShippedClip::NEWEST),
        Extractor::Hidden => HIDDEN,
    };
    let hidden = HiddenKeyOptions {
        bits,
        seed: Some(seed),
        steps: None,
        robust_to: RobustTo::none(),
    };
    let path = folder.join(format!("{name}-{bits}-{seed}.key"));
    let known = path.is_file().then(|| Key::read(&path)).transpose()?;
    let known = match arguments.extractor {
        Extractor::Clip => {
            let (_, identity) = load::clip(name, &compute, Parts::Image)?;
            // A key of another CLIP of that name is one of an earlier version.
            known.filter(|key| key.clip.hash == identity.hash)
        }
        Extractor::Hidden => known.filter(|key| key.clip.hash == hidden.recipe()),
    };
    let (key, seconds) = match known {
        Some(key) => (key, None),
        None => {
            let key = match arguments.extractor {
                Extractor::Clip => {
                    let options = KeyOptions {
                        bits,
                        coded: true,
                        bits_per_token: None,
                        seed: Some(seed),
                        robust_to: RobustTo::none(),
                        training: TrainingOptions::default(),
                    };
                    create_key::create(
                        &options,
                        create_key::ProjectionOverrides::default(),
                        clip,
                        &compute,
                        &stop,
                        |_| {},
                    )?
                }
                Extractor::Hidden => create_hidden_key(&hidden, &compute, &stop, |_, _| {})?,
            };
            key.write(&path)?;
            (key, Some(start.elapsed().as_secs_f64()))
        }
    };
    let engine = load::engine(
        &path,
        &key,
        clip,
        arguments.device,
        load::Work::Reading,
        true,
        arguments.budget.bytes(),
    )?;
    Ok((engine, key, seconds))
}

fn write_reports(arguments: &Arguments, store: &Store) -> Result<()> {
    let Some(selection) = Selection::newest(store.records()) else {
        print_line("nothing was measured yet");
        return Ok(());
    };
    let options = ReportOptions {
        per_scene: true,
        ..ReportOptions::default()
    };
    let folder = &arguments.folder;
    let write = || -> guardsplat_evaluation::Result<()> {
        let reports = arguments
            .experiments
            .iter()
            .map(|kind| report(*kind, &selection, &options))
            .collect::<guardsplat_evaluation::Result<Vec<_>>>()?;
        output::write_json(&reports, &folder.join("report.json"))?;
        output::write_csv(&selection, &folder.join("readings.csv"))?;
        if arguments.experiments.contains(&Experiment::Robustness) {
            output::write_robustness_csv(&selection, &folder.join("robustness.csv"))?;
        }
        output::write_html(&reports, folder, &folder.join("report.html"))?;
        if let Some(path) = &arguments.plot {
            let of = plotted(arguments).map(Experiment::name);
            let report = reports.iter().find(|report| Some(report.name.as_str()) == of);
            output::write_svg(report.map_or(&[], |report| &report.plots), path)?;
        }
        if let Some(document) = &arguments.document {
            for report in &reports {
                output::write_markdown(report, document)?;
            }
        }
        Ok(())
    };
    write().map_err(Error::Evaluation)?;
    print_line(&format!("written to {}", folder.join("report.html").display()));
    Ok(())
}
