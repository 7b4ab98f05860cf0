//! Jobs: created, read, cancelled.
use guardsplat_proto::v1::job::{Spec, State};
use guardsplat_proto::v1::{CancelJobRequest, GetJobRequest, Job, KeySpec};
use tonic::Code;
use uuid::Uuid;

use super::harness::{Server, invalid, key_spec, not_found, refused};

#[tokio::test]
async fn a_job_is_as_it_was_asked_for() {
    let server = Server::start().await;
    let spec = Spec::CreateKey(KeySpec {
        bits: 48,
        seed: Some(7),
        ..KeySpec::default()
    });
    let job = Job {
        display_name: "№ 1".into(),
        spec: Some(spec),
        ..Default::default()
    };
    let made = server.submit(job.clone(), "").await.unwrap().into_inner();
    // But for the seed, which is told to nobody again.
    let told = Spec::CreateKey(KeySpec {
        bits: 48,
        seed: None,
        seeded: true,
    });
    assert_eq!(made.spec, Some(told));
    assert_eq!(made.display_name, "№ 1");
    assert_eq!(made.state(), State::Queued);
    assert_eq!((made.attempt, made.max_attempts, made.queue_position), (0, 3, Some(0)));
    assert!(made.create_time.is_some() && made.start_time.is_none() && made.end_time.is_none());
    assert_eq!(server.job(&made.name).await, made);
    let second = server.create(key_spec(8)).await;
    assert_eq!(second.queue_position, Some(1));
}

#[tokio::test]
async fn names_are_checked_everywhere() {
    let server = Server::start().await;
    let mut jobs = server.jobs.clone();
    let nobody = format!("jobs/{}", Uuid::now_v7());
    for name in [
        "",
        "jobs/",
        "jobs/1",
        "keys/0198a6d2-9bb1-7c7e-8d4a-0c3f1f2b7a55",
        "jobs/../jobs/1",
    ] {
        assert_eq!(
            invalid(jobs.get_job(GetJobRequest { name: name.into() }).await),
            ["name"]
        );
        assert_eq!(
            invalid(jobs.cancel_job(CancelJobRequest { name: name.into() }).await),
            ["name"]
        );
    }
    assert_eq!(
        not_found(jobs.get_job(GetJobRequest { name: nobody.clone() }).await),
        nobody
    );
    assert_eq!(
        not_found(jobs.cancel_job(CancelJobRequest { name: nobody.clone() }).await),
        nobody
    );
}

#[tokio::test]
async fn a_queued_job_ends_at_once() {
    let server = Server::start().await;
    let name = server.create(key_spec(8)).await.name;
    let cancel = || CancelJobRequest { name: name.clone() };
    let ended = server.jobs.clone().cancel_job(cancel()).await.unwrap().into_inner();
    assert_eq!(ended.state(), State::Cancelled);
    assert!(ended.end_time.is_some() && ended.queue_position.is_none());
    let again = server.jobs.clone().cancel_job(cancel()).await;
    let details = refused(again, Code::FailedPrecondition, "JOB_FINISHED");
    assert_eq!(details.precondition_failure().unwrap().violations[0].subject, name);
    assert_eq!(server.lease(std::time::Duration::ZERO).await.job, None);
}
