//! The server as a process: it starts, answers, looks after its worker, stops in good order, and starts again.
mod backup;
mod deploy;
mod flow;
mod hooks;
mod stores;
mod support;
mod tls;
mod tokens;
mod watched;

use std::os::unix::process::ExitStatusExt;
use std::time::Duration;

use guardsplat_proto::v1::artifact_service_client::ArtifactServiceClient;
use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::upload_artifact_request::Payload;
use guardsplat_proto::v1::{
    CreateJobRequest, GetArtifactRequest, Job, KeySpec, ListJobsRequest, UploadArtifactRequest, UploadMetadata,
};
use nix::sys::signal::Signal;
use sha2::{Digest, Sha256};
use support::postgres::Cluster;
use support::{Bench, SOON, until};
use tokio::time::timeout;
use tonic::Code;
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;
use tonic_reflection::pb::v1::ServerReflectionRequest;
use tonic_reflection::pb::v1::server_reflection_client::ServerReflectionClient;
use tonic_reflection::pb::v1::server_reflection_request::MessageRequest;
use tonic_reflection::pb::v1::server_reflection_response::MessageResponse;

fn asks(service: &str) -> HealthCheckRequest {
    HealthCheckRequest {
        service: service.into(),
    }
}

#[tokio::test]
async fn answers_for_its_health_and_describes_itself() {
    let bench = Bench::new();
    let server = bench.start().await;
    let channel = server.channel().await;
    let mut health = HealthClient::new(channel.clone());
    for service in ["", "guardsplat.v1.JobService", "guardsplat.v1.WorkerService"] {
        let status = health.check(asks(service)).await.unwrap().into_inner().status();
        assert_eq!(status, ServingStatus::Serving, "{service}");
    }
    assert_eq!(
        health.check(asks("no.such.Service")).await.unwrap_err().code(),
        Code::NotFound
    );

    let request = ServerReflectionRequest {
        host: String::new(),
        message_request: Some(MessageRequest::ListServices(String::new())),
    };
    let mut reflection = ServerReflectionClient::new(channel);
    let mut answers = reflection
        .server_reflection_info(tokio_stream::once(request))
        .await
        .unwrap()
        .into_inner();
    let answer = answers.message().await.unwrap().unwrap().message_response;
    let Some(MessageResponse::ListServicesResponse(list)) = answer else {
        panic!("{answer:?}")
    };
    let names: Vec<_> = list.service.iter().map(|service| service.name.as_str()).collect();
    for name in [
        "JobService",
        "ArtifactService",
        "KeyService",
        "RegistryService",
        "WorkerService",
    ] {
        assert!(names.contains(&format!("guardsplat.v1.{name}").as_str()), "{names:?}");
    }
    assert!(names.contains(&"grpc.health.v1.Health"), "{names:?}");
    assert_eq!(server.stop().await.code(), Some(0));
}

/// What was acknowledged is there after a stop, and after a kill.
#[tokio::test]
async fn keeps_what_it_acknowledged() {
    let bench = Bench::new();
    let server = bench.start().await;
    let data = vec![7; 100_000];
    let metadata = UploadMetadata {
        display_name: "scene.ply".into(),
        size_bytes: data.len() as i64,
        sha256: hex::encode(Sha256::digest(&data)),
    };
    let parts = [Payload::Metadata(metadata), Payload::Chunk(data)];
    let parts = parts.map(|payload| UploadArtifactRequest { payload: Some(payload) });
    let mut artifacts = ArtifactServiceClient::new(server.channel().await);
    let artifact = artifacts
        .upload_artifact(tokio_stream::iter(parts))
        .await
        .unwrap()
        .into_inner();
    assert_eq!(server.kill().await.signal(), Some(Signal::SIGKILL as i32));

    let server = bench.start().await;
    let mut artifacts = ArtifactServiceClient::new(server.channel().await);
    let request = GetArtifactRequest {
        name: artifact.name.clone(),
    };
    assert_eq!(artifacts.get_artifact(request).await.unwrap().into_inner(), artifact);
    assert_eq!(server.stop().await.code(), Some(0));
}

#[tokio::test]
async fn one_data_folder_has_one_server() {
    let bench = Bench::new();
    let server = bench.start().await;
    let (status, text) = bench.fails(&[]).await;
    assert_eq!(status.code(), Some(1));
    assert!(text.contains("is in use by another server"), "{text}");
    server.stop().await;
    bench.start().await.stop().await;
}

#[tokio::test]
async fn says_why_it_does_not_start() {
    let bench = Bench::new();
    let server = bench.start().await;
    let other = Bench::new();
    for (arguments, expected) in [
        (
            vec!["--max-attempts", "0"],
            "setting max_attempts: 0 is not between 1 and 100",
        ),
        (vec!["--listen", server.address()], "listening on 127.0.0.1:"),
        (vec!["--config", "/nowhere.toml"], "/nowhere.toml"),
        (
            vec!["--embedded-worker", "true", "--worker-binary", "/nowhere"],
            "/nowhere is not there",
        ),
        (vec!["--master-key-file", "/nowhere.key"], "/nowhere.key: No such file"),
    ] {
        let (status, text) = other.fails(&arguments).await;
        assert_eq!(status.code(), Some(1), "{text}");
        assert!(text.starts_with("error: ") && text.contains(expected), "{text}");
    }
    server.stop().await;
}

#[tokio::test]
async fn the_worker_is_told_where_the_server_is_and_restarted() {
    let bench = Bench::new();
    let server = bench.start_with_worker("echo \"$@\" >> $LOG; exit 1").await;
    let log = until(|| bench.log(), |log| log.lines().count() >= 2).await;
    let start = format!(
        "run --server http://{} --stop-with-stdin --device cpu --name embedded-",
        server.address()
    );
    assert!(log.lines().all(|line| line.starts_with(&start)), "{log}");
    assert_eq!(server.stop().await.code(), Some(0));
}

/// While the worker hands back its job the server says that it is going, and still answers.
#[tokio::test]
async fn stops_in_good_order() {
    let bench = Bench::new();
    let script =
        "trap 'echo asked >> $LOG; while [ ! -e $LOG.go ]; do sleep 0.02; done; echo done >> $LOG; exit 0' TERM
        echo ready >> $LOG; while :; do sleep 0.02; done";
    let server = bench.start_with_worker(script).await;
    until(|| bench.log(), |log| log == "ready\n").await;
    let channel = server.channel().await;
    let mut health = HealthClient::new(channel.clone());
    let mut watched = health.watch(asks("")).await.unwrap().into_inner();
    assert_eq!(
        watched.message().await.unwrap().unwrap().status(),
        ServingStatus::Serving
    );

    server.signal(Signal::SIGTERM);
    until(|| bench.log(), |log| log == "ready\nasked\n").await;
    assert_eq!(
        watched.message().await.unwrap().unwrap().status(),
        ServingStatus::NotServing
    );
    assert_eq!(
        health.check(asks("")).await.unwrap().into_inner().status(),
        ServingStatus::NotServing
    );
    JobServiceClient::new(channel)
        .list_jobs(ListJobsRequest::default())
        .await
        .unwrap();
    // Nobody is cut off: the stream ends when the server has nothing more to say.
    std::fs::write(bench.log_path().with_extension("go"), "").unwrap();
    assert!(watched.message().await.unwrap().is_none());
    assert_eq!(server.ended().await.code(), Some(0));
    assert_eq!(bench.log(), "ready\nasked\ndone\n");
}

#[tokio::test]
async fn a_stop_takes_only_so_long() {
    let bench = Bench::new();
    let script = "trap '' TERM; echo ready >> $LOG; while :; do sleep 0.02; done";
    let server = bench.start_with_worker(script).await;
    until(|| bench.log(), |log| log == "ready\n").await;
    let begin = std::time::Instant::now();
    assert_eq!(server.stop().await.code(), Some(0));
    // Two seconds are allowed.
    assert!(
        begin.elapsed() > Duration::from_millis(1900) && begin.elapsed() < SOON,
        "{:?}",
        begin.elapsed()
    );
}

#[tokio::test]
async fn a_killed_server_takes_its_worker_with_it() {
    let bench = Bench::new();
    let server = bench
        .start_with_worker("echo ready >> $LOG; cat; echo end of input >> $LOG")
        .await;
    until(|| bench.log(), |log| log == "ready\n").await;
    server.kill().await;
    until(|| bench.log(), |log| log == "ready\nend of input\n").await;
}

/// The master key is nowhere but in its file: not in the log, whatever is logged, and not with the worker.
#[tokio::test]
async fn the_master_key_stays_secret() {
    let digits = "5ec2e75ec2e75ec2e75ec2e75ec2e75ec2e75ec2e75ec2e75ec2e75ec2e75ec2";
    let mut bench = Bench::new();
    bench.variable("GUARDSPLAT_MASTER_KEY", digits);
    bench.variable("GUARDSPLAT_LOG_FILTER", "trace");
    let server = bench.start_with_worker("env >> $LOG; echo ready >> $LOG; cat").await;
    let log = until(|| bench.log(), |log| log.ends_with("ready\n")).await;
    assert!(!log.contains("5ec2e7"), "{log}");
    assert_eq!(server.stop().await.code(), Some(0));
    let text = bench.server_log();
    assert!(text.contains("opened") && !text.contains("5ec2e7"));
    assert!(!bench.data().join("master.key").exists());
}

/// Two servers over one database, and neither tells anybody its password.
#[tokio::test]
async fn servers_share_a_database() {
    let Some(cluster) = Cluster::start() else { return };
    cluster.create("ledger", None);
    let url = format!("{}&password=5ec2e7", cluster.url("ledger"));
    let mut benches = [Bench::new(), Bench::new()];
    for bench in &mut benches {
        bench.variable("GUARDSPLAT_DATABASE", &url);
        bench.variable("GUARDSPLAT_MASTER_KEY", &"ab".repeat(32));
        bench.variable("GUARDSPLAT_LOG_FILTER", "trace");
    }
    let script = "env >> $LOG; echo ready >> $LOG; cat";
    let (one, two) = (benches[0].start_with_worker(script).await, benches[1].start().await);
    let log = until(|| benches[0].log(), |log| log.ends_with("ready\n")).await;
    assert!(!log.contains("5ec2e7"), "{log}");
    let spec = Some(Spec::CreateKey(KeySpec {
        bits: 8,
        seed: None,
        ..KeySpec::default()
    }));
    let job = Some(Job { spec, ..Job::default() });
    let request = CreateJobRequest {
        job,
        request_id: String::new(),
    };
    let mut jobs = JobServiceClient::new(one.channel().await);
    let job = jobs.create_job(request).await.unwrap().into_inner();
    assert_eq!(one.kill().await.signal(), Some(Signal::SIGKILL as i32));

    let channel = two.channel().await;
    let (mut jobs, mut health) = (JobServiceClient::new(channel.clone()), HealthClient::new(channel));
    let list = jobs.list_jobs(ListJobsRequest::default()).await.unwrap().into_inner();
    assert_eq!(list.jobs, [job]);
    // The database goes away, and comes back; the server says so, and goes on.
    let mut watched = health.watch(asks("")).await.unwrap().into_inner();
    let mut says = async |wanted: ServingStatus| {
        let told = timeout(SOON, watched.message()).await.expect("nothing is told");
        assert_eq!(told.unwrap().unwrap().status(), wanted);
    };
    says(ServingStatus::Serving).await;
    cluster.stop();
    let refused = jobs.list_jobs(ListJobsRequest::default()).await.unwrap_err();
    assert_eq!(
        (refused.code(), refused.message()),
        (Code::Unavailable, "the ledger is not available")
    );
    says(ServingStatus::NotServing).await;
    cluster.resume();
    says(ServingStatus::Serving).await;
    assert_eq!(
        jobs.list_jobs(ListJobsRequest::default()).await.unwrap().into_inner(),
        list
    );
    assert_eq!(two.stop().await.code(), Some(0));
    for bench in &benches {
        let text = bench.server_log();
        assert!(
            text.contains("the ledger is in a database") && !text.contains("5ec2e7"),
            "{text}"
        );
        assert!(!bench.data().join("ledger.sqlite").exists());
    }
}

#[tokio::test]
async fn a_stop_is_heard_while_the_database_is_waited_for() {
    let bench = Bench::new();
    let server = bench.begin(&["--database", "postgres://127.0.0.1:1/ledger"]);
    until(
        || bench.server_log(),
        |log| log.contains("can't be reached; trying again"),
    )
    .await;
    assert_eq!(server.stop().await.code(), Some(0));
}
