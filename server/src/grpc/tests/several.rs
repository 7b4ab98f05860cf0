//! Two servers over one database: what one is told, those who wait at the other hear.
use std::sync::Arc;
use std::time::Duration;

use guardsplat_proto::v1::job::State;
use guardsplat_proto::v1::{
    CancelJobRequest, CreateJobRequest, FailJobRequest, GetJobRequest, Job, LeaseJobRequest, ListJobsRequest,
    ReportJobRequest, WatchJobRequest,
};
use tokio::sync::broadcast::Receiver;
use tokio::time::timeout;
use tonic::{Code, Status};
use uuid::Uuid;

use super::calls::asking;
use super::harness::{Server, key_spec, not_found, refused};
use crate::access::Scope;
use crate::ledger::postgres::tests::Place;
use crate::ledger::postgres::tests::cluster::Cluster;
use crate::ledger::{JobId, PostgresLedger, RemoteChange};
use crate::service::Limits;
use crate::service::changes::{For, Heard};
use crate::service::clock::now;

/// Nobody looks again by themselves before that.
const NEVER: Duration = Duration::from_secs(3600);
/// By then whatever is waited for has happened.
const SOON: Duration = Duration::from_secs(20);

/// Two servers, both of which hear of the other.
async fn two() -> Option<(Place, Server, Server)> {
    let place = Place::fresh().await?;
    let one = Server::over(
        place.ledger().await,
        tempfile::TempDir::new().unwrap(),
        Limits::default(),
        false,
    )
    .await;
    let two = one.twin(place.ledger().await).await;
    for (here, there) in [(&one, &two), (&two, &one)] {
        let mut heard = there.ledger().remote_changes().unwrap();
        let mut tries = 0..100;
        // The first words may be spoken before anybody listens.
        while !hears_a_cancellation(here, &mut heard).await {
            tries.next().expect("nothing is heard");
        }
    }
    Some((place, one, two))
}

/// Makes a job and ends it, and says whether that was heard, so that nothing of it is heard later.
async fn hears_a_cancellation(server: &Server, heard: &mut Receiver<RemoteChange>) -> bool {
    let job = server.create(key_spec(8)).await;
    let name = job.name.clone();
    server.jobs.clone().cancel_job(CancelJobRequest { name }).await.unwrap();
    let ended = RemoteChange::Job {
        id: id(&job),
        queue_grew: false,
        queue_moved: true,
    };
    while let Ok(Ok(news)) = timeout(SOON / 100, heard.recv()).await {
        if news == ended {
            return true;
        }
    }
    false
}

fn id(job: &Job) -> JobId {
    job.name.strip_prefix("jobs/").unwrap().parse().unwrap()
}

#[tokio::test]
async fn who_waits_at_one_server_hears_what_another_is_told() {
    let Some((_place, one, two)) = two().await else { return };
    // Workers.
    let mut waiting = two.api.changes().listen();
    let job = one.create(key_spec(8)).await;
    let heard = timeout(SOON, waiting.wait(For::Work, NEVER)).await;
    assert_eq!(heard.expect("a worker hears nothing").unwrap(), Heard::It);
    // Watchers of the job, and of those behind it.
    let behind = two.create(key_spec(8)).await;
    let (mut of_it, mut of_place) = (two.api.changes().listen(), two.api.changes().listen());
    let (leased, _) = one.take().await;
    assert_eq!(leased.name, job.name);
    let heard = timeout(SOON, of_it.wait(For::Job(id(&job)), NEVER)).await;
    assert_eq!(heard.expect("a watcher hears nothing").unwrap(), Heard::It);
    let heard = timeout(SOON, of_place.wait(For::QueuedJob(id(&behind)), NEVER)).await;
    assert_eq!(heard.expect("those behind hear nothing").unwrap(), Heard::Moved);
}

#[tokio::test]
async fn a_job_goes_its_way_through_two_servers() {
    let Some((_place, one, two)) = two().await else { return };
    let request = LeaseJobRequest {
        worker: "test".into(),
        wait: Some(prost_types::Duration { seconds: 30, nanos: 0 }),
        ..LeaseJobRequest::default()
    };
    let mut worker = two.worker.clone();
    let waiting = tokio::spawn(async move { worker.lease_job(request).await });
    let job = one.create(key_spec(8)).await;
    let request = WatchJobRequest {
        name: job.name.clone(),
        cursor: String::new(),
    };
    let mut watched = one.jobs.clone().watch_job(request).await.unwrap().into_inner();
    let lease = timeout(SOON, waiting).await.unwrap().unwrap().unwrap().into_inner();
    assert_eq!(lease.job.unwrap().name, job.name);
    let request = CancelJobRequest { name: job.name.clone() };
    one.jobs.clone().cancel_job(request).await.unwrap();
    let request = FailJobRequest {
        name: job.name.clone(),
        lease_token: lease.lease_token,
        cancelled: true,
        ..Default::default()
    };
    two.worker.clone().fail_job(request).await.unwrap();
    loop {
        let message = timeout(SOON, watched.message()).await.unwrap().unwrap();
        if message.unwrap().job.unwrap().state() == State::Cancelled {
            break;
        }
    }
    assert_eq!(two.job(&job.name).await, one.job(&job.name).await);
}

/// Tokens and projects are the database's: what one server is told of them holds at the next call of another.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_token_is_good_at_every_server_until_one_revokes_it() {
    let Some(place) = Place::fresh().await else { return };
    let folder = tempfile::TempDir::new().unwrap();
    let one = Server::over(place.ledger().await, folder, Limits::default(), true).await;
    let two = one.twin(place.ledger().await).await;
    let studio = one.token("studio", &[Scope::Embed]).await;
    let other = one.token("other", &[Scope::Embed, Scope::Verify]).await;
    let wanted = CreateJobRequest {
        job: Some(Job {
            spec: Some(key_spec(8)),
            ..Job::default()
        }),
        request_id: Uuid::now_v7().to_string(),
    };
    let [mut here, mut there] = [&one, &two].map(|server| server.jobs.clone());
    let made = here
        .create_job(asking(&studio, wanted.clone()))
        .await
        .unwrap()
        .into_inner();
    let name = GetJobRequest {
        name: made.name.clone(),
    };
    assert_eq!(
        there.get_job(asking(&studio, name.clone())).await.unwrap().into_inner(),
        made
    );
    not_found(there.get_job(asking(&other, name)).await);
    // The id of a request is its project's.
    let again = there
        .create_job(asking(&studio, wanted.clone()))
        .await
        .unwrap()
        .into_inner();
    assert_eq!(again.name, made.name);
    let theirs = there.create_job(asking(&other, wanted)).await.unwrap().into_inner();
    assert_ne!(theirs.name, made.name);
    let list = async |server: &Server, token: &str| {
        let jobs = server
            .jobs
            .clone()
            .list_jobs(asking(token, ListJobsRequest::default()))
            .await?;
        Ok::<_, Status>(
            jobs.into_inner()
                .jobs
                .into_iter()
                .map(|job| job.name)
                .collect::<Vec<_>>(),
        )
    };
    for server in [&one, &two] {
        assert_eq!(list(server, &studio).await.unwrap(), std::slice::from_ref(&made.name));
        assert_eq!(list(server, &other).await.unwrap(), std::slice::from_ref(&theirs.name));
    }
    let row = &one.ledger().list_tokens(Some("studio"), None, 2).await.unwrap()[0];
    one.ledger().revoke_token(row.id, now()).await.unwrap();
    refused(list(&two, &studio).await, Code::Unauthenticated, "TOKEN_REVOKED");
}

/// While the database is away nobody's report can be written, and nobody is to lose a lease for that.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn leases_outlast_the_absence_of_the_database() {
    let Some(cluster) = Cluster::start() else { return };
    cluster.create("ledger", None);
    let ledger = PostgresLedger::open(&cluster.url("ledger").into()).await.unwrap();
    let limits = Limits {
        lease: Duration::from_secs(4),
        ..Limits::default()
    };
    let server = Server::over(Arc::new(ledger), tempfile::TempDir::new().unwrap(), limits, false).await;
    let name = server.create(key_spec(8)).await.name;
    let (_, token) = server.take().await;
    cluster.stop();
    tokio::time::sleep(Duration::from_secs(6)).await;
    cluster.resume();
    // Two looks after leases later.
    tokio::time::sleep(Duration::from_secs(3)).await;
    let request = ReportJobRequest {
        name: name.clone(),
        lease_token: token,
        progress: None,
    };
    server.worker.clone().report_job(request).await.unwrap();
    let job = server.job(&name).await;
    assert_eq!((job.state(), job.attempt), (State::Running, 1));
}
