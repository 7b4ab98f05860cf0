//! How often a caller may call, and how much a project may have.
use std::time::Duration;

use guardsplat_proto::v1::artifact_service_client::ArtifactServiceClient;
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::*;
use tonic::{Code, Response, Status};

use super::calls::{asking, call};
use super::harness::{Server, key_spec, metadata, refused, upload_messages};
use crate::access::Scope::{Embed, Verify};
use crate::service::Limits;
use crate::service::rate_limit::Rates;

const LIST: &str = "/guardsplat.v1.JobService/ListJobs";

fn rates(submissions: u32, claims: u32, calls: u32) -> Limits {
    Limits {
        rates: Rates {
            submissions,
            claims,
            calls,
        },
        ..Limits::default()
    }
}

fn too_many<T: std::fmt::Debug>(answer: Result<T, Status>, class: &str) {
    let details = refused(answer, Code::ResourceExhausted, "TOO_MANY_CALLS");
    assert_eq!(details.error_info().unwrap().metadata["class"], class);
    let wait = details.retry_info().unwrap().retry_delay.unwrap();
    assert!(wait > Duration::ZERO && wait <= Duration::from_secs(60), "{wait:?}");
    assert_eq!(details.quota_failure().unwrap().violations[0].subject, class);
}

fn create() -> CreateJobRequest {
    let job = Job {
        spec: Some(key_spec(8)),
        ..Job::default()
    };
    CreateJobRequest {
        job: Some(job),
        request_id: String::new(),
    }
}

#[tokio::test]
async fn a_project_has_so_many_calls_a_minute_whatever_its_tokens() {
    let server = Server::with_tokens_and(rates(2, 2, 3)).await;
    let (one, two) = (
        server.token("studio", &[Embed]).await,
        server.token("studio", &[Verify]).await,
    );
    let other = server.token("other", &[Embed]).await;
    let list = async |token: &str| call(&server.channel, LIST, Some(token), Vec::new()).await;
    for token in [&one, &two, &one] {
        list(token).await.unwrap();
    }
    too_many(list(&two).await, "calls");
    list(&other).await.unwrap();
    // Submissions are counted for themselves.
    let mut jobs = JobServiceClient::new(server.channel.clone());
    for _ in 0..2 {
        jobs.create_job(asking(&one, create())).await.unwrap();
    }
    too_many(jobs.create_job(asking(&one, create())).await, "submissions");
    jobs.create_job(asking(&other, create())).await.unwrap();
    // Tokens that are tried out are counted by where they come from, and those that are good are not held up.
    for _ in 0..3 {
        refused(list("gst_0_0").await, Code::Unauthenticated, "TOKEN_UNKNOWN");
    }
    too_many(list("gst_0_0").await, "calls");
    list(&other).await.unwrap();
}

#[tokio::test]
async fn claims_are_counted_besides() {
    let server = Server::with(rates(0, 1, 0)).await;
    let key = server.key(16, b"the key file").await;
    let picture = server.upload("a.png", b"a picture").await.name;
    let verify = || {
        server.submit(
            Job {
                spec: Some(super::harness::verify_spec(&picture, &key)),
                ..Job::default()
            },
            "",
        )
    };
    verify().await.unwrap();
    too_many(verify().await, "claims");
    server.create(key_spec(8)).await;
}

#[tokio::test]
async fn a_project_has_so_much_and_no_more() {
    let limits = Limits {
        max_queued_of_project: Some(1),
        max_bytes_of_project: Some(100),
        ..Limits::default()
    };
    let server = Server::with_tokens_and(limits).await;
    let (studio, other) = (
        server.token("studio", &[Embed]).await,
        server.token("other", &[Embed]).await,
    );
    let used_up = |answer: Result<_, Status>| {
        let details = refused::<()>(answer, Code::ResourceExhausted, "QUOTA_USED_UP");
        assert_eq!(details.error_info().unwrap().metadata["project"], "studio");
        let subject = details.quota_failure().unwrap().violations[0].subject.clone();
        assert_eq!(subject, "project:studio");
    };
    let upload = async |token: &str, bytes: &[u8]| {
        let messages = tokio_stream::iter(upload_messages(metadata("a.ply", bytes), bytes));
        let mut artifacts = ArtifactServiceClient::new(server.channel.clone());
        artifacts
            .upload_artifact(asking(token, messages))
            .await
            .map(Response::into_inner)
    };
    let first = upload(&studio, &[1; 60]).await.unwrap();
    used_up(upload(&studio, &[2; 60]).await.map(|_| ()));
    upload(&other, &[2; 60]).await.unwrap();
    let delete = asking(&studio, DeleteArtifactRequest { name: first.name });
    ArtifactServiceClient::new(server.channel.clone())
        .delete_artifact(delete)
        .await
        .unwrap();
    upload(&studio, &[2; 60]).await.unwrap();

    let mut jobs = JobServiceClient::new(server.channel.clone());
    let named = CreateJobRequest {
        request_id: uuid::Uuid::new_v4().to_string(),
        ..create()
    };
    let made = jobs
        .create_job(asking(&studio, named.clone()))
        .await
        .unwrap()
        .into_inner();
    used_up(jobs.create_job(asking(&studio, create())).await.map(|_| ()));
    jobs.create_job(asking(&other, create())).await.unwrap();
    // What was acknowledged is answered again all the same.
    let again = jobs.create_job(asking(&studio, named)).await.unwrap().into_inner();
    assert_eq!(again.name, made.name);
}
