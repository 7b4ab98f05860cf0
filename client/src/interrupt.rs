//! Ctrl-C: what it leaves behind, and what can be done about that.
use guardsplat_proto::v1::CancelJobRequest;
use guardsplat_proto::v1::job_service_client::JobServiceClient;

use crate::context::Context;
use crate::error::Error;
use crate::stage::Stage;

/// Ends when the process is asked to end.
pub async fn heard() {
    #[cfg(unix)]
    let terminated = async {
        match tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate()) {
            Ok(mut signal) => signal.recv().await,
            Err(_) => std::future::pending().await,
        }
    };
    #[cfg(not(unix))]
    let terminated = std::future::pending::<Option<()>>();
    let interrupted = async {
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
    };
    tokio::select! {
        () = interrupted => {}
        _ = terminated => {}
    }
}

/// What to say after an interrupt; cancels the job where that was asked for, unless a second interrupt comes.
pub async fn answer(context: &Context) -> Error {
    let stage = context.stage.take();
    let Stage::Waiting { job, cancel: true } = &stage else {
        return interrupted(stage, "");
    };
    let request = CancelJobRequest { name: job.clone() };
    let cancelled = tokio::select! {
        result = context.once("cancelling the job", request, async |channel, request| {
            JobServiceClient::new(channel).cancel_job(request).await
        }) => result.map(|_| ()).map_err(|error| error.to_string()),
        () = heard() => Err("interrupted again".into()),
    };
    match cancelled {
        Ok(()) => Error::Interrupted {
            after: format!("; the end of {job} was asked for"),
            job: Some(job.clone()),
        },
        Err(error) => interrupted(stage, &format!(" ({error})")),
    }
}

fn interrupted(stage: Stage, why: &str) -> Error {
    let (job, after) = match stage {
        Stage::Nothing => (None, String::new()),
        Stage::Creating => (
            None,
            "; the job may be queued all the same, `guardsplat jobs list` shows it".into(),
        ),
        Stage::Waiting { job, .. } => {
            let after = format!(
                "; {job} goes on{why}\n  to follow it: guardsplat jobs watch {job}\n  to end it:    guardsplat jobs \
                 cancel {job}"
            );
            (Some(job), after)
        }
        Stage::Fetching { job } => {
            let after = format!(
                "; {job} is done, but what it made was not fetched\n  guardsplat jobs get {job} names it, guardsplat \
                 artifact get fetches it"
            );
            (Some(job), after)
        }
    };
    Error::Interrupted { job, after }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_goes_on_is_told_with_the_commands_for_it() {
        let stage = Stage::Waiting {
            job: "jobs/7".into(),
            cancel: false,
        };
        let text = interrupted(stage, "").to_string();
        assert!(text.contains("goes on"), "{text}");
        assert!(text.contains("guardsplat jobs cancel jobs/7"), "{text}");
        assert!(text.contains("guardsplat jobs watch jobs/7"), "{text}");
        assert_eq!(interrupted(Stage::Nothing, "").to_string(), "interrupted");
    }
}
