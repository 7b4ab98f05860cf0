//! `artifact put`, `artifact get` and `artifact delete`.
use std::path::PathBuf;

use clap::Subcommand;
use guardsplat_proto::v1::DeleteArtifactRequest;
use guardsplat_proto::v1::artifact_service_client::ArtifactServiceClient;
use serde::Serialize;

use crate::context::Context;
use crate::error::Result;
use crate::output::{Exit, print_json, print_line};
use crate::report::ArtifactReport;
use crate::resource_names;
use crate::transfer::{Source, download, upload};

/// The commands on artifacts.
#[derive(Subcommand)]
pub enum Command {
    /// Sends a file, and prints the name that it has there
    Put {
        /// A scene or a picture
        file: PathBuf,
    },
    /// Fetches an artifact into a file
    Get {
        /// artifacts/ID, or the id alone
        artifact: String,
        /// The file to write; an older one is replaced when all of the new one is there
        #[arg(short, long, value_name = "FILE")]
        output: PathBuf,
    },
    /// Deletes an artifact that no waiting or running job needs
    Delete {
        /// artifacts/ID, or the id alone
        artifact: String,
    },
}

#[derive(Serialize)]
struct Fetched {
    #[serde(flatten)]
    artifact: ArtifactReport,
    output: PathBuf,
}

#[derive(Serialize)]
struct Deleted {
    name: String,
    deleted: bool,
}

/// Carries out one of them.
pub async fn run(context: &Context, command: &Command) -> Result<Exit> {
    match command {
        Command::Put { file } => {
            let source = Source::hash(file).await?;
            let artifact = upload(context, &source, 0, source.size).await?;
            context.console.clear();
            if context.json {
                print_json(&ArtifactReport::from(&artifact));
            } else {
                print_line(&artifact.name);
            }
        }
        Command::Get { artifact, output } => {
            let artifact = download(context, &resource_names::artifact(artifact)?, output).await?;
            context.console.clear();
            if context.json {
                print_json(&Fetched {
                    artifact: (&artifact).into(),
                    output: output.clone(),
                });
            } else {
                print_line(&format!("written to {}", output.display()));
            }
        }
        Command::Delete { artifact } => {
            let name = resource_names::artifact(artifact)?;
            let request = DeleteArtifactRequest { name: name.clone() };
            let sent = context.once("deleting the artifact", request, async |channel, request| {
                ArtifactServiceClient::new(channel).delete_artifact(request).await
            });
            sent.await?;
            if context.json {
                print_json(&Deleted { name, deleted: true });
            } else {
                print_line(&format!("{name} is deleted"));
            }
        }
    }
    Ok(Exit::Done)
}
