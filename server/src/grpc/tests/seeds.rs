//! The seed of a key, from which all of it follows: nobody is told, and it lies nowhere as it is.
use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::{GetJobRequest, Job, KeySpec, ListJobsRequest, WatchJobRequest};
use uuid::Uuid;

use super::harness::Server;
use crate::ledger::{KeyOrder, Seed};
use crate::service::{Limits, seeds};

const SEED: u64 = 0x5eed_5eed_5eed_5eed;

fn told(job: &Job) -> Option<u64> {
    match &job.spec {
        Some(Spec::CreateKey(spec)) => spec.seed,
        other => panic!("{other:?}"),
    }
}

/// Whether the seed is in the files of the ledger as it is, or as messages encode it. What is sealed is neither.
fn lies_there(server: &Server) -> bool {
    let mut encoded = Vec::new();
    prost::encoding::encode_varint(SEED, &mut encoded);
    let forms = [encoded, SEED.to_be_bytes().to_vec(), SEED.to_le_bytes().to_vec()];
    let holds = |bytes: &Vec<u8>| {
        forms
            .iter()
            .any(|form| bytes.windows(form.len()).any(|part| part == &form[..]))
    };
    server.ledger_files().iter().any(holds)
}

/// A job that makes a key from the seed.
fn asked() -> Job {
    Job {
        spec: Some(Spec::CreateKey(KeySpec {
            bits: 64,
            seed: Some(SEED),
            ..KeySpec::default()
        })),
        ..Job::default()
    }
}

#[tokio::test]
async fn a_seed_is_told_to_the_worker_only() {
    let server = Server::start().await;
    let request = Uuid::new_v4().to_string();
    let made = server.submit(asked(), &request).await.unwrap().into_inner();
    let again = server.submit(asked(), &request).await.unwrap().into_inner();
    assert_eq!((&again.name, told(&made), told(&again)), (&made.name, None, None));
    let mut jobs = server.jobs.clone();
    let name = made.name.clone();
    let got = jobs
        .get_job(GetJobRequest { name: name.clone() })
        .await
        .unwrap()
        .into_inner();
    let list = jobs.list_jobs(ListJobsRequest::default()).await.unwrap().into_inner();
    let cursor = String::new();
    let mut watch = jobs
        .watch_job(WatchJobRequest { name, cursor })
        .await
        .unwrap()
        .into_inner();
    let watched = watch.message().await.unwrap().unwrap().job.unwrap();
    for job in [&got, &list.jobs[0], &watched] {
        assert_eq!(told(job), None);
    }
    let (leased, _) = server.take().await;
    assert_eq!((&leased.name, told(&leased)), (&made.name, Some(SEED)));
    assert!(!lies_there(&server));
}

/// Jobs of a version that kept seeds as they were told, in a ledger that it left.
#[tokio::test]
async fn seeds_of_before_are_sealed_at_the_start() {
    let server = Server::start().await;
    let request = Uuid::new_v4().to_string();
    let made = server.submit(asked(), &request).await.unwrap().into_inner().name;
    let id = Uuid::try_parse(made.trim_start_matches("jobs/")).unwrap();
    let ledger = server.ledger();
    let as_before = KeyOrder {
        bits: 64,
        seed: Some(Seed::Open(SEED)),
    };
    ledger.seal_seed(id, as_before.clone(), [7; 32]).await.unwrap();
    assert_eq!(ledger.open_seeds().await.unwrap(), [(id, as_before)]);
    assert!(lies_there(&server));

    assert_eq!(seeds::seal_all(ledger.as_ref(), server.api.master()).await.unwrap(), 1);
    assert_eq!(ledger.open_seeds().await.unwrap(), []);
    assert_eq!(seeds::seal_all(ledger.as_ref(), server.api.master()).await.unwrap(), 0);
    // Begun anew, so that what was written ahead is in the file.
    drop(ledger);
    let server = server.restart(Limits::default()).await;
    assert!(!lies_there(&server));
    let (leased, _) = server.take().await;
    assert_eq!((&leased.name, told(&leased)), (&made, Some(SEED)));
}
