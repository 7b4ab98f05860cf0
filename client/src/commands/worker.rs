//! `worker list`.
use clap::Subcommand;
use guardsplat_proto::v1::ListWorkersRequest;
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use serde::Serialize;

use crate::context::Context;
use crate::error::Result;
use crate::output::{Exit, print_json, print_line};
use crate::report::WorkerReport;

/// The commands on workers; a token with the scope admin is needed for them.
#[derive(Subcommand)]
pub enum Command {
    /// Workers that asked for a job within the last hour, or have one now: what they are, when they were last heard of, and
    /// which job they have
    List,
}

#[derive(Serialize)]
struct Listed {
    workers: Vec<WorkerReport>,
}

/// Carries out one of them.
pub async fn run(context: &Context, command: &Command) -> Result<Exit> {
    match command {
        Command::List => list(context).await,
    }
}

async fn list(context: &Context) -> Result<Exit> {
    let sent = context.call("listing workers", ListWorkersRequest {}, async |channel, request| {
        JobServiceClient::new(channel).list_workers(request).await
    });
    let workers: Vec<_> = sent.await?.workers.iter().map(WorkerReport::from).collect();
    if context.json {
        print_json(&Listed { workers });
        return Ok(Exit::Done);
    }
    for worker in &workers {
        print_line(&worker.line());
    }
    if workers.is_empty() {
        context.console.say("no worker asked for a job within the last hour");
    }
    Ok(Exit::Done)
}
