//! `inspect`.
use std::path::PathBuf;

use clap::Args;
use guardsplat_engine::Result;
use guardsplat_engine::clip::{Clip, Parts};
use guardsplat_engine::device::{DeviceChoice, open};
use guardsplat_engine::embed::{Preset, measure_view_on_cpu, predict_memory};
use guardsplat_engine::extract::rasterizer;
use guardsplat_engine::memory::{
    Bytes, Limits, MemoryRequirements, ModelBytes, SceneSize, admission, picture_bytes, rendering_requirements,
};
use guardsplat_engine::quality::Difficulty;
use guardsplat_engine::scene::{BadRows, Gaussians, Ignored, Scene};
use guardsplat_engine::splat::{Geometry, WeightCache, sh};
use guardsplat_engine::view::{Extent, Openness, SceneKind, Split, ViewSampler};
use serde::Serialize;

use super::{Budget, Exit, Kind, print_json, print_line};
use crate::operations::load;

/// Side of the views that are looked at: what a preset trains on would find no more Gaussians, only later.
const SIDE: u32 = 160;
/// Held-out views that tell how hard a scene is.
const LOOKED_AT: u64 = 12;
/// Side of pictures for the prediction of `render`: its own default.
const PICTURE: u32 = 512;

#[derive(Args)]
pub struct Arguments {
    /// The scene: PLY, compressed PLY, SPZ, SOG (also as a folder), glTF or .splat
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Counts the Gaussians that so many training views show; takes a while
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u32).range(1..=1000))]
    views: Option<u32>,
    /// Where the scene's viewers are, as for `embed`: a file (cameras.json or transforms.json), or a folder of COLMAP
    #[arg(long, value_name = "PATH")]
    cameras: Option<PathBuf>,
    /// The kind of scene, which says where its viewers are; found from the scene unless given
    #[arg(long, value_enum, conflicts_with = "cameras")]
    kind: Option<Kind>,
    /// Leaves out rows with NaN and other impossible values instead of refusing the scene
    #[arg(long)]
    ignore_bad_rows: bool,
    #[command(flatten)]
    budget: Budget,
    /// Prints JSON on standard output
    #[arg(long)]
    json: bool,
}

/// What there is to say of a scene.
#[derive(Serialize)]
struct Report {
    format: &'static str,
    file_bytes: u64,
    gaussians: usize,
    ignored_rows: usize,
    #[serde(skip)]
    ignored: Option<Ignored>,
    sh_degree_stored: Option<u64>,
    sh_degree_used: usize,
    sh_degree_learned: usize,
    colours_rounded: bool,
    extent: Option<Where>,
    kind: Option<Found>,
    difficulty: Option<Difficulty>,
    cameras: Option<Viewers>,
    views: Option<u32>,
    seen_gaussians: Option<usize>,
    memory_limit_bytes: u64,
    render: Need,
    embed: Option<Need>,
}

/// Where a scene is.
#[derive(Serialize)]
struct Where {
    centre: [f32; 3],
    radius: f32,
    up: [f32; 3],
    on_ground: bool,
}

/// The kind of a scene.
#[derive(Serialize)]
struct Found {
    /// By its geometry.
    found: SceneKind,
    /// The one that views are made for; none where cameras were given.
    used: Option<SceneKind>,
    /// What the geometry says.
    #[serde(flatten)]
    openness: Openness,
}

/// Cameras that were given.
#[derive(Serialize)]
struct Viewers {
    training: usize,
    held_out: usize,
    /// How near a training view comes to an opaque Gaussian; none where no Gaussian is.
    clearance: Option<f32>,
}

/// What a command will need of the memory.
#[derive(Serialize)]
struct Need {
    bytes: u64,
    parts: MemoryRequirements,
    fits: bool,
}

impl Found {
    fn text(&self) -> String {
        let Openness {
            hollow,
            inside,
            seen_from_front,
            hidden_from_front,
            hidden_from_behind,
            seen_from_above,
            flatness,
            ..
        } = self.openness;
        let percent = |share: f32| format!("{:.0} %", 100.0 * share);
        let used = match self.used {
            Some(used) if used == self.found => used.to_string(),
            Some(used) => format!("{used}, as was said, found to be {}", self.found),
            None => format!("{}, which says nothing where cameras are given", self.found),
        };
        format!(
            "{used}: {} hollow, {} seen from inside only; {} seen from the front and {} hidden, {} hidden from behind; {} seen from above; height {:.2} of its width",
            percent(hollow),
            percent(inside),
            percent(seen_from_front),
            percent(hidden_from_front),
            percent(hidden_from_behind),
            percent(seen_from_above),
            flatness
        )
    }
}

impl Need {
    fn new(parts: MemoryRequirements, limits: &Limits) -> Self {
        Self {
            bytes: parts.total(),
            fits: limits.admit(&parts).is_ok(),
            parts,
        }
    }

    fn line(&self) -> String {
        let fits = if self.fits { "fits" } else { "does not fit" };
        format!("{}: {fits}", self.parts)
    }
}

pub fn run(arguments: &Arguments) -> Result<Exit> {
    let limits = Limits::of_machine(arguments.budget.bytes());
    let rest = MemoryRequirements::of_program();
    admission::admit_reading(&arguments.scene, &limits, rest)?;
    let head = admission::summary_of(&arguments.scene);
    let bad_rows = BadRows::ignored_if(arguments.ignore_bad_rows);
    let scene = Scene::read_with_files(&arguments.scene, bad_rows, limits.left(&rest))?;
    let gaussians = &scene.gaussians;
    let cameras = load::cameras(arguments.cameras.as_deref())?;
    let size = SceneSize::of(&scene);
    let render = rendering_requirements(size, picture_bytes(PICTURE, PICTURE));
    let (mut extent, mut embed, mut seen, mut viewers) = (None, None, None, None);
    let (mut kind, mut difficulty) = (None, None);
    // Of nothing there is nothing to be seen.
    if !gaussians.is_empty() {
        extent = Some(Extent::of(gaussians)?);
        let mut settings = Preset::Standard.settings();
        settings.kind = arguments.kind.map(Kind::scene);
        let view = measure_view_on_cpu(gaussians, &settings, &cameras)?;
        let clip = Clip::shipped(&open(DeviceChoice::Cpu)?.device, Parts::Image)?;
        let clip = 4 * clip.parameters() as u64;
        let models = ModelBytes {
            learning: clip,
            verifying: clip,
        };
        embed = Some(predict_memory(size, view, &settings, models));
        let sampler = ViewSampler::seen_from(gaussians, 0, settings.viewpoints(&cameras))?;
        let (found, openness) = SceneKind::of(gaussians)?;
        kind = Some(Found {
            found,
            used: cameras.is_empty().then(|| sampler.kind()),
            openness,
        });
        difficulty = Some(measure_difficulty(gaussians, &sampler)?);
        seen = (arguments.views.map(|views| count_seen(gaussians, &sampler, views))).transpose()?;
        viewers = sampler.given().map(|given| Viewers {
            training: given.training_cameras(),
            held_out: given.held_out_cameras(),
            clearance: Some(given.clearance()).filter(|distance| distance.is_finite()),
        });
    }
    let report = Report {
        format: scene.format().name(),
        file_bytes: size.file,
        gaussians: gaussians.len(),
        ignored_rows: scene.ignored().map_or(0, Ignored::count),
        ignored: scene.ignored().cloned(),
        sh_degree_stored: head.map(|head| head.degree),
        sh_degree_used: gaussians.sh.degree,
        sh_degree_learned: scene.learnable_degree(),
        colours_rounded: !scene.exact(),
        extent: extent.map(|extent| Where {
            centre: extent.centre,
            radius: extent.radius,
            up: extent.up,
            on_ground: extent.on_ground,
        }),
        kind,
        difficulty,
        cameras: viewers,
        views: arguments.views,
        seen_gaussians: seen,
        memory_limit_bytes: limits.memory,
        render: Need::new(render, &limits),
        embed: embed.map(|parts| Need::new(parts, &limits)),
    };
    if arguments.json {
        print_json(&report)?;
    } else {
        tell(&report);
    }
    Ok(Exit::Done)
}

/// What some held-out views show.
fn measure_difficulty(gaussians: &Gaussians, sampler: &ViewSampler) -> Result<Difficulty> {
    let rasterizer = rasterizer(&open(DeviceChoice::Cpu)?)?;
    let geometry = Geometry::new(gaussians);
    let view = |index: u64| {
        let view = geometry.prepare(&sampler.camera(Split::HeldOut, index, SIDE), WeightCache::None)?;
        let colours = sh::colours(&gaussians.sh, None, &view);
        let [white, black] = [1.0, 0.0].map(|ground| rasterizer.render(&view, &colours, [ground; 3]));
        Ok([white?.to_8_bit(), black?.to_8_bit()])
    };
    Difficulty::of(&(0..LOOKED_AT).map(view).collect::<Result<Vec<_>>>()?)
}

/// How many Gaussians so many training views show.
fn count_seen(gaussians: &Gaussians, sampler: &ViewSampler, views: u32) -> Result<usize> {
    let geometry = Geometry::new(gaussians);
    let mut seen = vec![false; gaussians.len()];
    for index in 0..u64::from(views) {
        let camera = sampler.camera(Split::Training, index, SIDE);
        for row in geometry.prepare(&camera, WeightCache::Weights)?.visible {
            seen[row as usize] = true;
        }
    }
    Ok(seen.into_iter().filter(|seen| *seen).count())
}

fn tell(report: &Report) {
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
        line("kind", kind.text());
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
}
