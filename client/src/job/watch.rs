//! Follows a job until it is over, however often the connection is lost.
use std::time::Instant;

use guardsplat_proto::v1::job::State;
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::{Job, WatchJobRequest, WatchJobResponse};
use tonic::{Status, Streaming};

use crate::backoff::LONGEST;
use crate::context::{Context, refused};
use crate::error::{Error, Result};
use crate::server::is_lost;

const DOING: &str = "following the job";

/// Calls `each` with the job and its cursor whenever it changes; gives it back when it is over.
pub async fn watch(context: &Context, name: &str, cursor: String, mut each: impl FnMut(&Job, &str)) -> Result<Job> {
    let mut cursor = cursor;
    let mut backoff = context.backoff();
    let hint = format!("\n  the job goes on: guardsplat jobs watch {name}");
    loop {
        let lost = match open(context, name, &cursor).await? {
            Err(status) => status,
            Ok(mut stream) => {
                let opened = Instant::now();
                let lost = loop {
                    match stream.message().await {
                        Ok(Some(message)) => {
                            if backoff.is_lost() {
                                context.console.say("the server is back");
                            }
                            backoff.heard();
                            let job = message.job.ok_or_else(|| Error::Answer {
                                reason: "a message of the watch has no job".into(),
                            })?;
                            cursor = message.cursor;
                            each(&job, &cursor);
                            if is_over(&job) {
                                return Ok(job);
                            }
                        }
                        // A server that stops ends its streams; the job is not over.
                        Ok(None) => break Status::unavailable("the server ended the stream"),
                        Err(status) => break status,
                    }
                };
                // A stream that stood for a while was contact, though a job in the queue had no news.
                if opened.elapsed() > LONGEST {
                    backoff.heard();
                }
                lost
            }
        };
        if !is_lost(&lost) {
            return Err(refused(DOING, lost));
        }
        context.pause(&mut backoff, DOING, &lost, &hint).await?;
    }
}

async fn open(context: &Context, name: &str, cursor: &str) -> Result<Result<Streaming<WatchJobResponse>, Status>> {
    let mut client = JobServiceClient::new(context.server.channel().await?);
    let request = WatchJobRequest {
        name: name.to_owned(),
        cursor: cursor.to_owned(),
    };
    let opened = context.in_time(client.watch_job(context.request(request))).await;
    Ok(opened.map(tonic::Response::into_inner))
}

/// Whether nothing of a job changes any more.
pub fn is_over(job: &Job) -> bool {
    matches!(job.state(), State::Succeeded | State::Failed | State::Cancelled)
}
