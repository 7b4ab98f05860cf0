//! Jobs as the commands on them list and tell them.
use guardsplat_proto::v1::job::{Result as Outcome, State};
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::{Job, ListJobsRequest};
use serde::Serialize;

use crate::context::Context;
use crate::error::Result;
use crate::output::{print_json, print_line, printable};
use crate::pages;
use crate::report::{EmbedReport, JobReport, KeyResultReport, VerifyReport, kind, word};

#[derive(Serialize)]
struct Listed {
    jobs: Vec<JobReport>,
    /// Whether there are more than were asked for.
    more: bool,
}

/// Jobs in these states that failed for these reasons, where any are named: at most so many, and whether there are more.
///
/// # Errors
/// Those of the server.
pub async fn read(context: &Context, states: Vec<i32>, reasons: Vec<i32>, most: u32) -> Result<(Vec<Job>, bool)> {
    pages::up_to(most as usize, async |page_size, page_token| {
        let request = ListJobsRequest {
            page_size,
            page_token,
            states: states.clone(),
            reasons: reasons.clone(),
        };
        let sent = context.call("listing jobs", request, async |channel, request| {
            JobServiceClient::new(channel).list_jobs(request).await
        });
        let page = sent.await?;
        Ok((page.jobs, page.next_page_token))
    })
    .await
}

/// Prints jobs, for people each as `text` has it.
pub fn print_list(context: &Context, jobs: &[Job], more: bool, text: impl Fn(&Job) -> String) {
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

/// Tells of a job.
pub fn tell(context: &Context, job: &Job) {
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
pub fn line(job: &Job) -> String {
    let created = job.create_time.map(|time| time.to_string()).unwrap_or_default();
    format!(
        "{}  {:9}  {:10}  {created}  {}",
        job.name,
        word(job.state().as_str_name(), "STATE_"),
        kind(job).unwrap_or("unknown"),
        printable(&job.display_name)
    )
}
