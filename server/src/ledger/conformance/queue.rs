//! The order of the queue.
use std::collections::HashSet;
use std::sync::Arc;

use super::super::queue::PATIENCE;
use super::super::{JobId, JobRow, Ledger, NewJob, ResourceRequirements, SeenWorker, WorkerCapabilities, WorkerRow};
use super::Factory;
use super::fixture::*;

pub(crate) async fn first_in_first_out(factory: &dyn Factory) {
    let ledger = factory.open().await;
    assert!(claim(&*ledger, at(0)).await.is_none());
    let mut ids = Vec::new();
    for i in 0..6 {
        ids.push(queue(&*ledger, at(i / 3)).await);
    }
    // A clock that was set back doesn't hold jobs up.
    for id in ids {
        let lease = claim_of(&*ledger, id, at(-1000)).await;
        assert_eq!((lease.job.attempt, lease.job.start_time), (1, Some(at(-1000))));
    }
    assert!(claim(&*ledger, at(10)).await.is_none());
}

pub(crate) async fn positions_count_the_jobs_ahead(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let mut ids = Vec::new();
    for i in 0..3 {
        ids.push(queue(&*ledger, at(i)).await);
    }
    assert_eq!(job(&*ledger, ids[2]).await.queue_position, Some(2));
    assert_eq!(ledger.queue_depth().await.unwrap(), 3);
    claim_of(&*ledger, ids[0], at(5)).await;
    assert_eq!(job(&*ledger, ids[0]).await.queue_position, None);
    assert_eq!(job(&*ledger, ids[2]).await.queue_position, Some(1));
    ledger.cancel_job(ids[1], at(6)).await.unwrap();
    assert_eq!(job(&*ledger, ids[2]).await.queue_position, Some(0));
    assert_eq!(ledger.queue_depth().await.unwrap(), 1);
}

/// Claims until `total` jobs have been given out, by whoever.
async fn claim_many(ledger: Arc<dyn Ledger>, given: Arc<std::sync::Mutex<Vec<JobId>>>, total: usize) {
    while given.lock().unwrap().len() < total {
        if let Some(lease) = claim(&*ledger, at(100)).await {
            given.lock().unwrap().push(lease.job.id);
        } else {
            tokio::task::yield_now().await;
        }
    }
}

pub(crate) async fn many_claims_never_share_a_job(factory: &dyn Factory) {
    const JOBS: usize = 200;
    let ledgers = factory.open_several(4).await;
    let given = Arc::new(std::sync::Mutex::new(Vec::new()));
    let mut tasks = Vec::new();
    for ledger in ledgers.iter().chain(&ledgers) {
        tasks.push(tokio::spawn(claim_many(ledger.clone(), given.clone(), JOBS)));
        let ledger = ledger.clone();
        tasks.push(tokio::spawn(async move {
            for i in 0..JOBS / 8 {
                queue(&*ledger, at(i as i64)).await;
            }
        }));
    }
    for task in tasks {
        task.await.unwrap();
    }
    let given = given.lock().unwrap();
    assert_eq!(given.len(), JOBS);
    assert_eq!(given.iter().collect::<HashSet<_>>().len(), JOBS);
}

/// What is given out next, one after the other, with nothing coming back.
async fn order(ledger: &dyn Ledger, now: i64) -> Vec<JobId> {
    let mut given = Vec::new();
    while let Some(lease) = claim(ledger, now).await {
        given.push(lease.job.id);
    }
    given
}

pub(crate) async fn the_most_urgent_job_goes_first(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let mut ids = Vec::new();
    for (i, priority) in [0, -10, 5, 10, 0].into_iter().enumerate() {
        ids.push(queue_of(&*ledger, OURS, priority, at(i as i64)).await);
    }
    assert_eq!(job(&*ledger, ids[3]).await.priority, 10);
    let expected = [ids[3], ids[2], ids[0], ids[4], ids[1]];
    assert_eq!(ledger.queue().await.unwrap(), expected);
    assert_eq!(order(&*ledger, at(10)).await, expected);
}

pub(crate) async fn projects_take_turns(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let mut bulk = Vec::new();
    for i in 0..6 {
        bulk.push(queue_of(&*ledger, "bulk", 0, at(i)).await);
    }
    let running = claim_of(&*ledger, bulk[0], at(9)).await;
    // Whoever comes late has less running, and goes first; then by turns, the older job first.
    let late = [
        queue_of(&*ledger, "late", 0, at(10)).await,
        queue_of(&*ledger, "late", 0, at(11)).await,
        queue_of(&*ledger, "late", 0, at(12)).await,
    ];
    let expected = [late[0], bulk[1], late[1], bulk[2], late[2], bulk[3], bulk[4], bulk[5]];
    assert_eq!(ledger.queue().await.unwrap(), expected);
    for id in &expected[..3] {
        claim_of(&*ledger, *id, at(13)).await;
    }
    // One that ends makes room for another of its project.
    complete(&*ledger, &running, &[], at(14)).await;
    let expected = [bulk[2], bulk[3], late[2], bulk[4], bulk[5]];
    assert_eq!(ledger.queue().await.unwrap(), expected);
    assert_eq!(order(&*ledger, at(15)).await, expected);
}

/// However many urgent jobs there are, of the others one is begun every now and then, in each lane.
pub(crate) async fn nobody_waits_for_ever(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let patience = PATIENCE.as_secs() as i64;
    let patient = [
        queue_of(&*ledger, OURS, -1, at(0)).await,
        queue_of(&*ledger, OURS, -1, at(1)).await,
    ];
    let other = queue_of(&*ledger, "other", -2, at(2)).await;
    let mut urgent = Vec::new();
    for i in 0..6 {
        urgent.push(queue_of(&*ledger, OURS, 1, at(i)).await);
    }
    claim_of(&*ledger, urgent[0], at(patience - 1)).await;
    claim_of(&*ledger, patient[0], at(patience)).await;
    // One turn, not all of them.
    claim_of(&*ledger, urgent[1], at(patience + 1)).await;
    claim_of(&*ledger, other, at(patience + 2)).await;
    claim_of(&*ledger, urgent[2], at(patience + 2)).await;
    claim_of(&*ledger, urgent[3], at(2 * patience - 1)).await;
    claim_of(&*ledger, patient[1], at(2 * patience)).await;
    claim_of(&*ledger, urgent[4], at(2 * patience)).await;
}

pub(crate) async fn positions_foresee_the_order(factory: &dyn Factory) {
    let ledger = factory.open().await;
    for i in 0..30_i64 {
        let project = ["a", "b", "c"][(i * i % 3) as usize];
        queue_of(&*ledger, project, [0, 5, 0, -3][(i % 4) as usize], at(i / 2)).await;
    }
    for round in 0..8 {
        let queue = ledger.queue().await.unwrap();
        for (place, id) in queue.iter().enumerate() {
            let row = job(&*ledger, *id).await;
            assert_eq!(row.queue_position, Some(place as i64));
            let peeked = ledger.peek_job(*id).await.unwrap().unwrap();
            let without = JobRow {
                queue_position: None,
                ..row
            };
            assert_eq!(peeked, without);
        }
        let first = claim_of(&*ledger, queue[0], at(100)).await;
        claim_of(&*ledger, queue[1], at(100)).await;
        if round % 2 == 0 {
            complete(&*ledger, &first, &[], at(100)).await;
        }
    }
}

pub(crate) async fn a_repeated_job_keeps_its_priority(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let urgent = queue_of(&*ledger, OURS, 1, at(0)).await;
    let other = queue_of(&*ledger, OURS, 0, at(0)).await;
    let lease = claim_of(&*ledger, urgent, at(1)).await;
    let failed = ledger
        .fail(urgent, &lease.token, failure("x"), true, false, at(2))
        .await;
    assert_eq!(failed.unwrap().priority, 1);
    claim_of(&*ledger, urgent, at(60)).await;
    claim_of(&*ledger, other, at(60)).await;
}

pub(crate) async fn a_job_goes_to_a_worker_that_can_hold_it(factory: &dyn Factory) {
    const GIB: i64 = 1 << 30;
    let ledger = factory.open().await;
    let queue_with = async |requirements: ResourceRequirements| {
        let new = NewJob {
            requirements,
            ..new_job()
        };
        ledger.create_job(new, at(0)).await.unwrap().id
    };
    let clip = |name: &str| name.repeat(32);
    let large = ResourceRequirements {
        memory: Some(4 * GIB),
        likely_memory: Some(9 * GIB),
        clip: Some(clip("ab")),
    };
    let large_id = queue_with(large.clone()).await;
    let small_id = queue_with(ResourceRequirements {
        memory: Some(GIB),
        likely_memory: Some(2 * GIB),
        clip: Some(clip("cd")),
    })
    .await;
    assert_eq!(job(&*ledger, large_id).await.requirements, large);
    let capabilities = |memory: i64, likely_memory: Option<i64>, clips: &[&str]| WorkerCapabilities {
        worker: "worker-1".into(),
        memory: Some(memory * GIB),
        likely_memory: likely_memory.map(|bytes| bytes * GIB),
        clips: clips.iter().map(|name| clip(name)).collect(),
    };
    let given = async |capabilities: WorkerCapabilities| {
        let lease = ledger.claim_for(&capabilities, LEASE, at(1)).await.unwrap();
        lease.map(|lease| (lease.job.id, lease.token))
    };
    // Too small for both, or without what their keys need.
    for capabilities in [
        capabilities(0, None, &[]),
        capabilities(1, Some(1), &[]),
        capabilities(8, None, &["ef", "01"]),
    ] {
        assert_eq!(given(capabilities).await, None);
    }
    // The first in line is passed over by those that can't have it, and nothing is counted.
    for capabilities in [
        capabilities(3, None, &[]),
        capabilities(8, Some(8), &[]),
        capabilities(99, None, &["ef", "cd"]),
    ] {
        let (id, token) = given(capabilities).await.unwrap();
        assert_eq!(id, small_id);
        ledger.release(id, &token, at(1)).await.unwrap();
    }
    assert_eq!(job(&*ledger, large_id).await.revision, 1);
    // To the byte.
    assert_eq!(
        given(capabilities(4, Some(9), &["ab", "ef"])).await.unwrap().0,
        large_id
    );
    // Nothing is known of some jobs, nor of some workers.
    let unknown = queue_with(ResourceRequirements::default()).await;
    claim_of(&*ledger, small_id, at(1)).await;
    assert_eq!(given(capabilities(0, Some(0), &["ef"])).await.unwrap().0, unknown);
}

pub(crate) async fn workers_are_seen_for_a_while(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let worker = |name: &str, memory| SeenWorker {
        name: name.into(),
        device: "a GPU".into(),
        version: "1.2.3".into(),
        memory,
        clips: vec!["ab".repeat(32), "cd".repeat(32)],
    };
    let names = async |since: i64| {
        let seen = ledger.workers_since(since).await.unwrap();
        seen.into_iter().map(|worker| worker.name).collect::<Vec<_>>()
    };
    assert_eq!(names(0).await, Vec::<String>::new());
    ledger.note_worker(worker("worker-2", None), at(0)).await.unwrap();
    ledger.note_worker(worker("worker-1", None), at(1)).await.unwrap();
    ledger.note_worker(worker("worker-1", Some(7)), at(5)).await.unwrap();
    assert_eq!(names(at(0)).await, ["worker-1", "worker-2"]);
    assert_eq!(
        ledger.workers_since(at(2)).await.unwrap(),
        [worker("worker-1", Some(7))]
    );
    // One that has a job is there, however long that takes.
    let id = queue(&*ledger, at(6)).await;
    let lease = claim_of(&*ledger, id, at(6)).await;
    assert_eq!(names(at(1000)).await, ["worker-1"]);
    let both = ledger.workers_and_jobs(at(0), 9).await.unwrap();
    let idle = WorkerRow {
        seen: worker("worker-2", None),
        time: at(0),
        has: None,
    };
    assert_eq!((both.len(), &both[1]), (2, &idle));
    assert_eq!((&both[0].seen, both[0].time), (&worker("worker-1", Some(7)), at(5)));
    let has = both[0].has.as_ref().unwrap();
    assert_eq!((has.id, has.attempt, has.start_time), (id, 1, at(6)));
    assert_eq!((has.project.as_str(), has.lease_expires > at(6)), ("default", true));
    assert_eq!(ledger.workers_and_jobs(at(1000), 9).await.unwrap(), both[..1]);
    assert_eq!(ledger.workers_and_jobs(at(0), 1).await.unwrap(), both[..1]);
    // Nor is it forgotten.
    ledger.note_worker(worker("worker-3", None), at(86_406)).await.unwrap();
    assert_eq!(names(0).await, ["worker-1", "worker-3"]);
    complete(&*ledger, &lease, &[], at(1000)).await;
    assert_eq!(names(at(1000)).await, ["worker-3"]);
    ledger.note_worker(worker("worker-3", None), at(86_407)).await.unwrap();
    assert_eq!(names(0).await, ["worker-3"]);
    assert_eq!(ledger.workers_and_jobs(0, 9).await.unwrap()[0].has, None);
}
