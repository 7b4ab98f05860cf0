//! What a scene file holds, and what marking it takes.
use std::path::Path;

use guardsplat_engine::Result;
use guardsplat_engine::clip::{Clip, Parts};
use guardsplat_engine::device::{DeviceChoice, open};
use guardsplat_engine::embed::{Preset, measure_view_on_cpu, predict_memory};
use guardsplat_engine::extract::rasterizer;
use guardsplat_engine::memory::{
    Limits, MemoryRequirements, ModelBytes, SceneSize, admission, picture_bytes, rendering_requirements,
};
use guardsplat_engine::quality::Difficulty;
use guardsplat_engine::scene::{BadRows, Gaussians, Ignored, Scene};
use guardsplat_engine::splat::{Geometry, WeightCache, sh};
use guardsplat_engine::view::{Camera, Extent, Openness, SceneKind, Split, ViewSampler};
use serde::Serialize;

use crate::forecast::{Told, Wish, tell};

/// Side of the views that are looked at: what a preset trains on would find no more Gaussians, only later.
const SIDE: u32 = 160;
/// Held-out views that tell how hard a scene is.
const LOOKED_AT: u64 = 12;
/// Side of pictures for the prediction of `render`: its own default.
const PICTURE: u32 = 512;

/// What is asked of a scene.
#[derive(Clone, Debug, Default)]
pub struct Asked {
    /// Counts the Gaussians that so many training views show.
    pub views: Option<u32>,
    /// Where the scene's viewers are, if that is known.
    pub cameras: Vec<Camera>,
    /// The kind of scene, instead of the one that is found.
    pub kind: Option<SceneKind>,
    /// The level of detail of a streamed scene, 0 being the finest.
    pub level: usize,
    /// What becomes of rows with values that are not legal.
    pub bad_rows: BadRows,
    /// Bytes of memory that may be used, if not all of the machine's.
    pub memory: Option<u64>,
    /// Marks are forecast by a short trial.
    pub forecast: Option<Wish>,
}

/// What there is to say of a scene.
#[derive(Serialize)]
pub struct Inspection {
    /// The format of the file.
    pub format: &'static str,
    /// Bytes of the file, uncompressed.
    pub file_bytes: u64,
    /// How many Gaussians.
    pub gaussians: usize,
    /// Rows that are none and were ignored.
    pub ignored_rows: usize,
    /// Which these are.
    #[serde(skip)]
    pub ignored: Option<Ignored>,
    /// Degree of the spherical harmonics that the file has room for.
    pub sh_degree_stored: Option<u64>,
    /// The degree that is in use.
    pub sh_degree_used: usize,
    /// The degree up to which an embedding learns.
    pub sh_degree_learned: usize,
    /// Whether the format rounds colours.
    pub colours_rounded: bool,
    /// Where the scene is; none where nothing is.
    pub extent: Option<Where>,
    /// How it was captured.
    pub kind: Option<Found>,
    /// What makes it hard to mark.
    pub difficulty: Option<Difficulty>,
    /// Cameras that were given.
    pub cameras: Option<Viewers>,
    /// Training views that were looked at.
    pub views: Option<u32>,
    /// Gaussians that these show.
    pub seen_gaussians: Option<usize>,
    /// Memory that may be used.
    pub memory_limit_bytes: u64,
    /// What rendering will need.
    pub render: Need,
    /// What embedding will need: preset standard, the shipped CLIP, on the CPU.
    pub embed: Option<Need>,
    /// What can be expected of a mark, where that was asked.
    pub forecast: Option<Told>,
}

/// Where a scene is.
#[derive(Serialize)]
pub struct Where {
    /// Its middle, in world units.
    pub centre: [f32; 3],
    /// How far it reaches.
    pub radius: f32,
    /// Upwards.
    pub up: [f32; 3],
    /// Whether it stands on ground.
    pub on_ground: bool,
}

/// The kind of a scene.
#[derive(Serialize)]
pub struct Found {
    /// By its geometry.
    pub found: SceneKind,
    /// The one that views are made for; none where cameras were given.
    pub used: Option<SceneKind>,
    /// What the geometry says.
    #[serde(flatten)]
    pub openness: Openness,
}

/// Cameras that were given.
#[derive(Serialize)]
pub struct Viewers {
    /// Those to train at.
    pub training: usize,
    /// Those held out.
    pub held_out: usize,
    /// How near a training view comes to an opaque Gaussian; none where no Gaussian is.
    pub clearance: Option<f32>,
}

/// What a command will need of the memory.
#[derive(Serialize)]
pub struct Need {
    /// In all.
    pub bytes: u64,
    /// By what it is for.
    pub parts: MemoryRequirements,
    /// Whether there is as much.
    pub fits: bool,
}

impl Need {
    fn new(parts: MemoryRequirements, limits: &Limits) -> Self {
        Self {
            bytes: parts.total(),
            fits: limits.admit(&parts).is_ok(),
            parts,
        }
    }

    /// In words.
    pub fn line(&self) -> String {
        let fits = if self.fits { "fits" } else { "does not fit" };
        format!("{}: {fits}", self.parts)
    }
}

/// Looks at the scene of `path`.
///
/// # Errors
/// A scene or cameras that can't be read, or memory that the scene does not fit into.
pub fn inspect(path: &Path, asked: &Asked) -> Result<Inspection> {
    let limits = Limits::of_machine(asked.memory);
    let rest = MemoryRequirements::of_program();
    admission::admit_reading(path, &limits, rest)?;
    let head = admission::summary_of(path);
    let bad_rows = asked.bad_rows;
    let scene = Scene::read_level(path, asked.level, bad_rows, limits.left(&rest))?;
    let gaussians = &scene.gaussians;
    let cameras = &asked.cameras;
    let size = SceneSize::of(&scene);
    let render = rendering_requirements(size, picture_bytes(PICTURE, PICTURE));
    let (mut extent, mut embed, mut seen, mut viewers) = (None, None, None, None);
    let (mut kind, mut difficulty) = (None, None);
    // Of nothing there is nothing to be seen.
    if !gaussians.is_empty() {
        extent = Some(Extent::of(gaussians)?);
        let mut settings = Preset::Standard.settings();
        settings.kind = asked.kind;
        let settings = settings.for_scene(gaussians, cameras)?;
        let view = measure_view_on_cpu(gaussians, &settings, cameras)?;
        let clip = Clip::shipped(&open(DeviceChoice::Cpu)?.device, Parts::Image)?;
        let clip = 4 * clip.parameters() as u64;
        let models = ModelBytes {
            learning: clip,
            verifying: clip,
        };
        embed = Some(predict_memory(size, view, &settings, models, 1, true));
        let sampler = ViewSampler::seen_from(gaussians, 0, settings.viewpoints(cameras))?;
        let (found, openness) = SceneKind::of(gaussians)?;
        kind = Some(Found {
            found,
            used: cameras.is_empty().then(|| sampler.kind()),
            openness,
        });
        difficulty = Some(measure_difficulty(gaussians, &sampler)?);
        seen = (asked.views.map(|views| count_seen(gaussians, &sampler, views))).transpose()?;
        viewers = sampler.given().map(|given| Viewers {
            training: given.training_cameras(),
            held_out: given.held_out_cameras(),
            clearance: Some(given.clearance()).filter(|distance| distance.is_finite()),
        });
    }
    let forecast = match &asked.forecast {
        Some(wish) if !gaussians.is_empty() => Some(tell(&scene, wish, cameras, asked.kind, asked.memory)?),
        _ => None,
    };
    Ok(Inspection {
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
        views: asked.views,
        seen_gaussians: seen,
        memory_limit_bytes: limits.memory,
        render: Need::new(render, &limits),
        embed: embed.map(|parts| Need::new(parts, &limits)),
        forecast,
    })
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
