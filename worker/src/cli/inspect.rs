//! `inspect`.
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use guardsplat_engine::device::DeviceChoice;
use guardsplat_engine::embed::Preset;
use guardsplat_engine::memory::Bytes;
use guardsplat_engine::message::Key;
use guardsplat_engine::scene::BadRows;
use guardsplat_engine::stop::Stop;
use guardsplat_engine::view::Openness;
use guardsplat_engine::{Error, Result};
use guardsplat_operations::forecast::{Told, Wish};
use guardsplat_operations::inspect::{Asked, Found, Inspection, inspect};
use guardsplat_operations::load;

use super::{Budget, Exit, Kind, print_json, print_line};

#[derive(Args)]
pub struct Arguments {
    /// The scene: PLY, compressed PLY, SPZ, SOG (also as a folder, and streamed), glTF, .ksplat or .splat
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Counts the Gaussians that so many training views show; takes a while
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u32).range(1..=1000))]
    views: Option<u32>,
    /// Where the scene's viewers are, as for `embed`: a file (cameras.json, transforms.json or a glTF), or a folder of COLMAP
    #[arg(long, value_name = "PATH")]
    cameras: Option<PathBuf>,
    /// The kind of scene, which says where its viewers are; found from the scene unless given
    #[arg(long, value_enum, conflicts_with = "cameras")]
    kind: Option<Kind>,
    /// The level of detail of a SOG with a lod-meta.json; 0 is the finest
    #[arg(long, value_name = "N", default_value_t = 0)]
    level: u32,
    /// Leaves out rows with NaN and other impossible values instead of refusing the scene
    #[arg(long)]
    ignore_bad_rows: bool,
    /// Forecasts what marking would come to, by a short trial of an eighth of its steps
    #[arg(long)]
    forecast: bool,
    /// The key that the forecast is for; one is made for it unless given
    #[arg(long, requires = "forecast")]
    key: Option<PathBuf>,
    /// Bits of the message that the forecast is for
    #[arg(long, requires = "forecast", conflicts_with = "key", default_value_t = 32)]
    bits: usize,
    /// The message of the later mark in hexadecimal, for a forecast that is right about it; any other unless given
    #[arg(long, value_name = "HEX", requires = "forecast")]
    message: Option<String>,
    /// The preset that the forecast is for: draft, standard, robust or thorough
    #[arg(long, requires = "forecast", default_value = "standard")]
    preset: Preset,
    /// Where the forecast is computed: auto, wgpu or cpu
    #[arg(long, requires = "forecast", default_value = "auto")]
    device: DeviceChoice,
    #[command(flatten)]
    budget: Budget,
    /// Prints JSON on standard output
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &Arguments) -> Result<Exit> {
    let read = |path: &PathBuf| Ok::<_, Error>((path.clone(), Arc::new(Key::read(path)?)));
    let wish = Wish {
        key: arguments.key.as_ref().map(read).transpose()?,
        bits: arguments.bits,
        message: arguments.message.clone(),
        preset: arguments.preset,
        device: arguments.device,
        stop: Stop::default(),
    };
    let asked = Asked {
        views: arguments.views,
        cameras: load::cameras(arguments.cameras.as_deref())?,
        kind: arguments.kind.map(Kind::scene),
        level: arguments.level as usize,
        bad_rows: BadRows::ignored_if(arguments.ignore_bad_rows),
        memory: arguments.budget.bytes(),
        forecast: arguments.forecast.then_some(wish),
    };
    let report = inspect(&arguments.scene, &asked)?;
    if arguments.json {
        print_json(&report)?;
    } else {
        tell(&report);
    }
    Ok(Exit::Done)
}

/// The kind of a scene and why, in words.
fn kind_text(kind: &Found) -> String {
    let Openness {
        hollow,
        inside,
        seen_from_front,
        hidden_from_front,
        hidden_from_behind,
        seen_from_above,
        flatness,
        spread,
        surrounded,
        vantage,
        ..
    } = kind.openness;
    let percent = |share: f32| format!("{:.0} %", 100.0 * share);
    let used = match kind.used {
        Some(used) if used == kind.found => used.to_string(),
        Some(used) => format!("{used}, as was said, found to be {}", kind.found),
        None => format!("{}, which says nothing where cameras are given", kind.found),
    };
    let views = vantage.map_or_else(String::new, |seen| {
        format!(
            "; views from all around see {} of its Gaussians, those from the front {}; from all around {} of what is in view comes through, from inside {}",
            percent(seen.seen_from_around),
            percent(seen.seen_from_front),
            percent(seen.clear_from_around),
            percent(seen.clear_from_inside)
        )
    });
    format!(
        "{used}: {} hollow, {} seen from inside only; {} seen from the front and {} hidden, {} hidden from behind; {} seen from above; height {:.2} of its width; goes {:.1} times as far as what is fine in it, around which {} of the horizon is covered{views}",
        percent(hollow),
        percent(inside),
        percent(seen_from_front),
        percent(hidden_from_front),
        percent(hidden_from_behind),
        percent(seen_from_above),
        flatness,
        spread,
        percent(surrounded)
    )
}

/// What to expect of a mark, in words.
fn forecast_text(told: &Told) -> String {
    let of = &told.forecast;
    let psnr = match (of.psnr_db, of.psnr_covered_db) {
        (Some(whole), Some(covered)) => format!(", {whole:.1} dB ({covered:.1} over what the scene covers)"),
        _ => String::new(),
    };
    let verdict = match told.meets_target {
        true => "will be written",
        false if of.is_stuck() => {
            "would miss its target and not be written; its wrong bits hardly move, so that another key or message helps rather than more steps"
        }
        false => "would miss its target and not be written",
    };
    format!(
        "{} bits, preset {}: {:.0} % of the bits of a view{psnr}, {:.0} s; {verdict}",
        told.bits,
        told.preset,
        100.0 * of.bit_accuracy,
        of.seconds
    )
}

fn tell(report: &Inspection) {
    let line = |name: &str, text: String| print_line(&format!("{name:10} {text}"));
    let file = Bytes(report.file_bytes);
    line("format", format!("{}, {file} uncompressed", report.format));
    line("Gaussians", report.gaussians.to_string());
    if let Some(ignored) = &report.ignored {
        line("bad rows", ignored.to_string());
    }
    let used = report.sh_degree_used;
    let stored = match report.sh_degree_stored {
        Some(stored) if stored != used as u64 => format!(" of {stored} in the file"),
        _ => String::new(),
    };
    let rounded = if report.colours_rounded {
        ", in the steps of the format"
    } else {
        ""
    };
    let learned = report.sh_degree_learned;
    line(
        "colour",
        format!("degree {used}{stored} is in use; an embedding learns up to degree {learned}{rounded}"),
    );
    match &report.extent {
        Some(extent) => {
            let ground = if extent.on_ground { ", on ground" } else { "" };
            let (centre, radius, up) = (extent.centre, extent.radius, extent.up);
            line(
                "extent",
                format!("centre {centre:?}, radius {radius}, up {up:?}{ground}"),
            );
        }
        None => line("extent", "none: there is nothing to see or mark".into()),
    }
    if let Some(kind) = &report.kind {
        line("kind", kind_text(kind));
    }
    if let Some(seen) = &report.difficulty {
        let percent = |share: f64| format!("{:.0} %", 100.0 * share);
        let of_picture = format!("covers {} of a view", percent(seen.covered));
        let colours = format!(
            "lightness {:.2}, colours spread by {:.3}",
            seen.lightness, seen.chroma_spread
        );
        let room = format!("{} of values at an end", percent(seen.at_ends));
        let thin = format!("texture {:.3}, {} at an edge", seen.texture, percent(seen.thinness));
        let saturation = format!("saturation {:.2}", seen.saturation);
        line(
            "looks",
            format!("{of_picture}; {colours}, {saturation}, {room}; {thin}"),
        );
    }
    if let Some(cameras) = &report.cameras {
        let near = cameras.clearance.map_or_else(String::new, |distance| {
            format!("; views come no nearer than {distance:.3} to what is opaque")
        });
        line(
            "cameras",
            format!("{} to train at, {} held out{near}", cameras.training, cameras.held_out),
        );
    }
    if let (Some(views), Some(seen)) = (report.views, report.seen_gaussians) {
        let share = 100.0 * seen as f64 / report.gaussians.max(1) as f64;
        line(
            "seen",
            format!("{seen} Gaussians ({share:.1} %) in {views} training views"),
        );
    }
    line("memory", format!("{} may be used", Bytes(report.memory_limit_bytes)));
    line("  render", report.render.line());
    if let Some(embed) = &report.embed {
        line("  embed", format!("{} (preset standard, on the CPU)", embed.line()));
    }
    if let Some(told) = &report.forecast {
        line("forecast", forecast_text(told));
        if let Some(shorter) = &told.shorter {
            line("  instead", forecast_text(shorter));
        }
    }
}
