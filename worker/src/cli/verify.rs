//! `verify`.
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use guardsplat_worker::Result;
use guardsplat_worker::device::DeviceChoice;
use guardsplat_worker::extract::{
    Comparison, DEFAULT_VIEWS, Engine, Reading, Source, default_size, find_source, read_scene,
};
use guardsplat_worker::message::{Key, Verdict};
use guardsplat_worker::quality::read_picture;
use guardsplat_worker::scene::Scene;
use serde::Serialize;

use super::display::Display;
use super::{Background, Exit, load, print_json, print_line};

#[derive(Args)]
pub struct Arguments {
    /// A scene (PLY), or pictures (PNG, JPEG, WebP) and folders of them
    #[arg(value_name = "PATH", required = true)]
    paths: Vec<PathBuf>,
    /// The key file
    #[arg(long)]
    key: PathBuf,
    /// The message to compare with, in hexadecimal
    #[arg(long, value_name = "HEX")]
    message: Option<String>,
    /// Where to compute: auto, wgpu or cpu
    #[arg(long, default_value = "auto")]
    device: DeviceChoice,
    /// Views that a scene is read from
    #[arg(long, default_value_t = DEFAULT_VIEWS as u32, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    views: u32,
    /// Side of these views in pixels; CLIP's input unless given
    #[arg(long, value_name = "PX", value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: Option<u32>,
    /// What is behind a scene, or shows through transparent pixels
    #[arg(long, value_enum, default_value = "white")]
    background: Background,
    /// Decides the views of a scene
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// A CLIP that was added with `models add`, instead of the one that the key names
    #[arg(long)]
    clip: Option<String>,
    /// Prints JSON on standard output
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report<'a> {
    verdict: Verdict,
    p_value: Option<f64>,
    threshold: Option<f64>,
    matched_bits: Option<u32>,
    needed_bits: Option<u32>,
    bits: usize,
    views: usize,
    /// The message read.
    message: String,
    bit_accuracy: Option<f64>,
    bit_accuracy_worst_view: Option<f64>,
    mean_abs_logit: f64,
    view_agreement: f64,
    reason: Option<&'a str>,
    seconds: f64,
    device: &'a str,
    clip: &'a str,
}

/// Why a reading that has nothing to be compared with decides nothing.
const NOTHING_TO_COMPARE: &str = "any scene reads as some message; --message decides";

pub fn run(arguments: &Arguments) -> Result<Exit> {
    let start = Instant::now();
    let source = find_source(&arguments.paths)?;
    let key = Key::read(&arguments.key)?;
    let message = arguments.message.as_deref().map(|text| key.message(text)).transpose()?;
    let engine = load::engine(&arguments.key, &key, arguments.clip.as_deref(), arguments.device, false)?;
    let reading = read(arguments, &engine, &source)?;
    let comparison = message.map(|message| reading.compare(&message)).transpose()?;
    let decision = comparison.as_ref().map(|c| &c.decision);
    let report = Report {
        verdict: decision.map_or(Verdict::Inconclusive, |d| d.verdict),
        p_value: decision.map(|d| d.p_value),
        threshold: decision.map(|d| d.threshold),
        matched_bits: decision.map(|d| d.matched_bits),
        needed_bits: decision.and_then(|d| d.needed_bits),
        bits: key.bits(),
        views: reading.views.len(),
        message: reading.message()?.to_string(),
        bit_accuracy: comparison.as_ref().map(|c| c.bit_accuracy),
        bit_accuracy_worst_view: comparison.as_ref().map(|c| c.bit_accuracy_worst_view),
        mean_abs_logit: reading.mean_abs_logit(),
        view_agreement: reading.agreement(),
        reason: match decision {
            Some(decision) => decision.reason.as_deref(),
            None => Some(NOTHING_TO_COMPARE),
        },
        seconds: start.elapsed().as_secs_f64(),
        device: &engine.compute.name,
        clip: &key.clip.name,
    };
    if arguments.json {
        print_json(&report)?;
    } else {
        tell(&report, comparison.as_ref());
    }
    Ok(match report.verdict {
        Verdict::Match => Exit::Done,
        Verdict::NoMatch => Exit::NoMatch,
        Verdict::Inconclusive => Exit::Inconclusive,
    })
}

fn read(arguments: &Arguments, engine: &Engine, source: &Source) -> Result<Reading> {
    let background = arguments.background.rgb();
    let mut display = Display::new("reading");
    match source {
        Source::Scene(path) => {
            let scene = Scene::read(path)?;
            let views = arguments.views as usize;
            let size = arguments.size.unwrap_or_else(|| default_size(engine));
            read_scene(
                engine,
                &scene.gaussians,
                views,
                size,
                background,
                arguments.seed,
                |done| display.set(done, views, String::new),
            )
        }
        Source::Pictures(paths) => {
            let mut views = Vec::with_capacity(paths.len());
            // One at a time: thousands of large pictures need not fit in memory.
            for (index, path) in paths.iter().enumerate() {
                let picture = read_picture(path, background)?;
                views.extend(engine.read_logits(&[picture])?);
                display.set(index + 1, paths.len(), String::new);
            }
            Reading::new(views)
        }
    }
}

fn tell(report: &Report<'_>, comparison: Option<&Comparison>) {
    let verdict = match report.verdict {
        Verdict::Match => "match",
        Verdict::NoMatch => "no match",
        Verdict::Inconclusive => "inconclusive",
    };
    let read = format!(
        "read {} from {} views; views agree on {:.1} % of bits, mean logit {:.2}",
        report.message,
        report.views,
        100.0 * report.view_agreement,
        report.mean_abs_logit
    );
    print_line(&match comparison {
        Some(found) => format!(
            "{verdict}: {} of {} bits, p = {:.2e} (threshold {:e}); {:.2} % of bits a view, worst {:.2} %; {read}",
            found.decision.matched_bits,
            found.decision.bits,
            found.decision.p_value,
            found.decision.threshold,
            100.0 * found.bit_accuracy,
            100.0 * found.bit_accuracy_worst_view
        ),
        None => format!("{verdict}: {read}"),
    });
    if let Some(reason) = report.reason {
        print_line(reason);
    }
}
