//! Creates jobs, and waits for them where that is wanted.
use guardsplat_proto::v1::job::{Spec, State};
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::{CreateJobRequest, Job, failure::Reason};
use uuid::Uuid;

use crate::context::Context;
use crate::error::{Error, Result};
use crate::inputs::Inputs;
use crate::job::progress::ProgressView;
use crate::job::watch::watch;
use crate::options::{LONGEST_NAME, Submission};
use crate::output::{print_json, print_line};
use crate::report::{JobReport, word};
use crate::stage::Stage;
use crate::transfer::discard;

/// Queues a job; `name` is what it is called unless the user says otherwise.
pub async fn create(context: &Context, submission: &Submission, name: &str, spec: Spec) -> Result<Job> {
    let display_name = match &submission.display_name {
        Some(given) => given.clone(),
        None => name.chars().filter(|c| !c.is_control()).take(LONGEST_NAME).collect(),
    };
    let request = CreateJobRequest {
        job: Some(Job {
            display_name,
            spec: Some(spec),
            priority: submission.priority,
            ..Job::default()
        }),
        // The same for every try, so that a lost answer does not make two jobs.
        request_id: submission.request_id.unwrap_or_else(Uuid::new_v4).to_string(),
    };
    context.enter(Stage::Creating);
    let created = context.call("creating the job", request, async |channel, request| {
        JobServiceClient::new(channel).create_job(request).await
    });
    let created = created.await;
    context.enter(Stage::Nothing);
    created
}

/// As [`create`], with the files that were sent for it. Those that it does not need after all are deleted again: it was
/// refused, or the same request made it before, with what was sent then.
pub async fn create_with(context: &Context, submission: &Submission, inputs: &Inputs, spec: Spec) -> Result<Job> {
    let created = create(context, submission, &inputs.title, spec).await;
    let needed: &[String] = match created.as_ref().ok().and_then(|job| job.spec.as_ref()) {
        Some(Spec::Embed(spec)) => std::slice::from_ref(&spec.scene),
        Some(Spec::Verify(spec)) => &spec.suspects,
        Some(Spec::CreateKey(_)) | None => &[],
    };
    discard(context, inputs.sent.iter().filter(|name| !needed.contains(name))).await;
    created
}

/// Prints a job that is not waited for.
pub fn leave(context: &Context, job: &Job) {
    if context.json {
        print_json(&JobReport::from(job));
    } else {
        print_line(&job.name);
        context
            .console
            .say(&format!("to follow it: guardsplat jobs watch {}", job.name));
    }
}

/// Waits until a job is over, however it ends.
pub async fn wait(context: &Context, submission: &Submission, job: &Job) -> Result<Job> {
    context.enter(Stage::Waiting {
        job: job.name.clone(),
        cancel: submission.cancel_on_interrupt,
    });
    context.console.say(&match job.state() {
        State::Queued => format!("{} is queued", job.name),
        // Of a request that was sent before.
        State::Running => format!("{} is there already, and running", job.name),
        _ => format!("{} is there already, and over", job.name),
    });
    let mut show = ProgressView::default();
    let over = watch(context, &job.name, String::new(), |job, _| {
        show.job(&context.console, job)
    })
    .await?;
    context.console.clear();
    context.enter(Stage::Nothing);
    Ok(over)
}

/// The job if it succeeded, else why not.
pub fn succeeded(job: Job) -> Result<Job> {
    match job.state() {
        State::Succeeded => Ok(job),
        State::Cancelled => Err(Error::JobCancelled { job: job.name }),
        _ => {
            let failure = job.failure.unwrap_or_default();
            Err(Error::JobFailed {
                job: job.name,
                reason: word(failure.reason().as_str_name(), "REASON_"),
                message: failure.message,
            })
        }
    }
}

/// Whether a job failed because its mark missed the target.
pub fn missed_target(job: &Job) -> Option<&str> {
    let failure = job.failure.as_ref()?;
    let missed = job.state() == State::Failed && failure.reason() == Reason::TargetMissed;
    missed.then_some(failure.message.as_str())
}

/// The error for a result that is not of the job's kind.
pub fn no_result(job: &Job) -> Error {
    Error::Answer {
        reason: format!("{} succeeded, but its result is missing", job.name),
    }
}
