//! `jobs list`, `jobs get`, `jobs watch` and `jobs cancel`; those for jobs that failed are in `failed_jobs`.
use clap::{Args, Subcommand, ValueEnum};
use guardsplat_proto::v1::job::{Result as Outcome, State};
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::{CancelJobRequest, GetJobRequest, Job};
use serde::Serialize;

use super::failed_jobs;
use super::job_list::{line, print_list, read, tell};
use crate::context::Context;
use crate::error::{Error, Result};
use crate::job::create::{missed_target, no_result, succeeded};
use crate::job::progress::ProgressView;
use crate::job::watch::watch;
use crate::output::{Exit, print_json_line, print_line, printable, say};
use crate::report::{EmbedReport, JobReport, KeyResultReport, VerifyReport};
use crate::resource_names;
use crate::stage::Stage;

/// The commands on jobs.
#[derive(Subcommand)]
pub enum Command {
    /// Jobs, newest first
    List(List),
    /// One job as it stands
    Get {
        /// jobs/ID, or the id alone
        job: String,
    },
    /// Follows a job until it is over; exits as the command that created it would have
    Watch {
        /// jobs/ID, or the id alone
        job: String,
        /// The last cursor seen, to hear only of what changed since
        #[arg(long)]
        cursor: Option<String>,
    },
    /// Ends a job: at once while it is queued, soon while it is running
    Cancel {
        /// jobs/ID, or the id alone
        job: String,
    },
    /// Jobs that failed, newest first, with what went wrong
    Dead(failed_jobs::FailedJobs),
    /// The attempts of a job, newest first: when, by which worker, and how each ended
    Attempts {
        /// jobs/ID, or the id alone
        job: String,
    },
    /// Queues a job that failed once more, its attempts counted anew; needs a token with the scope admin
    Requeue {
        /// jobs/ID, or the id alone
        job: String,
    },
}

/// Arguments of `jobs list`.
#[derive(Args)]
pub struct List {
    /// Only jobs in this state; may be given several times
    #[arg(long, value_enum)]
    state: Vec<StateName>,
    /// Most jobs to list
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..))]
    limit: u32,
}

/// States of jobs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum StateName {
    Queued,
    Running,
    Succeeded,
    Failed,
    Cancelled,
}

impl From<StateName> for State {
    fn from(name: StateName) -> Self {
        match name {
            StateName::Queued => Self::Queued,
            StateName::Running => Self::Running,
            StateName::Succeeded => Self::Succeeded,
            StateName::Failed => Self::Failed,
            StateName::Cancelled => Self::Cancelled,
        }
    }
}

#[derive(Serialize)]
struct Watched<'a> {
    cursor: &'a str,
    job: JobReport,
}

/// Carries out one of them.
pub async fn run(context: &Context, command: &Command) -> Result<Exit> {
    match command {
        Command::List(arguments) => list(context, arguments).await,
        Command::Get { job } => {
            let request = GetJobRequest {
                name: resource_names::job(job)?,
            };
            let sent = context.call("reading the job", request, async |channel, request| {
                JobServiceClient::new(channel).get_job(request).await
            });
            tell(context, &sent.await?);
            Ok(Exit::Done)
        }
        Command::Watch { job, cursor } => follow(context, resource_names::job(job)?, cursor.clone()).await,
        Command::Cancel { job } => {
            let request = CancelJobRequest {
                name: resource_names::job(job)?,
            };
            let sent = context.once("cancelling the job", request, async |channel, request| {
                JobServiceClient::new(channel).cancel_job(request).await
            });
            tell(context, &sent.await?);
            Ok(Exit::Done)
        }
        Command::Dead(arguments) => failed_jobs::list(context, arguments).await,
        Command::Attempts { job } => failed_jobs::attempts(context, resource_names::job(job)?).await,
        Command::Requeue { job } => failed_jobs::requeue(context, resource_names::job(job)?).await,
    }
}

async fn list(context: &Context, arguments: &List) -> Result<Exit> {
    let states: Vec<i32> = arguments.state.iter().map(|&name| State::from(name).into()).collect();
    let (jobs, more) = read(context, states, Vec::new(), arguments.limit).await?;
    print_list(context, &jobs, more, line);
    Ok(Exit::Done)
}

async fn follow(context: &Context, name: String, cursor: Option<String>) -> Result<Exit> {
    context.enter(Stage::Waiting {
        job: name.clone(),
        cancel: false,
    });
    let mut show = ProgressView::default();
    let over = watch(context, &name, cursor.unwrap_or_default(), |job, cursor| {
        show.job(&context.console, job);
        if context.json {
            print_json_line(&Watched {
                cursor,
                job: job.into(),
            });
        }
    });
    let job = over.await?;
    context.enter(Stage::Nothing);
    context.console.clear();
    outcome(context, job)
}

/// Tells what came of a job that is over, and exits as the command that created it would have.
fn outcome(context: &Context, job: Job) -> Result<Exit> {
    if let Some(missed) = missed_target(&job) {
        say(&format!("target missed: {}", printable(missed)));
        return Ok(Exit::Inconclusive);
    }
    let job = match succeeded(job) {
        // The last line of the JSON says so already, and one document a message was promised.
        Err(error @ (Error::JobFailed { .. } | Error::JobCancelled { .. })) if context.json => {
            return Err(Error::AlreadyReported(Box::new(error)));
        }
        other => other?,
    };
    let (text, exit) = match &job.result {
        Some(Outcome::EmbedResult(result)) => {
            let report = EmbedReport::from(result);
            let exit = if report.missed().is_empty() {
                Exit::Done
            } else {
                Exit::Inconclusive
            };
            (format!("{}\n{}", report.line(), result.scene), exit)
        }
        Some(Outcome::VerifyResult(result)) => {
            let report = VerifyReport::from(result);
            (report.lines(), report.exit())
        }
        Some(Outcome::KeyResult(result)) => (KeyResultReport::from(result).line(), Exit::Done),
        None => return Err(no_result(&job)),
    };
    if !context.json {
        print_line(&text);
    }
    Ok(exit)
}
