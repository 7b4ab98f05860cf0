//! Jobs without end: those that ask for too much, attempts that make no progress, and a project that fills the queue.
use std::time::Duration;

use guardsplat_proto::v1::job::{Spec, State};
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::progress::Stage;
use guardsplat_proto::v1::{CreateJobRequest, Job, ListJobAttemptsRequest, Progress, ReportJobRequest, VerifySpec};
use tonic::Code;

use super::calls::asking;
use super::harness::{Server, invalid, key_spec, refused};
use crate::access::Scope::Embed;
use crate::service::Limits;

#[tokio::test]
async fn a_job_that_would_take_days_is_refused() {
    let server = Server::start().await;
    let key = server.key(64, b"key").await;
    let scene = server.upload("scene.ply", b"a scene").await.name;
    let submit = async |views: u32| {
        let spec = VerifySpec {
            suspects: vec![scene.clone()],
            key: key.clone(),
            message: "5ec2e75ec2e75ec2".into(),
            views,
            size: 4096,
            ..VerifySpec::default()
        };
        let job = Job {
            spec: Some(Spec::Verify(spec)),
            ..Job::default()
        };
        server.submit(job, "").await
    };
    submit(20).await.unwrap();
    assert_eq!(
        invalid(submit(10_000).await),
        ["job.verify.suspects", "job.verify.views", "job.verify.size"]
    );
}

#[tokio::test]
async fn an_attempt_without_progress_is_ended_though_its_worker_reports() {
    let stall = Duration::from_secs(2);
    let server = Server::with(Limits {
        progress_stall: stall,
        // Ten times as long as between two reports: the machine may be busy.
        lease: stall,
        ..Limits::default()
    })
    .await;
    let name = server.create(key_spec(8)).await.name;
    let (_, token) = server.take().await;
    let report = async |done: Option<i64>| {
        let progress = done.map(|done| Progress {
            stage: Stage::Optimising.into(),
            done,
            total: 100,
            ..Progress::default()
        });
        let request = ReportJobRequest {
            name: name.clone(),
            lease_token: token.clone(),
            progress,
        };
        server.worker.clone().report_job(request).await
    };
    // Who gets on is left alone, for longer than that.
    for done in 0..15 {
        report(Some(done)).await.unwrap();
        tokio::time::sleep(stall / 10).await;
    }
    let mut ended = None;
    for _ in 0..30 {
        if let Err(status) = report(None).await {
            ended = Some(status);
            break;
        }
        tokio::time::sleep(stall / 10).await;
    }
    refused(
        Err::<(), _>(ended.expect("the attempt goes on")),
        Code::Aborted,
        "LEASE_LOST",
    );
    let job = server.job(&name).await;
    assert_eq!((job.state(), job.attempt), (State::Queued, 1));
    let attempts = ListJobAttemptsRequest { name };
    let attempts = server
        .jobs
        .clone()
        .list_job_attempts(attempts)
        .await
        .unwrap()
        .into_inner();
    let failure = attempts.attempts[0].failure.clone().unwrap();
    assert!(failure.message.contains("no progress for 2 s"), "{}", failure.message);
}

/// However much one project submits, there is room for others.
#[tokio::test]
async fn a_project_cannot_fill_the_queue() {
    let server = Server::with_tokens_and(Limits {
        max_queued: 12,
        fair_shares: true,
        ..Limits::default()
    })
    .await;
    let submit = async |token: &str| {
        let job = Job {
            spec: Some(key_spec(8)),
            ..Job::default()
        };
        let request = CreateJobRequest {
            job: Some(job),
            request_id: String::new(),
        };
        let mut jobs = JobServiceClient::new(server.channel.clone());
        jobs.create_job(asking(token, request)).await
    };
    let mut taken = Vec::new();
    for project in ["greedy", "second", "third"] {
        let token = server.token(project, &[Embed]).await;
        let mut count = 0;
        let refusal = loop {
            match submit(&token).await {
                Ok(_) => count += 1,
                Err(status) => break status,
            }
            assert!(count < 12, "{project} fills the queue");
        };
        let details = refused(Err::<(), _>(refusal), Code::ResourceExhausted, "QUOTA_USED_UP");
        assert_eq!(details.error_info().unwrap().metadata["project"], project);
        taken.push(count);
    }
    assert_eq!(taken, [7, 3, 1]);
}
