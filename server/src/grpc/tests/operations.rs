//! What those who look after the service see and do: dead letters, attempts, another try, and what is counted of it all.
use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::failure::Reason;
use guardsplat_proto::v1::job::State;
use guardsplat_proto::v1::job_attempt::Outcome;
use guardsplat_proto::v1::progress::Stage;
use guardsplat_proto::v1::{
    CompleteJobRequest, DeleteArtifactRequest, EmbedResult, FailJobRequest, Failure, JobAttempt,
    ListJobAttemptsRequest, ListJobsRequest, Progress, ReportJobRequest, RequeueJobRequest,
};
use tonic::{Code, Status};

use super::harness::{Server, invalid, key_spec, not_found, refused};

async fn fail(server: &Server, job: &str, token: &str, reason: Reason, retryable: bool) {
    let request = FailJobRequest {
        name: job.into(),
        lease_token: token.into(),
        failure: Some(Failure {
            reason: reason.into(),
            message: "why".into(),
        }),
        retryable,
        cancelled: false,
        ..FailJobRequest::default()
    };
    server.worker.clone().fail_job(request).await.unwrap();
}

async fn dead(server: &Server, reasons: &[Reason], size: i32, token: &str) -> Result<(Vec<String>, String), Status> {
    let request = ListJobsRequest {
        page_size: size,
        page_token: token.into(),
        reasons: reasons.iter().map(|&reason| reason.into()).collect(),
        ..ListJobsRequest::default()
    };
    let answer = server.jobs.clone().list_jobs(request).await?.into_inner();
    let names = answer.jobs.into_iter().map(|job| job.name).collect();
    Ok((names, answer.next_page_token))
}

async fn attempts(server: &Server, name: &str) -> Vec<JobAttempt> {
    let request = ListJobAttemptsRequest { name: name.into() };
    let answer = server.jobs.clone().list_job_attempts(request).await;
    answer.unwrap().into_inner().attempts
}

async fn requeue(server: &Server, name: &str) -> Result<guardsplat_proto::v1::Job, Status> {
    let request = RequeueJobRequest { name: name.into() };
    let answer = server.jobs.clone().requeue_job(request).await;
    answer.map(tonic::Response::into_inner)
}

#[tokio::test]
async fn a_dead_letter_is_found_looked_at_and_tried_again() {
    let server = Server::start().await;
    let job = server.embed_job().await;
    refused(
        requeue(&server, &job.name).await,
        Code::FailedPrecondition,
        "JOB_NOT_FAILED",
    );
    let (_, token) = server.take().await;
    fail(&server, &job.name, &token, Reason::TargetMissed, false).await;
    let other = server.create(key_spec(8)).await.name;
    let (_, token) = server.take().await;
    fail(&server, &other, &token, Reason::InvalidInput, false).await;

    let both = [Reason::TargetMissed, Reason::InvalidInput];
    let (missed, _) = dead(&server, &[Reason::TargetMissed], 9, "").await.unwrap();
    assert_eq!(missed, std::slice::from_ref(&job.name));
    let (first, next) = dead(&server, &both, 1, "").await.unwrap();
    let (second, end) = dead(&server, &both, 1, &next).await.unwrap();
    assert_eq!(
        (first, second, end),
        (vec![other], vec![job.name.clone()], String::new())
    );
    // A token is of the list it was given with.
    let answer = dead(&server, &[Reason::TargetMissed], 1, &next).await;
    assert_eq!(invalid(answer), ["page_token"]);

    let tried = attempts(&server, &job.name).await;
    assert_eq!(tried.len(), 1);
    assert_eq!((tried[0].number, tried[0].outcome()), (1, Outcome::Failed));
    assert_eq!(tried[0].worker, "test");
    assert_eq!(tried[0].failure.as_ref().unwrap().reason(), Reason::TargetMissed);
    assert!(tried[0].end_time.is_some());

    let queued = requeue(&server, &job.name).await.unwrap();
    assert_eq!(
        (queued.state(), queued.attempt, queued.failure),
        (State::Queued, 0, None)
    );
    let (leased, token) = server.take().await;
    assert_eq!((&leased.name, leased.attempt), (&job.name, 1));
    let scene = server.stored(&job.name, &token, b"marked", false).await;
    let comparison = server.stored(&job.name, &token, b"picture", false).await;
    let result = EmbedResult {
        scene,
        comparison,
        ..EmbedResult::default()
    };
    server
        .complete(&job.name, &token, Output::EmbedResult(result))
        .await
        .unwrap();
    let outcomes: Vec<_> = attempts(&server, &job.name).await.iter().map(|a| a.outcome()).collect();
    assert_eq!(outcomes, [Outcome::Succeeded, Outcome::Failed]);
}

#[tokio::test]
async fn what_is_gone_is_not_tried_again() {
    let server = Server::start().await;
    let job = server.embed_job().await;
    let (leased, token) = server.take().await;
    fail(&server, &job.name, &token, Reason::Internal, false).await;
    let Some(guardsplat_proto::v1::job::Spec::Embed(spec)) = leased.spec else {
        panic!("{leased:?}")
    };
    let delete = DeleteArtifactRequest {
        name: spec.scene.clone(),
    };
    server.artifacts.clone().delete_artifact(delete).await.unwrap();
    assert_eq!(not_found(requeue(&server, &job.name).await), spec.scene);
    assert_eq!(server.job(&job.name).await.state(), State::Failed);
}

/// Every figure that a job moves, by the way that a job goes.
#[tokio::test]
async fn what_happens_is_counted() {
    let server = Server::start().await;
    let text = || server.api.metrics().text().unwrap();
    let has = |line: &str| {
        assert!(
            text().lines().any(|there| there == line),
            "{line} is not in\n{}",
            text()
        )
    };
    let job = server.embed_job().await;
    let (_, token) = server.take().await;
    for stage in [Stage::Preparing, Stage::Optimising, Stage::Optimising, Stage::Reading] {
        let request = ReportJobRequest {
            name: job.name.clone(),
            lease_token: token.clone(),
            progress: Some(Progress {
                stage: stage.into(),
                ..Progress::default()
            }),
        };
        server.worker.clone().report_job(request).await.unwrap();
    }
    let scene = server.stored(&job.name, &token, b"marked", false).await;
    let comparison = server.stored(&job.name, &token, b"picture", false).await;
    let result = Output::EmbedResult(EmbedResult {
        scene,
        comparison,
        bit_accuracy: 0.99,
        message_recovered: true,
        psnr_db: Some(41.0),
        ..EmbedResult::default()
    });
    for peak in [3_u64 << 30, 5 << 30] {
        // Said again it is no second mark, also when the worker has measured anew.
        let request = CompleteJobRequest {
            name: job.name.clone(),
            lease_token: token.clone(),
            result: Some(result.clone()),
            peak_memory_bytes: Some(peak),
            peak_device_memory_bytes: Some(peak / 2),
            ..CompleteJobRequest::default()
        };
        server.worker.clone().complete_job(request).await.unwrap();
    }
    has(r#"guardsplat_jobs_created_total{kind="embed"} 1"#);
    has(r#"guardsplat_job_attempts_ended_total{kind="embed",outcome="succeeded"} 1"#);
    has(r#"guardsplat_jobs_ended_total{kind="embed",state="succeeded"} 1"#);
    has(r#"guardsplat_marks_total{recovered="true"} 1"#);
    has("guardsplat_mark_psnr_db_sum 41.0");
    has(r#"guardsplat_job_memory_bytes_count{kind="embed"} 1"#);
    has(&format!(
        r#"guardsplat_job_memory_bytes_sum{{kind="embed"}} {:?}"#,
        (3_u64 << 30) as f64
    ));
    has(&format!(
        r#"guardsplat_job_device_memory_bytes_sum{{kind="embed"}} {:?}"#,
        (3_u64 << 29) as f64
    ));
    for (stage, count) in [("preparing", 1), ("optimising", 1), ("reading", 1), ("storing", 0)] {
        has(&format!(
            r#"guardsplat_stage_seconds_count{{kind="embed",stage="{stage}"}} {count}"#
        ));
    }
    // The scene; and the key file, the marked scene and the picture.
    has(r#"guardsplat_uploaded_bytes_total{what="artifact"} 7"#);
    has(r#"guardsplat_uploaded_bytes_total{what="output"} 25"#);
    has(r#"guardsplat_calls_total{method="guardsplat.v1.JobService/CreateJob",code="OK"} 2"#);
    has(r#"guardsplat_calls_total{method="guardsplat.v1.WorkerService/CompleteJob",code="OK"} 3"#);
    has(r#"guardsplat_call_seconds_count{method="guardsplat.v1.WorkerService/ReportJob"} 4"#);
    let missing = not_found(requeue(&server, "jobs/00000000-0000-7000-8000-000000000001").await);
    assert!(missing.starts_with("jobs/"));
    has(r#"guardsplat_calls_total{method="guardsplat.v1.JobService/RequeueJob",code="NOT_FOUND"} 1"#);
    assert!(server.api.workers().alive());
    // Names of nobody and nothing are in there.
    for name in ["scene.ply", &job.name["jobs/".len()..], "output.bin", "default"] {
        assert!(!text().contains(name), "{name}");
    }
}

#[tokio::test]
async fn calls_without_a_token_are_counted_as_refused() {
    let server = Server::with_tokens().await;
    let answer = server.jobs.clone().list_jobs(ListJobsRequest::default()).await;
    refused(answer, Code::Unauthenticated, "TOKEN_MISSING");
    let text = server.api.metrics().text().unwrap();
    for line in [
        r#"guardsplat_calls_refused_total{reason="TOKEN_MISSING"} 1"#,
        r#"guardsplat_calls_total{method="guardsplat.v1.JobService/ListJobs",code="UNAUTHENTICATED"} 1"#,
    ] {
        assert!(text.lines().any(|there| there == line), "{line} is not in\n{text}");
    }
}
