//! `verify`.
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use guardsplat_codeword::Verdict;
use guardsplat_engine::Result;
use guardsplat_engine::device::DeviceChoice;
use guardsplat_engine::extract::{Comparison, DEFAULT_VIEWS, find_source};
use guardsplat_engine::message::Key;
use guardsplat_engine::scene::{BadRows, Ignored};

use super::display::Display;
use super::{Background, Budget, Exit, Kind, print_json, print_line};
use guardsplat_operations::comparison::read_and_compare;
use guardsplat_operations::load;
use guardsplat_operations::suspect::Suspect;
use guardsplat_operations::verification::Views;
use guardsplat_operations::verification_report::{VerificationReport, VerifyReport};

#[derive(Args)]
pub struct Arguments {
    /// Scenes (PLY, compressed PLY, SPZ, SOG, glTF, .ksplat, .splat), pictures (PNG, JPEG, WebP, OpenEXR) and folders of them, all of one
    /// suspect
    #[arg(value_name = "PATH", required = true)]
    paths: Vec<PathBuf>,
    /// The key file
    #[arg(long)]
    key: PathBuf,
    /// The message to compare with, in hexadecimal
    #[arg(long, value_name = "HEX")]
    message: Option<String>,
    /// The unmarked scene: pictures that do not match as they are given are compared with it, so that neither what is behind
    /// the scene nor a filter matters
    #[arg(long, value_name = "SCENE")]
    original: Option<PathBuf>,
    /// Where to compute: auto, wgpu or cpu
    #[arg(long, default_value = "auto")]
    device: DeviceChoice,
    #[command(flatten)]
    budget: Budget,
    /// Views that a scene is read from
    #[arg(long, default_value_t = DEFAULT_VIEWS as u32, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    views: u32,
    /// Side of these views in pixels; CLIP's input unless given
    #[arg(long, value_name = "PX", value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: Option<u32>,
    /// What is behind a scene, or shows through transparent pixels
    #[arg(long, value_enum, default_value = "white")]
    background: Background,
    /// Where a scene's viewers are, from a file (cameras.json, transforms.json or a glTF) or a folder of COLMAP, as `embed` was told
    #[arg(long, value_name = "FILE")]
    cameras: Option<PathBuf>,
    /// The kind of scene, which says where its viewers are; found from the scene unless given
    #[arg(long, value_enum, conflicts_with = "cameras")]
    kind: Option<Kind>,
    /// The level of detail of a SOG with a lod-meta.json; 0 is the finest
    #[arg(long, value_name = "N", default_value_t = 0)]
    level: u32,
    /// Decides the views of a scene
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Leaves out Gaussians of a scene with NaN and other impossible values instead of refusing it
    #[arg(long)]
    ignore_bad_rows: bool,
    /// A CLIP that was added with `models add`, instead of the one that the key names
    #[arg(long)]
    clip: Option<String>,
    /// Prints JSON on standard output
    #[arg(long)]
    json: bool,
    /// With the logits of every view or picture, a number a bit, positive for 1
    #[arg(long, requires = "json")]
    logits: bool,
}

pub fn run(arguments: &Arguments) -> Result<Exit> {
    let start = Instant::now();
    let suspect: Suspect = find_source(&arguments.paths)?.into();
    let key = Key::read(&arguments.key)?;
    let message = arguments.message.as_deref().map(|text| key.message(text)).transpose()?;
    let engine = load::engine(
        &arguments.key,
        &key,
        arguments.clip.as_deref(),
        arguments.device,
        load::Work::Reading,
        false,
        arguments.budget.bytes(),
    )?;
    let views = Views {
        count: arguments.views as usize,
        size: arguments.size,
        background: arguments.background.rgb(),
        seed: arguments.seed,
        cameras: load::cameras(arguments.cameras.as_deref())?,
        kind: arguments.kind.map(Kind::scene),
        bad_rows: BadRows::ignored_if(arguments.ignore_bad_rows),
        with_files: true,
        level: arguments.level as usize,
    };
    let mut display = Display::new("reading");
    let original = arguments.original.as_deref();
    let compared = read_and_compare(&engine, &suspect, &views, original, message.as_ref(), |done, total| {
        display.set(done, total, String::new);
    })?;
    drop(display);
    let report = VerifyReport {
        findings: VerificationReport::of(&engine.message_code, &compared)?,
        seconds: start.elapsed().as_secs_f64(),
        device: &engine.compute.name,
        clip: &key.clip.name,
        logits: arguments.logits.then_some(&compared.reading.views[..]),
    };
    if arguments.json {
        print_json(&report)?;
    } else {
        tell(&report.findings, compared.comparison.as_ref(), &compared.ignored);
    }
    Ok(match report.findings.verdict {
        Verdict::Match => Exit::Done,
        Verdict::NoMatch => Exit::NoMatch,
        Verdict::Inconclusive | Verdict::UnknownKey => Exit::Inconclusive,
    })
}

fn tell(report: &VerificationReport, comparison: Option<&Comparison>, ignored: &[Ignored]) {
    let verdict = match report.verdict {
        Verdict::Match => "match",
        Verdict::NoMatch => "no match",
        Verdict::Inconclusive => "inconclusive",
        Verdict::UnknownKey => "unknown key",
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
    if let Some(hypothesis) = &report.hypothesis {
        print_line(&format!("read best of {} ways: {hypothesis}", report.hypotheses));
    }
    let explained = &report.explained_by_original;
    if !explained.is_empty() {
        let shown = explained.iter().flatten().count();
        print_line(&format!(
            "{shown} of {} pictures show the original's scene",
            explained.len()
        ));
    }
    if let Some(reason) = &report.reason {
        print_line(reason);
    }
    for ignored in ignored {
        print_line(&ignored.to_string());
    }
}
