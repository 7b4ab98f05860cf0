//! `bench`.
mod cases;
mod spread;

use std::path::PathBuf;

use clap::Args;
use guardsplat_engine::Result;
use guardsplat_engine::device::DeviceChoice;
use guardsplat_engine::embed::Preset;
use serde::Serialize;

use self::cases::{Case, Given};
use super::{Budget, Exit, print_json, print_line};
use crate::machine::Machine;

#[derive(Args)]
pub struct Arguments {
    /// Sizes of the sample scenes, in Gaussians, with commas
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "10000,100000",
        value_parser = clap::value_parser!(u32).range(1..=20_000_000))]
    gaussians: Vec<u32>,
    /// Presets that they are marked with, with commas
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "draft,standard")]
    presets: Vec<Preset>,
    /// How often everything is done
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    repetitions: u32,
    /// Where to compute: auto, wgpu or cpu
    #[arg(long, default_value = "auto")]
    device: DeviceChoice,
    #[command(flatten)]
    budget: Budget,
    /// A key file; one of 32 bits is made unless given
    #[arg(long)]
    key: Option<PathBuf>,
    /// A JSON file with settings in place of the presets', for experiments
    #[arg(long, value_name = "FILE", hide_short_help = true)]
    settings: Option<PathBuf>,
    /// Prints JSON on standard output
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report<'a> {
    version: &'static str,
    #[serde(flatten)]
    machine: &'a Machine,
    device: &'a str,
    clip: &'a str,
    repetitions: u32,
    scenes: Vec<Case>,
}

pub fn run(arguments: &Arguments) -> Result<Exit> {
    // First of all: what is computed would be seen as the machine's load.
    let machine = Machine::here();
    let given = Given::new(arguments)?;
    let mut scenes = Vec::new();
    for gaussians in &arguments.gaussians {
        scenes.push(Case::measure(&given, &machine, *gaussians as usize)?);
    }
    let report = Report {
        version: env!("CARGO_PKG_VERSION"),
        machine: &machine,
        device: &given.engine.compute.name,
        clip: &given.clip,
        repetitions: arguments.repetitions,
        scenes,
    };
    if arguments.json {
        print_json(&report)?;
    } else {
        tell(&report);
    }
    Ok(Exit::Done)
}

fn tell(report: &Report<'_>) {
    print_line(&format!(
        "guardsplat-worker {}, {}, device {}, CLIP {}, medians of {} repetitions and 10th to 90th percentiles",
        report.version, report.machine, report.device, report.clip, report.repetitions
    ));
    for case in &report.scenes {
        print_line(&format!("{} Gaussians", case.gaussians));
        for job in &case.jobs {
            let processor = job
                .processor_seconds
                .map_or(String::new(), |of| format!(", {of} of processors"));
            let tried = job
                .framings
                .map_or(String::new(), |count| format!(", {count} framings"));
            print_line(&format!("  {}: {} s{processor}{tried}", job.name, job.seconds));
        }
        for step in &case.steps {
            print_line(&format!("  a step of {}: {} ms, of which", step.preset, step.whole));
            for (stage, ms) in &step.stages {
                print_line(&format!("    {stage}: {ms}"));
            }
        }
    }
}
