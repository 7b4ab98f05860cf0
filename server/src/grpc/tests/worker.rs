//! A worker's day: leasing, reporting, outputs, the end of a job in each of its ways.
use std::time::{Duration, Instant};

use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::job::{Result as JobResult, State};
use guardsplat_proto::v1::progress::Stage;
use guardsplat_proto::v1::{
    CancelJobRequest, CompleteJobRequest, EmbedResult, FailJobRequest, Failure, GetArtifactRequest, LeaseJobRequest,
    Progress, ReleaseJobRequest, ReportJobRequest, VerifyResult, failure::Reason, verify_result::Verdict,
};
use tonic::{Code, Status};

use super::harness::{Server, invalid, key_spec, not_found, refused};
use crate::service::Limits;

const LONG: Duration = Duration::from_secs(60);

async fn report(server: &Server, job: &str, token: &str, done: Option<i64>) -> Result<bool, Status> {
    let progress = done.map(|done| Progress {
        stage: Stage::Optimising.into(),
        done,
        total: 9,
        ..Default::default()
    });
    let request = ReportJobRequest {
        name: job.into(),
        lease_token: token.into(),
        progress,
    };
    server
        .worker
        .clone()
        .report_job(request)
        .await
        .map(|answer| answer.into_inner().cancel_requested)
}

async fn fail(server: &Server, job: &str, token: &str, reason: Reason, retryable: bool) -> Result<(), Status> {
    let failure = Some(Failure {
        reason: reason.into(),
        message: "why".into(),
    });
    let request = FailJobRequest {
        name: job.into(),
        lease_token: token.into(),
        failure,
        retryable,
        cancelled: false,
        ..FailJobRequest::default()
    };
    server.worker.clone().fail_job(request).await.map(|_| ())
}

#[tokio::test]
async fn a_lease_tells_the_rate_that_the_operator_chose() {
    for false_positive_rate in [Limits::default().false_positive_rate, 1e-9] {
        let limits = Limits {
            false_positive_rate,
            ..Limits::default()
        };
        let server = Server::with(limits).await;
        server.embed_job().await;
        let lease = server.lease(LONG).await;
        assert_eq!(lease.false_positive_rate, false_positive_rate);
    }
}

#[tokio::test]
async fn outputs_become_visible_with_the_result() {
    let server = Server::start().await;
    let name = server.embed_job().await.name;
    let (job, token) = server.take().await;
    assert_eq!(
        (job.name.as_str(), job.state(), job.attempt),
        (name.as_str(), State::Running, 1)
    );
    let scene = server
        .output(&name, &token, b"marked", false)
        .await
        .unwrap()
        .into_inner();
    let comparison = server.stored(&name, &token, b"picture", false).await;
    assert_eq!(scene.job, name);
    let get = async || {
        let request = GetArtifactRequest {
            name: scene.name.clone(),
        };
        server
            .artifacts
            .clone()
            .get_artifact(request)
            .await
            .map(|answer| answer.into_inner())
    };
    assert_eq!(not_found(get().await), scene.name);
    let result = EmbedResult {
        scene: scene.name.clone(),
        comparison,
        steps: 7,
        ..Default::default()
    };
    server
        .complete(&name, &token, Output::EmbedResult(result.clone()))
        .await
        .unwrap();
    assert_eq!(get().await.unwrap().job, name);
    let done = server.job(&name).await;
    assert_eq!(
        (done.state(), done.result),
        (State::Succeeded, Some(JobResult::EmbedResult(result.clone())))
    );
    // The answer may have been lost: said again it is the same, and changes nothing. Anything else comes too late.
    let before = server.job(&name).await;
    let again = Output::EmbedResult(result.clone());
    server.complete(&name, &token, again).await.unwrap();
    let other = EmbedResult { steps: 8, ..result };
    let other = server.complete(&name, &token, Output::EmbedResult(other)).await;
    refused(other, Code::Aborted, "LEASE_LOST");
    assert_eq!(server.job(&name).await, before);
}

#[tokio::test]
async fn results_are_checked() {
    let server = Server::start().await;
    let name = server.embed_job().await.name;
    let (_, token) = server.take().await;
    let upload = server.upload("other.ply", b"other").await.name;
    let output = server.stored(&name, &token, b"marked", false).await;
    let complete = async |scene: &str, comparison: &str| {
        let result = EmbedResult {
            scene: scene.into(),
            comparison: comparison.into(),
            ..Default::default()
        };
        server.complete(&name, &token, Output::EmbedResult(result)).await
    };
    assert_eq!(
        invalid(complete("", "").await),
        ["embed_result.scene", "embed_result.comparison"]
    );
    assert_eq!(invalid(complete(&output, &output).await), ["embed_result.comparison"]);
    // An upload is nobody's output.
    assert_eq!(invalid(complete(&output, &upload).await), ["result"]);
    let verdict = VerifyResult {
        verdict: Verdict::Match.into(),
        ..Default::default()
    };
    assert_eq!(
        invalid(server.complete(&name, &token, Output::VerifyResult(verdict)).await),
        ["result"]
    );
    let nothing = CompleteJobRequest {
        name: name.clone(),
        lease_token: token.clone(),
        result: None,
        ..CompleteJobRequest::default()
    };
    assert_eq!(invalid(server.worker.clone().complete_job(nothing).await), ["result"]);
    assert_eq!(
        invalid(server.output(&name, &token, b"key", true).await),
        ["metadata.secret"]
    );
    let long = EmbedResult {
        message: "f".repeat(70_000),
        scene: output,
        comparison: upload,
        ..Default::default()
    };
    assert_eq!(
        invalid(server.complete(&name, &token, Output::EmbedResult(long)).await),
        ["result"]
    );
    assert_eq!(server.job(&name).await.state(), State::Running);
}

#[tokio::test]
async fn a_waiting_worker_is_woken() {
    let server = Server::start().await;
    let began = Instant::now();
    let waiting = async { (server.lease(LONG).await, began.elapsed()) };
    let submitting = async {
        tokio::time::sleep(Duration::from_millis(200)).await;
        server.create(key_spec(8)).await
    };
    let ((lease, waited), job) = tokio::join!(waiting, submitting);
    assert_eq!(lease.job.unwrap().name, job.name);
    assert_eq!(lease.lease_duration.unwrap().seconds, 30);
    // Sooner than by looking again.
    assert!(waited < Duration::from_millis(900), "{waited:?}");

    let began = Instant::now();
    assert_eq!(server.lease(Duration::from_millis(300)).await.job, None);
    assert!(
        (280..2000).contains(&began.elapsed().as_millis()),
        "{:?}",
        began.elapsed()
    );
}

#[tokio::test]
async fn a_job_is_not_lost_with_a_caller_that_left() {
    let server = Server::start().await;
    for _ in 0..20 {
        // Gone at about the moment that the job comes.
        let leaving = tokio::time::timeout(Duration::from_millis(10), server.lease(LONG));
        let submitting = async {
            tokio::time::sleep(Duration::from_millis(9)).await;
            server.create(key_spec(8)).await
        };
        let (left, job) = tokio::join!(leaving, submitting);
        // Either it was given out, or it still is to be had, uncharged; but an answer that was on its way is lost.
        let (name, token) = match left {
            Ok(lease) => (lease.job.unwrap().name, lease.lease_token),
            Err(_) => match tokio::time::timeout(Duration::from_secs(3), server.lease(LONG)).await {
                Ok(lease) => {
                    let leased = lease.job.unwrap();
                    assert_eq!(leased.attempt, 1);
                    (leased.name, lease.lease_token)
                }
                Err(_) => {
                    let cancel = CancelJobRequest { name: job.name.clone() };
                    server.jobs.clone().cancel_job(cancel).await.unwrap();
                    continue;
                }
            },
        };
        assert_eq!(name, job.name);
        fail(&server, &name, &token, Reason::InvalidInput, false).await.unwrap();
    }
}

#[tokio::test]
async fn leasing_is_checked() {
    let server = Server::start().await;
    let lease = async |worker: &str, seconds, nanos| {
        let wait = Some(prost_types::Duration { seconds, nanos });
        server
            .worker
            .clone()
            .lease_job(LeaseJobRequest {
                worker: worker.into(),
                wait,
                ..LeaseJobRequest::default()
            })
            .await
    };
    assert_eq!(invalid(lease("", 0, 0).await), ["worker"]);
    assert_eq!(invalid(lease("\u{1b}[1m", 0, 0).await), ["worker"]);
    for (seconds, nanos) in [(61, 0), (-1, 0), (0, -1), (60, 1), (i64::MAX, 0)] {
        assert_eq!(invalid(lease("w", seconds, nanos).await), ["wait"]);
    }
}

#[tokio::test]
async fn progress_is_written_at_most_once_a_second() {
    let server = Server::start().await;
    let name = server.create(key_spec(8)).await.name;
    let (_, token) = server.take().await;
    let done = async || server.job(&name).await.progress.map(|progress| progress.done);
    report(&server, &name, &token, Some(1)).await.unwrap();
    for step in 2..30 {
        report(&server, &name, &token, Some(step)).await.unwrap();
    }
    assert_eq!(done().await, Some(1));
    // Asked to end, the worker hears of it with the very next report.
    server
        .jobs
        .clone()
        .cancel_job(CancelJobRequest { name: name.clone() })
        .await
        .unwrap();
    assert!(report(&server, &name, &token, None).await.unwrap());
    tokio::time::sleep(Duration::from_millis(1010)).await;
    report(&server, &name, &token, None).await.unwrap();
    assert_eq!(done().await, Some(29));
    let wrong = Progress {
        stage: 77,
        done: -1,
        total: -1,
        ..Default::default()
    };
    let request = ReportJobRequest {
        name,
        lease_token: token,
        progress: Some(wrong),
    };
    let fields = ["progress.stage", "progress.done", "progress.total"];
    assert_eq!(invalid(server.worker.clone().report_job(request).await), fields);
}

#[tokio::test]
async fn a_job_ends_when_it_was_asked_to() {
    let server = Server::start().await;
    let name = server.create(key_spec(8)).await.name;
    let (_, token) = server.take().await;
    let cancelled = async || {
        let (name, lease_token) = (name.clone(), token.clone());
        let request = FailJobRequest {
            name,
            lease_token,
            cancelled: true,
            ..Default::default()
        };
        server.worker.clone().fail_job(request).await
    };
    assert!(!report(&server, &name, &token, None).await.unwrap());
    refused(cancelled().await, Code::FailedPrecondition, "CANCEL_NOT_REQUESTED");
    let asked = server
        .jobs
        .clone()
        .cancel_job(CancelJobRequest { name: name.clone() })
        .await
        .unwrap()
        .into_inner();
    assert_eq!((asked.state(), asked.cancel_requested), (State::Running, true));
    cancelled().await.unwrap();
    assert_eq!(server.job(&name).await.state(), State::Cancelled);
}

#[tokio::test]
async fn failures_end_a_job_or_have_it_tried_again() {
    let server = Server::start().await;
    let hopeless = server.create(key_spec(8)).await.name;
    let (_, token) = server.take().await;
    for reason in [Reason::Unspecified, Reason::AttemptsExhausted] {
        assert_eq!(
            invalid(fail(&server, &hopeless, &token, reason, false).await),
            ["failure.reason"]
        );
    }
    let request = FailJobRequest {
        name: hopeless.clone(),
        lease_token: token.clone(),
        ..Default::default()
    };
    assert_eq!(invalid(server.worker.clone().fail_job(request).await), ["failure"]);
    fail(&server, &hopeless, &token, Reason::TargetMissed, false)
        .await
        .unwrap();
    let job = server.job(&hopeless).await;
    assert_eq!(
        (job.state(), job.failure.unwrap().reason()),
        (State::Failed, Reason::TargetMissed)
    );

    let lucky = server.create(key_spec(8)).await.name;
    let (_, token) = server.take().await;
    fail(&server, &lucky, &token, Reason::WorkerLost, true).await.unwrap();
    let job = server.job(&lucky).await;
    assert_eq!((job.state(), job.attempt), (State::Queued, 1));
    assert!(job.retry_time.is_some() && job.failure.is_some());
    assert_eq!(server.lease(Duration::ZERO).await.job, None);
    // A worker that waits is given it when the pause is over.
    let again = server.lease(Duration::from_secs(10)).await.job.unwrap();
    assert_eq!((again.name, again.attempt), (lucky, 2));
}

#[tokio::test]
async fn a_job_that_is_handed_back_is_not_charged() {
    let server = Server::start().await;
    let name = server.create(key_spec(8)).await.name;
    for _ in 0..5 {
        let (job, lease_token) = server.take().await;
        assert_eq!(job.attempt, 1);
        let request = ReleaseJobRequest {
            name: name.clone(),
            lease_token,
        };
        server.worker.clone().release_job(request).await.unwrap();
        assert_eq!(
            (server.job(&name).await.state(), server.job(&name).await.attempt),
            (State::Queued, 0)
        );
    }
}

#[tokio::test]
async fn a_stopping_server_gives_out_nothing_and_takes_everything() {
    let server = Server::start().await;
    let name = server.create(key_spec(8)).await.name;
    let (_, token) = server.take().await;
    let mut worker = server.worker.clone();
    let request = LeaseJobRequest {
        worker: "w".into(),
        wait: Some(prost_types::Duration { seconds: 30, nanos: 0 }),
        ..LeaseJobRequest::default()
    };
    let waiting = tokio::spawn(async move { worker.lease_job(request).await });
    tokio::time::sleep(Duration::from_millis(100)).await;
    server.api.stop();
    let details = refused(waiting.await.unwrap(), Code::Unavailable, "STOPPING");
    assert!(details.retry_info().is_some());
    report(&server, &name, &token, Some(3)).await.unwrap();
    let request = ReleaseJobRequest {
        name: name.clone(),
        lease_token: token,
    };
    server.worker.clone().release_job(request).await.unwrap();
    assert_eq!(server.job(&name).await.state(), State::Queued);
}
