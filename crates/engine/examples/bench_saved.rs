//! What it saves to model only what a scene requires, as a table:
//! `cargo run --release --example bench_saved -- SCENE...`.
//!
//! "All" is every Gaussian, with every band that the file has room for; "required" those that training views show, with
//! the bands that are in use and that the file can change. Memory is of the coefficients in use and of what is learned
//! (changes, gradient, two moments); time of what a step of 8 views does with them: colours, their gradient, Adam.
use std::path::Path;
use std::time::Instant;

use guardsplat_engine::clip::{Clip, Parts};
use guardsplat_engine::device::{DeviceChoice, open};
use guardsplat_engine::embed::{Adam, AdamOptions, Penalty, Preset};
use guardsplat_engine::scene::{Gaussians, HEAD, Scene, Sh, summary};
use guardsplat_engine::splat::{Changes, Learnable, PreparedView, WeightCache, prepare, sh};
use guardsplat_engine::view::{Split, ViewSampler};

type Failure = Box<dyn std::error::Error>;

/// Of so many rounds the fastest counts.
const ROUNDS: usize = 5;
/// As an embedding has it: enough views were looked at when a step's show no more than this share of new Gaussians.
const NEWLY_SEEN: f64 = 1e-3;

/// Bytes and milliseconds.
struct Cost {
    bytes: usize,
    ms: f64,
}

fn main() -> Result<(), Failure> {
    models()?;
    println!(
        "| scene | Gaussians | not seen | views that show it | degree: room, in use, learned | all | required | less memory | \
         less time |\n|{}",
        "---|".repeat(9)
    );
    for path in std::env::args().skip(1) {
        println!("{}", row(Path::new(&path))?);
    }
    Ok(())
}

/// What of the models is not loaded to embed.
fn models() -> Result<(), Failure> {
    let compute = open(DeviceChoice::Cpu)?;
    for (name, parts) in [("image tower", Parts::Image), ("both towers", Parts::Both)] {
        let start = Instant::now();
        let clip = Clip::shipped(&compute.device, parts)?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        println!("{name}: {:.1} MB in {ms:.0} ms", 4.0 * clip.parameters() as f64 / 1e6);
    }
    println!();
    Ok(())
}

fn row(path: &Path) -> Result<String, Failure> {
    let bytes = std::fs::read(path)?;
    let head = &bytes[..bytes.len().min(HEAD)];
    let scene = Scene::parse(path, &bytes)?;
    let gaussians = &scene.gaussians;
    let room = summary(path, head, bytes.len() as u64)?.map_or(gaussians.sh.degree, |said| said.degree as usize);
    let (views, seen, looked_at) = covering(gaussians)?;
    let padded = padded(&gaussians.sh, room);
    let all = cost(&padded, &Learnable::new(&vec![true; gaussians.len()], room), &views);
    let learned = scene.learnable_degree();
    let required = cost(&gaussians.sh, &Learnable::new(&seen, learned), &views);
    let unseen = seen.iter().filter(|seen| !**seen).count();
    let told = |cost: &Cost| format!("{:.1} MB, {:.1} ms", cost.bytes as f64 / 1e6, cost.ms);
    let less = |all: f64, required: f64| format!("{:.0} %", 100.0 * (1.0 - required / all));
    Ok(format!(
        "| `{}` | {} | {unseen} ({:.1} %) | {looked_at} | {room}, {}, {learned} | {} | {} | {} | {} |",
        path.file_name().unwrap_or_default().to_string_lossy(),
        gaussians.len(),
        100.0 * unseen as f64 / gaussians.len() as f64,
        gaussians.sh.degree,
        told(&all),
        told(&required),
        less(all.bytes as f64, required.bytes as f64),
        less(all.ms, required.ms),
    ))
}

/// The first step's views, which Gaussians training views show, and how many views it took to know.
fn covering(gaussians: &Gaussians) -> Result<(Vec<PreparedView>, Vec<bool>, u64), Failure> {
    let settings = Preset::Standard.settings();
    let sampler = ViewSampler::new(gaussians, settings.seed)?;
    let step = settings.views_per_step as u64;
    let (mut first, mut seen, mut count, mut looked_at) = (Vec::new(), vec![false; gaussians.len()], 0, 0);
    loop {
        let mut new = 0;
        for index in looked_at..looked_at + step {
            let camera = sampler.camera(Split::Training, index, settings.size).enlarged(2);
            let view = prepare(gaussians, &camera, WeightCache::Weights)?;
            for row in &view.visible {
                new += usize::from(!std::mem::replace(&mut seen[*row as usize], true));
            }
            if index < step {
                first.push(view);
            }
        }
        looked_at += step;
        count += new;
        if new as f64 <= NEWLY_SEEN * count as f64 {
            return Ok((first, seen, looked_at));
        }
    }
}

/// The coefficients with bands of zeros up to `degree`, as files have them.
fn padded(sh: &Sh, degree: usize) -> Sh {
    let mut all = Sh {
        degree: degree.max(sh.degree),
        ..Sh::default()
    };
    let stride = all.per_gaussian();
    for row in sh.coefficients.chunks_exact(sh.per_gaussian()) {
        all.coefficients.extend_from_slice(row);
        all.coefficients.extend(std::iter::repeat_n(0.0, stride - row.len()));
    }
    all
}

fn cost(sh: &Sh, learnable: &Learnable, views: &[PreparedView]) -> Cost {
    let options = AdamOptions::tuned();
    let gaussians = sh.coefficients.len() / sh.per_gaussian();
    let mut adam = Adam::new(options, learnable.rows().len(), learnable.columns(), gaussians);
    let penalty = Penalty { dc: 0.0, rest: 0.0 };
    let mut offsets = vec![0.0; learnable.len()];
    let mut gradient = vec![0.0; learnable.len()];
    let mut ms = f64::INFINITY;
    for _ in 0..ROUNDS {
        let start = Instant::now();
        for view in views {
            let changes = Changes {
                learnable,
                values: &offsets,
            };
            let colours = sh::colours(sh, Some(changes), view);
            let of_colours = vec![1e-3; colours.len()];
            sh::backward(
                learnable,
                sh::ColourGradient {
                    view,
                    colours: &colours,
                    gradient: &of_colours,
                },
                &mut gradient,
            );
        }
        adam.step(1.0, penalty, &mut offsets, &mut gradient);
        ms = ms.min(start.elapsed().as_secs_f64() * 1e3);
    }
    Cost {
        bytes: 4 * (sh.coefficients.len() + 4 * learnable.len()),
        ms,
    }
}
