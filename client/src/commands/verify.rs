//! `verify`.
use clap::Args;
use guardsplat_proto::v1::VerifySpec;
use guardsplat_proto::v1::job::{Result as Outcome, Spec};
use serde::Serialize;

use super::{key, owner};
use crate::context::Context;
use crate::error::Result;
use crate::inputs;
use crate::job::create::{create_with, leave, no_result, succeeded, wait};
use crate::options::Submission;
use crate::output::{Exit, print_json, print_line};
use crate::report::VerifyReport;
use crate::resource_names;
use crate::scene_kind::{self, SceneKind};

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
    /// The kind of scene, which says where its viewers are; found from the scene unless given
    #[arg(long, value_enum, conflicts_with = "cameras")]
    kind: Option<SceneKind>,
    /// Decides the views of a scene
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    seed: u64,
    /// Leaves out Gaussians of a scene with NaN and other impossible values instead of refusing it
    #[arg(long)]
    ignore_bad_rows: bool,
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
    #[serde(flatten)]
    result: &'a VerifyReport,
}

/// Reads a suspect.
pub async fn run(context: &Context, arguments: &Arguments) -> Result<Exit> {
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
    let cameras = arguments.cameras.as_deref().map(inputs::Input::scene);
    let inputs: Vec<_> = found.into_iter().chain(cameras).collect();
    let inputs = inputs::send(context, &inputs).await?;
    let mut suspects = inputs.names.clone();
    let cameras = arguments.cameras.as_ref().and_then(|_| suspects.pop());
    let spec = Spec::Verify(VerifySpec {
        suspects,
        cameras: cameras.unwrap_or_default(),
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
    let report = VerifyReport::from(result);
    if context.json {
        print_json(&Report {
            job: &job.name,
            key: &key.name,
            result: &report,
        });
    } else {
        print_line(&report.lines());
    }
    Ok(report.exit())
}
