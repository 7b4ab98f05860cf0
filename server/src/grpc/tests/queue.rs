//! The order of the queue, and who is given what, as callers see it.
use std::time::Duration;

use guardsplat_proto::v1::job::{Spec, State};
use guardsplat_proto::v1::{Job, LeaseJobRequest, LeaseJobResponse, WatchJobRequest};
use tokio::time::timeout;
use uuid::Uuid;

use super::admission::{embed, ply};
use super::harness::{Server, invalid, key_spec, refused, sha256, verify_spec};
use crate::service::Limits;

/// By then whatever is waited for has happened.
const SOON: Duration = Duration::from_secs(20);

fn urgent(spec: Spec, priority: i32) -> Job {
    Job {
        spec: Some(spec),
        priority: Some(priority),
        ..Job::default()
    }
}

async fn lease_as(server: &Server, memory_bytes: u64, clips: &[&str]) -> LeaseJobResponse {
    let request = LeaseJobRequest {
        worker: format!("{memory_bytes} {clips:?}"),
        memory_bytes,
        clip_sha256: clips.iter().map(|name| sha256(name.as_bytes())).collect(),
        device: "a device".into(),
        ..LeaseJobRequest::default()
    };
    server.worker.clone().lease_job(request).await.unwrap().into_inner()
}

#[tokio::test]
async fn the_most_urgent_job_is_given_out_first() {
    let server = Server::start().await;
    let key = server.key(8, b"key").await;
    let scene = server.upload("a.png", b"a picture").await.name;
    let bulk = server.create(key_spec(8)).await;
    let claim = server.create(verify_spec(&scene, &key)).await;
    let first = server.submit(urgent(key_spec(8), 10), "").await.unwrap().into_inner();
    let last = server.submit(urgent(key_spec(8), -10), "").await.unwrap().into_inner();
    let priorities = [&bulk, &claim, &first, &last].map(|job| job.priority);
    assert_eq!(priorities, [0, 5, 10, -10].map(Some));
    assert_eq!(server.job(&bulk.name).await.queue_position, Some(2));
    for job in [first, claim, bulk, last] {
        assert_eq!(server.take().await.0.name, job.name);
    }
    for beyond in [-11, 11, i32::MIN] {
        let answer = server.submit(urgent(key_spec(8), beyond), "").await;
        assert_eq!(invalid(answer), ["job.priority"]);
    }
}

#[tokio::test]
async fn the_same_request_has_the_same_priority() {
    let server = Server::start().await;
    let id = Uuid::new_v4().to_string();
    let made = server.submit(urgent(key_spec(8), 3), &id).await.unwrap().into_inner();
    let again = server.submit(urgent(key_spec(8), 3), &id).await.unwrap().into_inner();
    assert_eq!(again, made);
    let other = server.submit(urgent(key_spec(8), 4), &id).await;
    refused(other, tonic::Code::AlreadyExists, "REQUEST_ID_REUSED");
}

#[tokio::test]
async fn nobody_is_more_urgent_than_the_operator_allows() {
    let limits = Limits {
        max_priority: -2,
        ..Limits::default()
    };
    let server = Server::with(limits).await;
    let answer = server.submit(urgent(key_spec(8), -1), "").await;
    assert_eq!(invalid(answer), ["job.priority"]);
    server.submit(urgent(key_spec(8), -2), "").await.unwrap();
    assert_eq!(server.create(key_spec(8)).await.priority, Some(-2));
}

#[tokio::test]
async fn a_job_goes_to_a_worker_that_can_hold_it() {
    let server = Server::start().await;
    let key = server.key(16, b"key file").await;
    // 1.6 MiB of file, as much again in memory, and twice that to be marked.
    let scene = server.upload("scene.ply", &ply(30_000, 30_000)).await.name;
    let needed = 2 * (ply(30_000, 30_000).len() + 56 * 30_000) as u64;
    let large = server.submit(embed(&scene, &key), "").await.unwrap().into_inner();
    let small = server.create(key_spec(8)).await;
    let lease = lease_as(&server, needed - 1, &[]).await;
    assert_eq!(lease.job.unwrap().name, small.name);
    assert_eq!(lease_as(&server, needed - 1, &[]).await.job, None);
    assert_eq!(lease_as(&server, needed, &["another clip"]).await.job, None);
    let lease = lease_as(&server, needed, &["another clip", "weights"]).await;
    assert_eq!(lease.job.unwrap().name, large.name);
}

#[tokio::test]
async fn a_job_that_nobody_can_have_says_why() {
    let server = Server::start().await;
    let key = server.key(16, b"key file").await;
    let scene = server.upload("scene.ply", &ply(30_000, 30_000)).await.name;
    assert_eq!(lease_as(&server, 1 << 20, &[]).await.job, None);
    // Another that takes anything has just been there, and will be back.
    let job = server.submit(embed(&scene, &key), "").await.unwrap().into_inner();
    assert_eq!(job.waiting_reason, "");
    let (leased, token) = server.take().await;
    assert_eq!(
        (leased.waiting_reason.as_str(), leased.name.as_str()),
        ("", job.name.as_str())
    );
    let release = guardsplat_proto::v1::ReleaseJobRequest {
        name: job.name.clone(),
        lease_token: token,
    };
    server.worker.clone().release_job(release).await.unwrap();

    let server = Server::start().await;
    let nobody = server.create(key_spec(8)).await;
    assert!(nobody.waiting_reason.contains("no worker"), "{nobody:?}");
    let request = WatchJobRequest {
        name: nobody.name.clone(),
        cursor: String::new(),
    };
    let mut watched = server.jobs.clone().watch_job(request).await.unwrap().into_inner();
    let mut next = async || {
        timeout(SOON, watched.message())
            .await
            .unwrap()
            .unwrap()
            .unwrap()
            .job
            .unwrap()
    };
    assert_eq!(next().await.waiting_reason, nobody.waiting_reason);
    // One that can have it comes, and is given another; who waits is told without the job itself having changed.
    let first = server.submit(urgent(key_spec(8), 1), "").await.unwrap().into_inner();
    assert_eq!(lease_as(&server, 1, &[]).await.job.unwrap().name, first.name);
    loop {
        let job = next().await;
        assert_eq!(job.state(), State::Queued);
        if job.waiting_reason.is_empty() {
            break;
        }
    }
    assert_eq!(server.job(&nobody.name).await.waiting_reason, "");
}

#[tokio::test]
async fn what_workers_say_of_themselves_is_checked() {
    let server = Server::start().await;
    let say = async |request: LeaseJobRequest| server.worker.clone().lease_job(request).await;
    let worker = || LeaseJobRequest {
        worker: "w".into(),
        ..LeaseJobRequest::default()
    };
    let many = LeaseJobRequest {
        clip_sha256: vec!["ab".repeat(32); 65],
        ..worker()
    };
    assert_eq!(invalid(say(many).await), ["clip_sha256"]);
    for bad in ["", "ab", &"AB".repeat(32), &"a ".repeat(32)] {
        let request = LeaseJobRequest {
            clip_sha256: vec!["ab".repeat(32), bad.into()],
            ..worker()
        };
        assert_eq!(invalid(say(request).await), ["clip_sha256[1]"]);
    }
    let request = LeaseJobRequest {
        device: "\u{1b}[1m".into(),
        ..worker()
    };
    assert_eq!(invalid(say(request).await), ["device"]);
    let request = LeaseJobRequest {
        memory_bytes: u64::MAX,
        ..worker()
    };
    assert_eq!(say(request).await.unwrap().into_inner().job, None);
}
