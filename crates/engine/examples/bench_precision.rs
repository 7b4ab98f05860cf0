//! What cheaper arithmetic costs, as a table:
//! `cargo run --release --example bench_precision -- SCENE KEY MESSAGE [PRESET]`.
//!
//! For every setting the scene is marked and the file verified as `embed` does it; pictures and gradients of the first
//! training views are compared with those of the preset, pictures where they have the same pixels.
use std::path::Path;
use std::time::Instant;

use guardsplat_engine::clip::{Clip, Parts};
use guardsplat_engine::device::{DeviceChoice, open};
use guardsplat_engine::embed::{Job, Preset, Settings, embed};
use guardsplat_engine::extract::Engine;
use guardsplat_engine::message::Key;
use guardsplat_engine::picture::Picture;
use guardsplat_engine::scene::{BadRows, Gaussians, Scene};
use guardsplat_engine::splat::{Geometry, Learnable, WeightCache, sh};
use guardsplat_engine::view::{Split, ViewSampler};

type Failure = Box<dyn std::error::Error>;

/// Views whose pictures and gradients are compared.
const VIEWS: u64 = 4;

/// How a setting's pictures and gradients differ from the preset's.
struct Difference {
    max: Option<f64>,
    mean: Option<f64>,
    cosine: f64,
    bias: f64,
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene_path, key_path, message, preset @ ..] = &arguments[..] else {
        return Err("usage: bench_precision SCENE KEY MESSAGE [PRESET]".into());
    };
    let preset: Preset = preset.first().map_or(Ok(Preset::Standard), |name| name.parse())?;
    let standard = preset.settings();
    let key = Key::read(Path::new(key_path))?;
    let message = key.message(message)?;
    let compute = open(DeviceChoice::Cpu)?;
    let clip = Clip::shipped(&compute.device, Parts::Image)?;
    let engine = Engine::new(compute, clip, &key, None)?;
    let scene = Scene::read(Path::new(scene_path))?.gaussians;
    let cases = [
        ("the preset: single precision, 160 px, drawn at up to 3 times", standard),
        (
            "weights in half precision",
            Settings {
                half_weights: true,
                ..standard
            },
        ),
        ("views of 112 px instead of 160", Settings { size: 112, ..standard }),
        (
            "views drawn at their size only",
            Settings {
                enlarged: 1.0,
                ..standard
            },
        ),
        (
            "128 training views",
            Settings {
                views: Some(128),
                ..standard
            },
        ),
    ];
    println!(
        "{scene_path}, {} Gaussians, preset {}, {} threads\n",
        scene.len(),
        preset.name(),
        rayon::current_num_threads()
    );
    println!("| setting | bits a picture | PSNR | s | peak so far | picture max | mean | gradient cosine | bias |");
    println!("|---|---|---|---|---|---|---|---|---|");
    let folder = tempfile::tempdir()?;
    for (name, settings) in cases {
        let start = Instant::now();
        let job = Job {
            input: Path::new(scene_path),
            output: &folder.path().join("marked"),
            message: &message,
            settings: &settings,
            cameras: &[],
            force: true,
            bad_rows: BadRows::Refuse,
        };
        let outcome = embed(&engine, &job, &mut |_| {})?;
        let seconds = start.elapsed().as_secs_f64();
        let d = differences(&engine, &scene, [&standard, &settings])?;
        let picture = match (d.max, d.mean) {
            (Some(max), Some(mean)) => format!("{max:.1e} | {mean:.1e}"),
            _ => "- | -".to_owned(),
        };
        let compared = format!("{picture} | 1 - {:.0e} | {:.0e}", 1.0 - d.cosine, d.bias);
        println!(
            "| {name} | {:.2} % | {:.2} dB | {seconds:.0} | {:.0} MB | {compared} |",
            100.0 * outcome.verification.comparison.bit_accuracy,
            outcome.verification.quality.psnr.psnr_db.unwrap_or(f64::INFINITY),
            guardsplat_engine::memory::peak().unwrap_or(0) as f64 / 1e6
        );
    }
    Ok(())
}

/// Views as the one and as the other setting draws them at their largest: their pictures, where these have the same pixels,
/// and the gradient to the coefficients that comes of the same waves over both.
fn differences(engine: &Engine, scene: &Gaussians, both: [&Settings; 2]) -> Result<Difference, Failure> {
    let sampler = ViewSampler::new(scene, both[0].seed)?;
    let learnable = Learnable::all(scene);
    let rasterizer = engine.rasterizer()?;
    let (mut max, mut sum, mut count) = (0.0f64, 0.0, 0);
    let mut gradients = [vec![0.0; learnable.len()], vec![0.0; learnable.len()]];
    let geometry = Geometry::new(scene);
    for index in 0..VIEWS {
        let mut pictures = Vec::new();
        for (settings, gradient) in both.into_iter().zip(&mut gradients) {
            let camera = sampler.camera(Split::Training, index, settings.size);
            let cache = if settings.half_weights {
                WeightCache::HalfWeights
            } else {
                WeightCache::Weights
            };
            let view = geometry.prepare_averaged(&camera, settings.enlarged, cache)?;
            let colours = sh::colours(&scene.sh, None, &view);
            let picture = rasterizer.render(&view, &colours, [1.0; 3])?;
            let waves = waves(picture.width);
            let of_colours = rasterizer.backward(&view, &waves.pixels)?;
            sh::backward(
                &learnable,
                sh::ColourGradient {
                    view: &view,
                    colours: &colours,
                    gradient: &of_colours,
                },
                gradient,
            );
            pictures.push(picture.pixels);
        }
        if pictures[0].len() == pictures[1].len() {
            for (a, b) in pictures[0].iter().zip(&pictures[1]) {
                let difference = f64::from((a - b).abs());
                max = max.max(difference);
                sum += difference;
                count += 1;
            }
        }
    }
    let [first, other] = &gradients;
    let product = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum::<f64>();
    let total = |a: &[f32]| a.iter().map(|v| f64::from(v.abs())).sum::<f64>();
    Ok(Difference {
        max: (count > 0).then_some(max),
        mean: (count > 0).then_some(sum / f64::from(count)),
        cosine: product(first, other) / (product(first, first) * product(other, other)).sqrt(),
        bias: (total(other) - total(first)) / total(first),
    })
}

/// Some waves across a picture of any size, as the gradient of a sum that does not grow with its pixels.
fn waves(side: u32) -> Picture {
    let side_f = side as f32;
    let pixels = (0..3 * side * side).map(|i| {
        let (x, y) = ((i / 3 % side) as f32 + 0.5, (i / 3 / side) as f32 + 0.5);
        ((40.0 * x + 25.0 * y) / side_f + (i % 3) as f32).sin() / side_f.powi(2)
    });
    Picture {
        width: side,
        height: side,
        pixels: pixels.collect(),
    }
}
