//! A server that is killed, `kill -9`, while jobs are submitted: what it acknowledged is there, and what is asked for
//! again is the same job.
use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex};

use guardsplat_proto::v1::Job;
use guardsplat_proto::v1::KeySpec;
use guardsplat_proto::v1::job::Spec;
use tokio::time::{Duration, Instant, sleep};
use uuid::Uuid;

use crate::caller::persist;
use crate::place::{Place, short_or_full};

const CLIENTS: usize = 4;
const EACH: usize = 8;

fn job() -> Job {
    Job {
        spec: Some(Spec::CreateKey(KeySpec {
            bits: 8,
            seed: None,
            ..KeySpec::default()
        })),
        ..Job::default()
    }
}

pub async fn amid_submissions(place: Place) {
    let kills = short_or_full(4, 200);
    let (mut acknowledged, mut asked, mut names) = (0, 0, HashSet::new());
    let mut restarts = Vec::new();
    for round in 0..kills {
        let begun = Instant::now();
        let server = place.start(&[]).await;
        restarts.push(begun.elapsed());
        let known: Arc<Mutex<HashMap<Uuid, Option<String>>>> = Arc::default();
        let clients: Vec<_> = (0..CLIENTS)
            .map(|_| {
                let (caller, known) = (place.caller(), known.clone());
                tokio::spawn(async move {
                    for _ in 0..EACH {
                        let id = Uuid::new_v4();
                        known.lock().unwrap().insert(id, None);
                        let Ok(job) = caller.submit(job(), &id.to_string()).await else {
                            return;
                        };
                        known.lock().unwrap().insert(id, Some(job.name));
                    }
                })
            })
            .collect();
        // After the first answer in one round, and late in another.
        let answered = || known.lock().unwrap().values().flatten().count();
        while answered() <= round % (CLIENTS * EACH / 2) {
            sleep(Duration::from_micros(200)).await;
        }
        server.kill().await;
        for client in clients {
            client.await.unwrap();
        }
        let known = Arc::into_inner(known).unwrap().into_inner().unwrap();
        // The next server is killed too, later.
        let server = place.start(&[]).await;
        let caller = place.caller();
        for (id, name) in known {
            asked += 1;
            let again = persist(|| async { caller.submit(job(), &id.to_string()).await })
                .await
                .unwrap();
            if let Some(name) = name {
                acknowledged += 1;
                assert_eq!(again.name, name, "a request that was acknowledged made another job");
            }
            assert!(names.insert(again.name.clone()), "two requests have one job");
            let there = persist(|| caller.job(&again.name)).await.unwrap();
            assert_eq!(there.name, again.name);
        }
        server.kill().await;
    }
    let server = place.start(&[]).await;
    let caller = place.caller();
    // All of them, after all that was killed since.
    for name in &names {
        assert_eq!(&caller.job(name).await.unwrap().name, name);
    }
    place.figure(&format!(
        "{kills} kills amid submissions, and as many after them: {acknowledged} of {acknowledged} acknowledged jobs there, {asked} requests are {} jobs; \
         a start takes {}",
        names.len(),
        crate::place::Quantiles::of(restarts)
    ));
    server.stop().await;
}
