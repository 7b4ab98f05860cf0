//! The server dies and is started again: nothing that it acknowledged is lost, and those who wait go on waiting.
use std::collections::BTreeMap;
use std::fs::File;
use std::sync::{Arc, Mutex};

use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::{CreateJobRequest, Job, KeySpec, ListJobsRequest};
use guardsplat_tests::process::until;
use guardsplat_tests::{Process, Service};
use serde_json::Value;
use tonic::transport::Channel;
use uuid::Uuid;

use crate::{EMBED, KEY, environment, offline};

const SUBMISSIONS: u32 = 50;
/// After so many acknowledged jobs the server is killed.
const ENOUGH: usize = 20;

fn request(number: u32, request_id: Uuid) -> CreateJobRequest {
    let spec = KeySpec {
        bits: 8,
        seed: Some(u64::from(number)),
        ..KeySpec::default()
    };
    CreateJobRequest {
        job: Some(Job {
            display_name: format!("number {number}"),
            spec: Some(Spec::CreateKey(spec)),
            ..Job::default()
        }),
        request_id: request_id.to_string(),
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn acknowledged_jobs_survive_a_kill_and_retries_make_no_others() {
    let mut service = Service::start(guardsplat_tests::TestEnvironment::new(), "");
    let ids: Vec<Uuid> = (0..SUBMISSIONS).map(|_| Uuid::new_v4()).collect();
    let acknowledged = Arc::new(Mutex::new(BTreeMap::new()));
    let mut tasks = Vec::new();
    for (number, id) in (0..).zip(&ids) {
        let (request, acknowledged) = (request(number, *id), Arc::clone(&acknowledged));
        let mut jobs = JobServiceClient::new(service.channel().await);
        tasks.push(tokio::spawn(async move {
            // One after the other more or less, so that the server dies amid them.
            tokio::time::sleep(std::time::Duration::from_millis(u64::from(number) * 4)).await;
            if let Ok(job) = jobs.create_job(request).await {
                acknowledged.lock().unwrap().insert(number, job.into_inner().name);
            }
        }));
    }
    while acknowledged.lock().unwrap().len() < ENOUGH {
        tokio::time::sleep(std::time::Duration::from_millis(1)).await;
    }
    service.kill();
    for task in tasks {
        task.await.unwrap();
    }
    let acknowledged = Arc::into_inner(acknowledged).unwrap().into_inner().unwrap();
    let count = acknowledged.len();
    assert!(
        (ENOUGH..SUBMISSIONS as usize).contains(&count),
        "{count} of {SUBMISSIONS}"
    );

    service.restart();
    let channel = service.channel().await;
    let kept = names(&channel).await;
    for name in acknowledged.values() {
        assert!(kept.contains(name), "{name} was acknowledged and is gone");
    }
    // Everybody who heard nothing asks again; those who did get the job that they have.
    let mut jobs = JobServiceClient::new(channel.clone());
    for (number, id) in (0..).zip(&ids) {
        let job = jobs.create_job(request(number, *id)).await.unwrap().into_inner();
        let known = acknowledged.get(&number);
        assert!(known.is_none_or(|name| *name == job.name), "{known:?} and {}", job.name);
    }
    assert_eq!(names(&channel).await.len(), SUBMISSIONS as usize);
}

async fn names(channel: &Channel) -> Vec<String> {
    let request = ListJobsRequest {
        page_size: 1000,
        ..ListJobsRequest::default()
    };
    let answer = JobServiceClient::new(channel.clone()).list_jobs(request).await;
    answer
        .unwrap()
        .into_inner()
        .jobs
        .into_iter()
        .map(|job| job.name)
        .collect()
}

#[test]
fn work_goes_on_and_is_watched_across_a_restart() {
    let environment = environment();
    offline(&environment, "standard");
    let mut service = Service::start(environment, "");
    let worker = service.worker("steady");
    service.json(KEY, 0);
    let name = service.submit(&format!("{EMBED} standard"));
    service.is_embedding(&name, 1);
    let mut command = service.client_command(&format!("--json jobs watch {name}"));
    let lines = service.environment.path("watched");
    command.stdout(File::create(&lines).unwrap());
    let mut watching = Process::start(&mut command, &service.environment.path("watch.log"));
    let seen = || -> Vec<Value> {
        let text = std::fs::read_to_string(&lines).unwrap();
        // The last line may be half written.
        text.split_inclusive('\n')
            .filter_map(|line| serde_json::from_str(line).ok())
            .collect()
    };
    until("the watch has begun", || (!seen().is_empty()).then_some(()));
    service.kill();
    service.restart();

    assert_eq!(watching.wait().code(), Some(3), "{}", watching.log());
    let seen = seen();
    let last = &seen.last().unwrap()["job"];
    // The worker kept its lease, so this is still the first attempt.
    assert_eq!(
        (&last["state"], &last["attempt"]),
        (&"succeeded".into(), &1.into()),
        "{last}"
    );
    assert_eq!(worker.log().matches("job begins").count(), 2, "{}", worker.log());
    let scene = last["result"]["scene"].as_str().unwrap();
    service.json(&format!("artifact get {scene} -o out.ply"), 0);
    assert!(service.environment.read("out.ply") == service.environment.read("expected.ply"));

    // A cursor of the server before is as good: one message says all that was missed, and a current one says nothing new.
    let cursor = |line: &Value| line["cursor"].as_str().unwrap().to_owned();
    let missed = service.json(&format!("jobs watch {name} --cursor {}", cursor(&seen[0])), 3);
    assert_eq!(missed, *seen.last().unwrap());
}
