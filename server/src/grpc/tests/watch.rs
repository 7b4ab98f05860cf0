//! Watching a job: from now, from a cursor, across a restart, and slowly.
use std::time::{Duration, Instant};

use guardsplat_proto::v1::failure::Reason;
use guardsplat_proto::v1::job::State;
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::progress::Stage;
use guardsplat_proto::v1::{
    CancelJobRequest, FailJobRequest, Failure, Progress, ReportJobRequest, WatchJobRequest, WatchJobResponse,
};
use tonic::transport::Channel;
use tonic::{Code, Status, Streaming};
use uuid::Uuid;

use super::harness::{Server, invalid, key_spec, not_found, refused};
use crate::service::Limits;

async fn watch(server: &Server, name: &str, cursor: &str) -> Result<Streaming<WatchJobResponse>, Status> {
    let request = WatchJobRequest {
        name: name.into(),
        cursor: cursor.into(),
    };
    server
        .jobs
        .clone()
        .watch_job(request)
        .await
        .map(|answer| answer.into_inner())
}

/// The next message, which must come soon.
async fn next(stream: &mut Streaming<WatchJobResponse>) -> Result<Option<WatchJobResponse>, Status> {
    tokio::time::timeout(Duration::from_secs(10), stream.message())
        .await
        .expect("no message")
}

async fn state(stream: &mut Streaming<WatchJobResponse>) -> State {
    next(stream).await.unwrap().expect("ended").job.unwrap().state()
}

async fn fail(server: &Server, name: &str, token: &str) {
    let failure = Some(Failure {
        reason: Reason::InvalidInput.into(),
        message: "why".into(),
    });
    let request = FailJobRequest {
        name: name.into(),
        lease_token: token.into(),
        failure,
        ..Default::default()
    };
    server.worker.clone().fail_job(request).await.unwrap();
}

async fn report(server: &Server, name: &str, token: &str, done: i64) {
    let progress = Some(Progress {
        stage: Stage::Reading.into(),
        done,
        ..Default::default()
    });
    let request = ReportJobRequest {
        name: name.into(),
        lease_token: token.into(),
        progress,
    };
    server.worker.clone().report_job(request).await.unwrap();
}

#[tokio::test]
async fn every_state_is_told_and_the_end_ends_it() {
    let server = Server::start().await;
    // Else it is told, too, when there is a worker for it.
    assert_eq!(server.lease(Duration::ZERO).await.job, None);
    let name = server.create(key_spec(8)).await.name;
    let mut stream = watch(&server, &name, "").await.unwrap();
    assert_eq!(state(&mut stream).await, State::Queued);
    let (_, token) = server.take().await;
    let began = Instant::now();
    assert_eq!(state(&mut stream).await, State::Running);
    report(&server, &name, &token, 5).await;
    assert_eq!(
        next(&mut stream)
            .await
            .unwrap()
            .unwrap()
            .job
            .unwrap()
            .progress
            .unwrap()
            .done,
        5
    );
    fail(&server, &name, &token).await;
    assert_eq!(state(&mut stream).await, State::Failed);
    assert_eq!(next(&mut stream).await.unwrap(), None);
    // Announced, not found by looking again.
    assert!(began.elapsed() < Duration::from_millis(1500), "{:?}", began.elapsed());
}

#[tokio::test]
async fn a_queued_job_hears_of_its_place() {
    let server = Server::start().await;
    let first = server.create(key_spec(8)).await.name;
    let second = server.create(key_spec(8)).await.name;
    let mut stream = watch(&server, &second, "").await.unwrap();
    let mut place = async || next(&mut stream).await.unwrap().unwrap().job.unwrap().queue_position;
    assert_eq!(place().await, Some(1));
    server
        .jobs
        .clone()
        .cancel_job(CancelJobRequest { name: first })
        .await
        .unwrap();
    assert_eq!(place().await, Some(0));
}

#[tokio::test]
async fn a_cursor_goes_on_behind_what_was_seen() {
    let server = Server::start().await;
    let name = server.create(key_spec(8)).await.name;
    let mut stream = watch(&server, &name, "").await.unwrap();
    let queued = next(&mut stream).await.unwrap().unwrap().cursor;
    drop(stream);
    // Nothing has happened: nothing is told twice.
    let mut stream = watch(&server, &name, &queued).await.unwrap();
    assert!(
        tokio::time::timeout(Duration::from_millis(300), stream.message())
            .await
            .is_err()
    );
    drop(stream);

    let (_, token) = server.take().await;
    report(&server, &name, &token, 5).await;
    let server = server.restart(Limits::default()).await;
    // What was missed comes in one message, also from another server.
    let mut stream = watch(&server, &name, &queued).await.unwrap();
    let message = next(&mut stream).await.unwrap().unwrap();
    assert_eq!(message.job.unwrap().progress.unwrap().done, 5);
    fail(&server, &name, &token).await;
    let last = next(&mut stream).await.unwrap().unwrap();
    assert_eq!(last.job.unwrap().state(), State::Failed);
    assert_eq!(next(&mut stream).await.unwrap(), None);
    // All is seen, and the job is over.
    assert_eq!(
        next(&mut watch(&server, &name, &last.cursor).await.unwrap())
            .await
            .unwrap(),
        None
    );
    // Who comes late still hears how it ended.
    assert_eq!(
        state(&mut watch(&server, &name, "").await.unwrap()).await,
        State::Failed
    );
}

#[tokio::test]
async fn cursors_and_names_are_checked() {
    let server = Server::start().await;
    let (a, b) = (
        server.create(key_spec(8)).await.name,
        server.create(key_spec(8)).await.name,
    );
    let cursor = next(&mut watch(&server, &a, "").await.unwrap())
        .await
        .unwrap()
        .unwrap()
        .cursor;
    for cursor in [cursor.as_str(), "1", "é", &"0".repeat(58)] {
        assert_eq!(invalid(watch(&server, &b, cursor).await), ["cursor"]);
    }
    assert_eq!(invalid(watch(&server, "jobs/..", "").await), ["name"]);
    let nobody = format!("jobs/{}", Uuid::now_v7());
    assert_eq!(not_found(watch(&server, &nobody, "").await), nobody);
}

#[tokio::test]
async fn slow_watchers_hold_up_nobody() {
    // Reports of a lease as short as this are all written.
    let server = Server::with(Limits {
        lease: Duration::from_millis(400),
        ..Limits::default()
    })
    .await;
    let name = server.create(key_spec(8)).await.name;
    let (_, token) = server.take().await;
    let mut slow = Vec::new();
    for _ in 0..50 {
        slow.push(watch(&server, &name, "").await.unwrap());
    }
    for done in 1..=10 {
        tokio::time::sleep(Duration::from_millis(101)).await;
        let began = Instant::now();
        report(&server, &name, &token, done).await;
        assert!(began.elapsed() < Duration::from_millis(300), "{:?}", began.elapsed());
    }
    fail(&server, &name, &token).await;
    // They hear of the end all the same, and never of what is older than what they heard before.
    for stream in &mut slow {
        let (mut last, mut before) = (State::Unspecified, 0);
        while let Some(message) = next(stream).await.unwrap() {
            let job = message.job.unwrap();
            let done = job.progress.map_or(0, |progress| progress.done);
            assert!(done >= before);
            (last, before) = (job.state(), done);
        }
        assert_eq!((last, before), (State::Failed, 10));
    }
}

/// A watch on a connection of its own, whose stream has room for a message or two that nobody has read.
async fn narrow(server: &Server, name: &str) -> Streaming<WatchJobResponse> {
    let endpoint = Channel::from_shared(server.url.clone()).unwrap();
    let channel = endpoint.initial_stream_window_size(512).connect().await.unwrap();
    let request = WatchJobRequest {
        name: name.into(),
        ..WatchJobRequest::default()
    };
    let answer = JobServiceClient::new(channel).watch_job(request).await;
    answer.unwrap().into_inner()
}

fn is_told(server: &Server, line: &str) -> bool {
    let text = server.api.metrics().text().unwrap();
    text.lines().any(|told| told == line)
}

#[tokio::test]
async fn who_does_not_read_is_shed_and_others_are_not() {
    // Reports of a lease as short as this are written every 400 ms.
    let server = Server::with(Limits {
        lease: Duration::from_millis(1600),
        watch_stall: Duration::from_secs(2),
        ..Limits::default()
    })
    .await;
    let name = server.create(key_spec(8)).await.name;
    let (_, token) = server.take().await;
    let mut stalled = narrow(&server, &name).await;
    let first = next(&mut stalled).await.unwrap().unwrap();
    let reader = |mut stream: Streaming<WatchJobResponse>, pause| {
        tokio::spawn(async move {
            let mut last = None;
            while let Some(message) = stream.message().await? {
                last = message.job;
                tokio::time::sleep(pause).await;
            }
            Ok::<_, Status>(last.unwrap().state())
        })
    };
    // It takes less than is told, and so is soon behind.
    let slow = reader(narrow(&server, &name).await, Duration::from_millis(500));
    let healthy = reader(watch(&server, &name, "").await.unwrap(), Duration::ZERO);
    let mut done = 0;
    while !is_told(&server, "guardsplat_watches_shed_total 1") {
        done += 1;
        assert!(done < 200, "nobody was shed");
        report(&server, &name, &token, done).await;
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    // Its stream is still there, and what it held is not.
    assert!(is_told(&server, "guardsplat_watches 2"));
    assert!(!slow.is_finished() && !healthy.is_finished());
    let (mut cursor, mut seen) = (first.cursor, 0);
    let shed = loop {
        match next(&mut stalled).await {
            Ok(message) => {
                let message = message.expect("ended without a word");
                (cursor, seen) = (message.cursor, message.job.unwrap().progress.unwrap().done);
            }
            Err(status) => break Err::<(), _>(status),
        }
    };
    let details = refused(shed, Code::Unavailable, "WATCH_STALLED");
    assert!(details.retry_info().is_some());
    assert!(seen < done, "{seen} of {done}");
    fail(&server, &name, &token).await;
    // It goes on behind what it has read.
    assert_eq!(
        state(&mut watch(&server, &name, &cursor).await.unwrap()).await,
        State::Failed
    );
    assert_eq!(healthy.await.unwrap().unwrap(), State::Failed);
    assert_eq!(slow.await.unwrap().unwrap(), State::Failed);
    assert!(is_told(&server, "guardsplat_watches_shed_total 1"));
    let left = async {
        while !is_told(&server, "guardsplat_watches 0") {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    };
    tokio::time::timeout(Duration::from_secs(10), left).await.unwrap();
}

#[tokio::test]
async fn a_caller_has_so_many_watches_at_once() {
    let server = Server::with(Limits {
        max_watches: 2,
        ..Limits::default()
    })
    .await;
    let name = server.create(key_spec(8)).await.name;
    let first = watch(&server, &name, "").await.unwrap();
    let _second = watch(&server, &name, "").await.unwrap();
    let details = refused(
        watch(&server, &name, "").await,
        Code::ResourceExhausted,
        "TOO_MANY_WATCHES",
    );
    assert_eq!(details.error_info().unwrap().metadata["limit"], "2");
    drop(first);
    // That it is gone has to be heard first.
    let third = async {
        while watch(&server, &name, "").await.is_err() {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    };
    tokio::time::timeout(Duration::from_secs(10), third).await.unwrap();
}

#[tokio::test]
async fn a_stopping_server_ends_streams() {
    let server = Server::start().await;
    let name = server.create(key_spec(8)).await.name;
    let mut stream = watch(&server, &name, "").await.unwrap();
    assert_eq!(state(&mut stream).await, State::Queued);
    server.api.stop();
    refused(next(&mut stream).await, Code::Unavailable, "STOPPING");
}
