//! `embed`.
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use guardsplat_proto::v1::job::{Result as Outcome, Spec};
use guardsplat_proto::v1::{EmbedSpec, Job, Key, embed_spec};
use guardsplat_scene::Format;
use serde::Serialize;

use super::key;
use crate::context::Context;
use crate::distortion::{self, Distortion};
use crate::error::{Error, Result};
use crate::file_kind::FileKind;
use crate::inputs;
use crate::job::create::{create_with, leave, missed_target, no_result, succeeded, wait};
use crate::options::Submission;
use crate::output::{Exit, print_json, print_line, printable, say};
use crate::report::{EmbedReport, FailureReport};
use crate::resource_names;
use crate::scene_kind::{self, SceneKind};
use crate::stage::Stage;
use crate::transfer::{Destination, download};

/// How much work is spent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Preset {
    /// A mark to try things with
    Draft,
    /// What is recommended
    Standard,
    /// For messages of 16 bits: a third more steps, and a mark that shows as much as it may
    Robust,
    /// Twice the work, for more bits that are right
    Thorough,
    /// Steps, views and sizes of the paper
    Paper,
}

impl From<Preset> for embed_spec::Preset {
    fn from(preset: Preset) -> Self {
        match preset {
            Preset::Draft => Self::Draft,
            Preset::Standard => Self::Standard,
            Preset::Robust => Self::Robust,
            Preset::Thorough => Self::Thorough,
            Preset::Paper => Self::Paper,
        }
    }
}

/// Arguments of `embed`.
#[derive(Args)]
pub struct Arguments {
    /// The scene to mark: PLY, compressed PLY, SPZ, SOG, glTF in one file, .ksplat or .splat; or one that is there already, artifacts/ID
    #[arg(value_name = "IN")]
    input: String,
    /// Where to write the marked scene, in the format of IN
    #[arg(short, long, value_name = "OUT", required_unless_present = "no_wait")]
    output: Option<PathBuf>,
    /// The key: keys/ID, its id, or its display name where no other key has the same
    #[arg(long, value_name = "KEY")]
    key: String,
    /// The asset that IN is the original of, assets/ID or its id: what is embedded is its codeword, and the job leaves
    /// signed evidence
    #[arg(
        long,
        value_name = "ASSET",
        required_unless_present = "message",
        conflicts_with = "message"
    )]
    asset: Option<String>,
    /// A raw message in hexadecimal, as many bits as the key has
    #[arg(long, value_name = "HEX")]
    message: Option<String>,
    /// How much work is spent
    #[arg(long, value_enum, default_value = "standard")]
    preset: Preset,
    /// What the mark is trained to stand, in place of what the preset has: names with commas, or all
    #[arg(
        long,
        value_name = "LIST",
        value_enum,
        value_delimiter = ',',
        hide_possible_values = true
    )]
    robust_to: Vec<Distortion>,
    /// Where the scene's viewers are: cameras.json (3DGS), transforms.json (NeRF), a glTF, or artifacts/ID
    #[arg(long, value_name = "FILE")]
    cameras: Option<String>,
    /// The kind of scene, which says where its viewers are; found from the scene unless given
    #[arg(long, value_enum, conflicts_with = "cameras")]
    kind: Option<SceneKind>,
    /// Decides views, backgrounds and augmentation
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    seed: u64,
    /// Side of training views and of those of the verification, in pixels
    #[arg(long, value_name = "PX", value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: Option<u32>,
    /// Writes the scene even when it misses its target; the exit code says 3 all the same
    #[arg(long)]
    force: bool,
    /// Leaves Gaussians with NaN and other impossible values alone instead of refusing the scene
    #[arg(long)]
    ignore_bad_rows: bool,
    /// Where to write a picture of original, marked and ten times their difference
    #[arg(long, value_name = "FILE")]
    comparison: Option<PathBuf>,
    /// Has content credentials (C2PA) made of the marked scene, and fetches them into this file, such as OUT.c2pa
    #[arg(long, value_name = "FILE")]
    credentials: Option<PathBuf>,
    #[command(flatten)]
    submission: Submission,
}

/// What stands beside the figures.
#[derive(Serialize)]
struct Report<'a> {
    job: &'a str,
    key: &'a str,
    bits: u32,
    preset: String,
    seed: u64,
    written: bool,
    output: Option<&'a Path>,
    credentials_file: Option<&'a Path>,
    #[serde(flatten)]
    result: Option<EmbedReport>,
    /// Of a job that failed; a result has its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    target_missed: Option<Vec<String>>,
    failure: Option<FailureReport>,
}

/// Marks a scene.
pub async fn run(context: &Context, arguments: &Arguments) -> Result<Exit> {
    // What can't be written, or is not there, is better known before the work.
    if !arguments.submission.no_wait {
        for path in [&arguments.output, &arguments.comparison, &arguments.credentials]
            .into_iter()
            .flatten()
        {
            Destination::check(path)?;
        }
    }
    let input = inputs::Input::scene(&arguments.input);
    if let inputs::Input::File(path) = &input {
        check_format(path, arguments.output.as_deref())?;
    }
    let key = key::find(context, &arguments.key).await?;
    let asset = arguments.asset.as_deref().map(resource_names::asset).transpose()?;
    let message = arguments.message.as_deref().map(|given| key::message(&key, given));
    let message = message.transpose()?;
    let cameras = arguments.cameras.as_deref().map(inputs::Input::scene);
    let inputs: Vec<_> = std::iter::once(input).chain(cameras).collect();
    let inputs = inputs::send(context, &inputs).await?;
    let spec = spec(
        arguments,
        &key,
        message.unwrap_or_default(),
        asset.unwrap_or_default(),
        &inputs,
    );
    let job = create_with(context, &arguments.submission, &inputs, spec).await?;
    if arguments.submission.no_wait {
        leave(context, &job);
        return Ok(Exit::Done);
    }
    let job = wait(context, &arguments.submission, &job).await?;
    match missed_target(&job) {
        Some(missed) => Ok(tell_missed(context, &job, &key, missed)),
        None => finish(context, arguments, succeeded(job)?, &key).await,
    }
}

/// Whether the file is a scene, and what comes of it may be called so.
fn check_format(input: &Path, output: Option<&Path>) -> Result<()> {
    let FileKind::Scene(format) = FileKind::of(input)? else {
        return Err(Error::io(input)(std::io::Error::other("a picture, and no scene")));
    };
    let suits = output.map_or(Ok(()), |output| format.check_name(output));
    suits.map_err(|reason| Error::BadOption {
        field: "--output",
        reason,
    })
}

fn spec(arguments: &Arguments, key: &Key, message: String, asset: String, inputs: &inputs::Inputs) -> Spec {
    let mut spec = EmbedSpec {
        // As many names came back as inputs were given.
        scene: inputs.names.first().cloned().unwrap_or_default(),
        cameras: inputs.names.get(1).cloned().unwrap_or_default(),
        key: key.name.clone(),
        message,
        asset,
        seed: arguments.seed,
        size: arguments.size.unwrap_or_default(),
        force: arguments.force,
        ignore_bad_rows: arguments.ignore_bad_rows,
        scene_kind: scene_kind::number(arguments.kind),
        credentials: arguments.credentials.is_some(),
        robust_to: distortion::named(&arguments.robust_to),
        ..EmbedSpec::default()
    };
    spec.set_preset(arguments.preset.into());
    Spec::Embed(spec)
}

async fn finish(context: &Context, arguments: &Arguments, job: Job, key: &Key) -> Result<Exit> {
    let Some(Outcome::EmbedResult(result)) = &job.result else {
        return Err(no_result(&job));
    };
    context.enter(Stage::Fetching { job: job.name.clone() });
    if let Some(path) = &arguments.comparison {
        download(context, &result.comparison, path).await?;
    }
    if let Some(path) = &arguments.credentials {
        let made = result.credentials.as_ref().ok_or_else(|| Error::Answer {
            reason: "it has no credentials: the server is older than they are".into(),
        })?;
        download(context, &made.artifact, path).await?;
    }
    let mut misnamed = None;
    // The scene comes last: where it is, all is.
    if let Some(path) = &arguments.output {
        let scene = download(context, &result.scene, path).await?;
        misnamed = Format::of_name(Path::new(&scene.display_name)).and_then(|format| format.check_name(path).err());
    }
    context.enter(Stage::Nothing);
    context.console.clear();
    // Of an artifact's format nothing is known before.
    if let Some(reason) = misnamed {
        say(&format!("note: {}", printable(&reason)));
    }
    let report = EmbedReport::from(result);
    let missed = report.missed().to_vec();
    if context.json {
        print_json(&Report {
            written: arguments.output.is_some(),
            output: arguments.output.as_deref(),
            credentials_file: arguments.credentials.as_deref(),
            result: Some(report),
            target_missed: None,
            ..facts(&job, key)
        });
    } else {
        print_line(&report.line());
        if let Some(path) = &arguments.output {
            print_line(&format!("written to {}", path.display()));
        }
        if let Some(path) = &arguments.credentials {
            print_line(&format!("credentials written to {}", path.display()));
        }
    }
    if missed.is_empty() {
        return Ok(Exit::Done);
    }
    say(&format!(
        "target missed: {}; written all the same",
        printable(&missed.join(", "))
    ));
    Ok(Exit::Inconclusive)
}

fn tell_missed(context: &Context, job: &Job, key: &Key, missed: &str) -> Exit {
    if context.json {
        print_json(&Report {
            target_missed: Some(vec![missed.to_owned()]),
            ..facts(job, key)
        });
    }
    say(&format!("target missed: {}; nothing was written", printable(missed)));
    Exit::Inconclusive
}

fn facts<'a>(job: &'a Job, key: &'a Key) -> Report<'a> {
    let (preset, seed) = match &job.spec {
        Some(Spec::Embed(spec)) => (crate::report::preset(spec), spec.seed),
        _ => Default::default(),
    };
    Report {
        job: &job.name,
        key: &key.name,
        bits: key.bits,
        preset,
        seed,
        written: false,
        output: None,
        credentials_file: None,
        result: None,
        target_missed: None,
        failure: job.failure.as_ref().map(Into::into),
    }
}
