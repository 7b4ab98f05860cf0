//! `verify`.
use std::path::{Path, PathBuf};

use clap::Args;
use guardsplat_proto::v1::job::{Result as Outcome, Spec};
use guardsplat_proto::v1::verify_result::Verdict;
use guardsplat_proto::v1::{Job, VerifyResult, VerifySpec};
use serde::Serialize;

use super::{key, owner};
use crate::context::Context;
use crate::error::Result;
use crate::inputs;
use crate::job::create::{create_with, leave, no_result, succeeded, wait};
use crate::options::Submission;
use crate::output::{Exit, print_json, print_line, say};
use crate::report::VerifyReport;
use crate::resource_names;
use crate::scene_kind::{self, SceneKind};
use crate::stage::Stage;
use crate::transfer::{Destination, download};

/// Arguments of `verify`.
#[derive(Args)]
pub struct Arguments {
    /// Scenes (PLY, compressed PLY, SPZ, SOG, glTF, .ksplat, .splat), pictures (PNG, JPEG, WebP) and folders of them; or such that
    /// are there already, artifacts/ID
    #[arg(value_name = "PATH", required = true)]
    paths: Vec<String>,
    /// The key: keys/ID, its id, or its display name where no other key has the same
    #[arg(long, value_name = "KEY")]
    key: String,
    #[command(flatten)]
    claim: Claim,
    /// Views that a scene is read from; 20 unless given
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    views: Option<u32>,
    /// Side of these views in pixels; CLIP's input unless given
    #[arg(long, value_name = "PX", value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: Option<u32>,
    /// Where a scene's viewers are, a file as `embed` was given, or artifacts/ID
    #[arg(long, value_name = "FILE")]
    cameras: Option<String>,
    /// The unmarked scene, or artifacts/ID: pictures are compared with it besides, so that neither what is behind the scene
    /// nor a filter matters
    #[arg(long, value_name = "SCENE")]
    original: Option<String>,
    /// The kind of scene, which says where its viewers are; found from the scene unless given
    #[arg(long, value_enum, conflicts_with = "cameras")]
    kind: Option<SceneKind>,
    /// Decides the views of a scene
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    seed: u64,
    /// Leaves out Gaussians of a scene with NaN and other impossible values instead of refusing it
    #[arg(long)]
    ignore_bad_rows: bool,
    /// Where to write the content credentials (C2PA) of the scene whose mark is found; of several the newest
    #[arg(long, value_name = "FILE")]
    credentials: Option<PathBuf>,
    #[command(flatten)]
    submission: Submission,
}

/// What is claimed; without any of these nothing is decided.
#[derive(Args)]
#[group(multiple = false)]
struct Claim {
    /// The claim that this asset's mark is there: assets/ID, or the id alone
    #[arg(long, value_name = "ASSET")]
    asset: Option<String>,
    /// The claim that the mark of one of this owner's assets is there: owners/ID, its id, or its display name
    #[arg(long, value_name = "OWNER")]
    owner: Option<String>,
    /// Searches all assets of the key for the one whose mark is there
    #[arg(long)]
    search: bool,
    /// A raw message to compare with, in hexadecimal
    #[arg(long, value_name = "HEX")]
    message: Option<String>,
}

#[derive(Serialize)]
struct Report<'a> {
    job: &'a str,
    key: &'a str,
    credentials_file: Option<&'a Path>,
    #[serde(flatten)]
    result: &'a VerifyReport,
}

/// Reads a suspect.
pub async fn run(context: &Context, arguments: &Arguments) -> Result<Exit> {
    // What can't be written is better known before the work.
    if let Some(path) = arguments.credentials.as_ref().filter(|_| !arguments.submission.no_wait) {
        Destination::check(path)?;
    }
    let found = inputs::find(&arguments.paths)?;
    let key = key::find(context, &arguments.key).await?;
    let claim = &arguments.claim;
    let message = claim.message.as_deref().map(|given| key::message(&key, given));
    let message = message.transpose()?;
    let asset = claim.asset.as_deref().map(resource_names::asset).transpose()?;
    let owner = match &claim.owner {
        Some(given) => owner::find(context, given).await?.name,
        None => String::new(),
    };
    let count = found.len();
    let others = [&arguments.cameras, &arguments.original];
    let sent = others
        .iter()
        .filter_map(|other| other.as_deref())
        .map(inputs::Input::scene);
    let inputs = inputs::send(context, &found.into_iter().chain(sent).collect::<Vec<_>>()).await?;
    let mut suspects = inputs.names.clone();
    let mut sent = suspects.split_off(count).into_iter();
    let [cameras, original] = others.map(|other| other.as_ref().and_then(|_| sent.next()).unwrap_or_default());
    let spec = Spec::Verify(VerifySpec {
        suspects,
        cameras,
        original,
        key: key.name.clone(),
        message: message.unwrap_or_default(),
        asset: asset.unwrap_or_default(),
        owner,
        search: claim.search,
        views: arguments.views.unwrap_or_default(),
        size: arguments.size.unwrap_or_default(),
        seed: arguments.seed,
        ignore_bad_rows: arguments.ignore_bad_rows,
        scene_kind: scene_kind::number(arguments.kind),
    });
    let job = create_with(context, &arguments.submission, &inputs, spec).await?;
    if arguments.submission.no_wait {
        leave(context, &job);
        return Ok(Exit::Done);
    }
    let job = succeeded(wait(context, &arguments.submission, &job).await?)?;
    let Some(Outcome::VerifyResult(result)) = &job.result else {
        return Err(no_result(&job));
    };
    let fetched = fetch_credentials(context, &job, result, arguments.credentials.as_deref()).await?;
    let report = VerifyReport::from(result);
    if context.json {
        print_json(&Report {
            job: &job.name,
            key: &key.name,
            credentials_file: fetched,
            result: &report,
        });
    } else {
        print_line(&report.lines());
        if let Some(path) = fetched {
            print_line(&format!("credentials written to {}", path.display()));
        }
    }
    if arguments.credentials.is_some() && fetched.is_none() {
        say(match result.verdict() {
            Verdict::Match => "no credentials: the mark that was found was made without any, or they were deleted",
            _ => "no credentials: no mark was found that could have any",
        });
    }
    Ok(report.exit())
}

/// Fetches the newest credentials of the mark that was found, if there are any and they are wanted; where they are then.
async fn fetch_credentials<'a>(
    context: &Context,
    job: &Job,
    result: &VerifyResult,
    path: Option<&'a Path>,
) -> Result<Option<&'a Path>> {
    let Some((path, newest)) = path.zip(result.credentials.first()) else {
        return Ok(None);
    };
    context.enter(Stage::Fetching { job: job.name.clone() });
    download(context, &newest.artifact, path).await?;
    context.enter(Stage::Nothing);
    context.console.clear();
    Ok(Some(path))
}
