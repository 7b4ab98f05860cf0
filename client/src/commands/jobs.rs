//! `jobs list`, `jobs get`, `jobs watch` and `jobs cancel`; those for jobs that failed are in `dead`.
use clap::{Args, Subcommand, ValueEnum};
use guardsplat_proto::v1::job::{Result as Outcome, State};
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::{CancelJobRequest, GetJobRequest, Job, ListJobsRequest};
use serde::Serialize;

use super::failed_jobs;
use crate::context::Context;
use crate::error::{Error, Result};
use crate::interrupt::Stage;
use crate::job::create::{missed_target, no_result, succeeded};
use crate::job::progress::ProgressView;
use crate::job::watch::watch;
use crate::output::{Exit, print_json, print_json_line, print_line, printable, say};
use crate::report::{EmbedReport, JobReport, KeyResultReport, VerifyReport, kind, word};
use crate::resource_names;

/// Jobs asked for at a time.
const PAGE: u32 = 1000;

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
struct Listed {
    jobs: Vec<JobReport>,
    /// Whether there are more than were asked for.
    more: bool,
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
    let (jobs, more) = pages(context, states, Vec::new(), arguments.limit).await?;
    print_list(context, &jobs, more, line);
    Ok(Exit::Done)
}

/// Jobs of all pages, at most so many, and whether there are more.
pub(super) async fn pages(
    context: &Context,
    states: Vec<i32>,
    reasons: Vec<i32>,
    most: u32,
) -> Result<(Vec<Job>, bool)> {
    let limit = most as usize;
    let mut jobs = Vec::new();
    let mut page_token = String::new();
    let more = loop {
        let request = ListJobsRequest {
            // Every page of a list is asked for in the same way.
            page_size: i32::try_from(most.min(PAGE)).unwrap_or(i32::MAX),
            page_token,
            states: states.clone(),
            reasons: reasons.clone(),
        };
        let sent = context.call("listing jobs", request, async |channel, request| {
            JobServiceClient::new(channel).list_jobs(request).await
        });
        let page = sent.await?;
        jobs.extend(page.jobs);
        page_token = page.next_page_token;
        if page_token.is_empty() || jobs.len() >= limit {
            break jobs.len() > limit || !page_token.is_empty();
        }
    };
    jobs.truncate(limit);
    Ok((jobs, more))
}

/// Tells of jobs.
pub(super) fn print_list(context: &Context, jobs: &[Job], more: bool, text: impl Fn(&Job) -> String) {
    if context.json {
        print_json(&Listed {
            jobs: jobs.iter().map(Into::into).collect(),
            more,
        });
        return;
    }
    for job in jobs {
        print_line(&text(job));
    }
    if jobs.is_empty() {
        context.console.say("no jobs");
    } else if more {
        context.console.say("there are more; --limit shows them");
    }
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
            return Err(Error::Told(Box::new(error)));
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

/// Tells of a job.
pub(super) fn tell(context: &Context, job: &Job) {
    if context.json {
        print_json(&JobReport::from(job));
        return;
    }
    print_line(&line(job));
    if let Some(priority) = job.priority {
        print_line(&format!("priority: {priority}"));
    }
    if let Some(position) = job.queue_position {
        print_line(&format!("jobs before it: {position}"));
    }
    if !job.waiting_reason.is_empty() {
        print_line(&format!("it waits: {}", printable(&job.waiting_reason)));
    }
    if job.cancel_requested && job.state() == State::Running {
        print_line("its end was asked for");
    }
    if let Some(failure) = &job.failure {
        let reason = word(failure.reason().as_str_name(), "REASON_");
        print_line(&format!("failure: {} ({reason})", printable(&failure.message)));
    }
    match &job.result {
        Some(Outcome::EmbedResult(result)) => {
            print_line(&EmbedReport::from(result).line());
            print_line(&format!("scene:      {}", result.scene));
            print_line(&format!("comparison: {}", result.comparison));
        }
        Some(Outcome::VerifyResult(result)) => print_line(&VerifyReport::from(result).lines()),
        Some(Outcome::KeyResult(result)) => print_line(&KeyResultReport::from(result).line()),
        None => {}
    }
}

/// A job on one line.
pub(super) fn line(job: &Job) -> String {
    let created = job.create_time.map(|time| time.to_string()).unwrap_or_default();
    format!(
        "{}  {:9}  {:10}  {created}  {}",
        job.name,
        word(job.state().as_str_name(), "STATE_"),
        kind(job).unwrap_or("unknown"),
        printable(&job.display_name)
    )
}
