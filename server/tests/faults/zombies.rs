//! Workers that stop for longer than their lease, and then go on as if nothing had been. Here they are tasks that hold a
//! lease and say nothing; the real worker, stopped by a signal, is among the tests of the whole service.
use std::sync::Arc;

use guardsplat_proto::v1::job::State;
use guardsplat_proto::v1::{FailJobRequest, Failure, Job, ReportJobRequest, failure::Reason};
use tokio::sync::Semaphore;
use tokio::time::Duration;
use tonic::{Code, Status};

use crate::caller::{Caller, persist};
use crate::place::{Place, short_or_full};
use crate::stub::{self, key_file, marked, release};

/// All that a worker can say of a job, and what the server answers.
pub async fn says_everything(caller: &Caller, job: &Job, token: &str) -> Vec<(&'static str, Status)> {
    let of = (job.name.as_str(), token);
    let report = ReportJobRequest {
        name: job.name.clone(),
        lease_token: token.into(),
        progress: None,
    };
    let failure = Failure {
        reason: Reason::Internal.into(),
        message: "late".into(),
    };
    let fail = FailJobRequest {
        name: job.name.clone(),
        lease_token: token.into(),
        failure: Some(failure),
        retryable: true,
        cancelled: false,
        ..FailJobRequest::default()
    };
    let mut worker = caller.worker.clone();
    let answers = [
        ("ReportJob", worker.report_job(report).await.map(|_| ())),
        ("DownloadKey", key_file(caller, of).await.map(|_| ())),
        (
            "UploadOutput",
            caller.output(of, b"late", false, Duration::ZERO).await.map(|_| ()),
        ),
        ("CompleteJob", caller.complete(of, late_result()).await),
        ("FailJob", worker.fail_job(fail).await.map(|_| ())),
        ("ReleaseJob", release(caller, of).await),
    ];
    answers
        .into_iter()
        .map(|(call, answer)| (call, answer.err().unwrap_or_else(|| Status::ok("was taken"))))
        .collect()
}

/// That names outputs which are not there, so that nothing could be published even by mistake.
fn late_result() -> guardsplat_proto::v1::complete_job_request::Result {
    let name = |n: u128| format!("artifacts/{}", uuid::Uuid::from_u128(n));
    guardsplat_proto::v1::complete_job_request::Result::EmbedResult(guardsplat_proto::v1::EmbedResult {
        scene: name(1),
        comparison: name(2),
        ..Default::default()
    })
}

pub async fn are_refused(place: Place) {
    let count = short_or_full(8, 100);
    let lease = short_or_full("3", "10");
    let server = place.start(&["--lease-seconds", lease, "--max-attempts", "9"]).await;
    let caller = place.caller();
    let inputs = caller.inputs().await;
    let mut zombies = Vec::new();
    for _ in 0..count {
        caller.submit(inputs.embed(), "").await.unwrap();
    }
    for _ in 0..count {
        let (job, token) = caller.take().await;
        caller
            .output((&job.name, &token), b"of the zombie", false, Duration::ZERO)
            .await
            .unwrap();
        zombies.push((job, token));
    }
    // Nobody says anything any more, and others are given the jobs. A few at a time, so that these are in time.
    let places = Arc::new(Semaphore::new(8));
    let mut tasks = Vec::new();
    for _ in 0..count {
        let (caller, zombies, places) = (caller.clone(), zombies.clone(), places.clone());
        tasks.push(tokio::spawn(async move {
            let _place = places.acquire_owned().await.unwrap();
            let (job, token) = caller.take().await;
            assert!(job.attempt > 1, "{job:?}");
            let (before, zombie) = zombies.iter().find(|(of, _)| of.name == job.name).unwrap();
            let mut refused = 0;
            for answers in [says_everything(&caller, before, zombie).await, {
                stub::complete(&caller, &job, &token).await.unwrap();
                says_everything(&caller, before, zombie).await
            }] {
                for (call, status) in answers {
                    assert_eq!(status.code(), Code::Aborted, "{call}: {status}");
                    refused += 1;
                }
            }
            let done = persist(|| caller.job(&job.name)).await.unwrap();
            assert_eq!((done.state(), done.attempt), (State::Succeeded, job.attempt));
            let Some(guardsplat_proto::v1::job::Result::EmbedResult(result)) = &done.result else {
                panic!("{done:?}")
            };
            assert!(caller.download(&result.scene).await.unwrap() == marked(&job));
            refused
        }));
    }
    let mut refused = 0;
    for task in tasks {
        refused += task.await.unwrap();
    }
    place.figure(&format!(
        "{count} of {count} workers that were silent for longer than their lease: {refused} of {refused} writes refused"
    ));
    server.stop().await;
}
