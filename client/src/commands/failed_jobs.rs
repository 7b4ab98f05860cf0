//! `jobs dead`, `jobs attempts` and `jobs requeue`: jobs that failed, looked at and tried again.
use clap::{Args, ValueEnum};
use guardsplat_proto::v1::failure::Reason;
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::{JobAttempt, ListJobAttemptsRequest, RequeueJobRequest};
use serde::Serialize;

use super::job_list::{line, print_list, read, tell};
use crate::context::Context;
use crate::error::Result;
use crate::output::{Exit, print_json, print_line, printable};
use crate::report::{AttemptReport, outcome_word, word};

/// Arguments of `jobs dead`.
#[derive(Args)]
pub struct FailedJobs {
    /// Only jobs that failed for this reason; may be given several times
    #[arg(long, value_enum)]
    reason: Vec<ReasonName>,
    /// Most jobs to list
    #[arg(long, default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..))]
    limit: u32,
}

/// Why jobs fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ReasonName {
    InvalidInput,
    TargetMissed,
    WorkerLost,
    Internal,
    AttemptsExhausted,
}

impl From<ReasonName> for Reason {
    fn from(name: ReasonName) -> Self {
        match name {
            ReasonName::InvalidInput => Self::InvalidInput,
            ReasonName::TargetMissed => Self::TargetMissed,
            ReasonName::WorkerLost => Self::WorkerLost,
            ReasonName::Internal => Self::Internal,
            ReasonName::AttemptsExhausted => Self::AttemptsExhausted,
        }
    }
}

#[derive(Serialize)]
struct Attempts {
    attempts: Vec<AttemptReport>,
}

/// Lists jobs that failed.
pub async fn list(context: &Context, arguments: &FailedJobs) -> Result<Exit> {
    let named = match arguments.reason.as_slice() {
        [] => ReasonName::value_variants(),
        some => some,
    };
    let reasons = named.iter().map(|&name| Reason::from(name).into()).collect();
    let (jobs, more) = read(context, Vec::new(), reasons, arguments.limit).await?;
    print_list(context, &jobs, more, |job| match &job.failure {
        Some(failure) => {
            let reason = word(failure.reason().as_str_name(), "REASON_");
            format!("{}\n    {} ({reason})", line(job), printable(&failure.message))
        }
        None => line(job),
    });
    Ok(Exit::Done)
}

/// Lists the attempts of a job.
pub async fn attempts(context: &Context, name: String) -> Result<Exit> {
    let request = ListJobAttemptsRequest { name };
    let sent = context.call("reading attempts", request, async |channel, request| {
        JobServiceClient::new(channel).list_job_attempts(request).await
    });
    let attempts = sent.await?.attempts;
    if context.json {
        print_json(&Attempts {
            attempts: attempts.iter().map(Into::into).collect(),
        });
        return Ok(Exit::Done);
    }
    for attempt in &attempts {
        print_line(&attempt_line(attempt));
    }
    if attempts.is_empty() {
        context.console.say("no attempts yet");
    }
    Ok(Exit::Done)
}

/// Queues a job that failed once more.
pub async fn requeue(context: &Context, name: String) -> Result<Exit> {
    let request = RequeueJobRequest { name };
    let sent = context.once("queueing the job once more", request, async |channel, request| {
        JobServiceClient::new(channel).requeue_job(request).await
    });
    tell(context, &sent.await?);
    Ok(Exit::Done)
}

/// An attempt for people.
fn attempt_line(attempt: &JobAttempt) -> String {
    let time = |time: Option<prost_types::Timestamp>| time.map(|time| time.to_string()).unwrap_or_default();
    let mut line = format!(
        "{:3}  {:9}  {}  {}  {}",
        attempt.number,
        outcome_word(attempt),
        time(attempt.start_time),
        time(attempt.end_time),
        printable(&attempt.worker)
    );
    if let Some(failure) = &attempt.failure {
        let reason = word(failure.reason().as_str_name(), "REASON_");
        line += &format!("\n     {} ({reason})", printable(&failure.message));
    }
    line
}
