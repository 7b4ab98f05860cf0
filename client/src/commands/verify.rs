//! `verify`.
use clap::Args;
use guardsplat_proto::v1::VerifySpec;
use guardsplat_proto::v1::job::{Result as Outcome, Spec};
use serde::Serialize;

use super::{key, suspects};
use crate::arguments::Submission;
use crate::context::Context;
use crate::create::{create, leave, no_result, succeeded, wait};
use crate::error::Result;
use crate::output::{Exit, print_json, print_line};
use crate::report::VerifyReport;
use crate::transfer::discard;

/// Arguments of `verify`.
#[derive(Args)]
pub struct Arguments {
    /// A scene (PLY), or pictures (PNG, JPEG, WebP) and folders of them; or such that are there already, artifacts/ID
    #[arg(value_name = "PATH", required = true)]
    paths: Vec<String>,
    /// The key: keys/ID, its id, or its display name where no other key has the same
    #[arg(long, value_name = "KEY")]
    key: String,
    /// The message to compare with, in hexadecimal; without it nothing is decided
    #[arg(long, value_name = "HEX")]
    message: Option<String>,
    /// Views that a scene is read from; 20 unless given
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    views: Option<u32>,
    /// Side of these views in pixels; CLIP's input unless given
    #[arg(long, value_name = "PX", value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: Option<u32>,
    /// Decides the views of a scene
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    submission: Submission,
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
    let found = suspects::find(&arguments.paths)?;
    let key = key::find(context, &arguments.key).await?;
    if let Some(message) = &arguments.message {
        key::check_message(&key, message)?;
    }
    let inputs = suspects::send(context, &found).await?;
    let spec = Spec::Verify(VerifySpec {
        suspects: inputs.names.clone(),
        key: key.name.clone(),
        message: arguments.message.as_deref().unwrap_or_default().to_ascii_lowercase(),
        views: arguments.views.unwrap_or_default(),
        size: arguments.size.unwrap_or_default(),
        seed: arguments.seed,
    });
    let job = match create(context, &arguments.submission, &inputs.title, spec).await {
        Ok(job) => job,
        Err(error) => {
            discard(context, &inputs.sent).await;
            return Err(error);
        }
    };
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
