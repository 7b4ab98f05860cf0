//! The database goes away amid work, and comes back: all jobs finish, and nobody does anything for it.
//!
//! PostgreSQL is stopped and started. SQLite is a file; what comes nearest is another program that keeps it locked.
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use guardsplat_proto::v1::job::State;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{Connection, SqliteConnection};
use tokio::time::{Duration, Instant, sleep};

use crate::caller::persist;
use crate::place::{Place, full};
use crate::stub::Stub;

const WORKERS: usize = 4;
const JOBS: usize = 16;

/// Keeps the database away for so long.
async fn away(place: &Place, long: Duration) {
    if let Some(cluster) = place.cluster {
        cluster.stop();
        sleep(long).await;
        cluster.resume();
        return;
    }
    let file = SqliteConnectOptions::new()
        .filename(place.bench.data().join("ledger.sqlite"))
        .busy_timeout(Duration::from_secs(10));
    let mut db = SqliteConnection::connect_with(&file).await.unwrap();
    sqlx::query("BEGIN EXCLUSIVE").execute(&mut db).await.unwrap();
    sleep(long).await;
    sqlx::query("ROLLBACK").execute(&mut db).await.unwrap();
    db.close().await.unwrap();
}

pub async fn the_database(place: Place) {
    // The others' is not to go away.
    let place = match place.cluster {
        Some(_) => Place::on_postgres_alone().unwrap(),
        None => place,
    };
    let server = place.start(&[]).await;
    let caller = place.caller();
    let inputs = caller.inputs().await;
    let times: &[u64] = if full() { &[5, 60] } else { &[3] };
    for &seconds in times {
        let stop = Arc::new(AtomicBool::new(false));
        let workers: Vec<_> = (0..WORKERS)
            .map(|i| {
                let stub = Stub::new(place.caller(), &format!("stub {i}"), Duration::from_millis(1500));
                tokio::spawn(stub.serve(stop.clone()))
            })
            .collect();
        let mut names = Vec::new();
        for _ in 0..JOBS {
            names.push(caller.submit(inputs.embed(), "").await.unwrap().name);
        }
        sleep(Duration::from_millis(500)).await;
        // Others go on asking for jobs, under an id, as one should.
        let submitting = {
            let (caller, job) = (place.caller(), inputs.embed());
            tokio::spawn(async move {
                let mut names = Vec::new();
                for _ in 0..4 {
                    let id = uuid::Uuid::new_v4().to_string();
                    let made = persist(|| caller.submit(job.clone(), &id)).await;
                    names.push(made.unwrap().name);
                    sleep(Duration::from_millis(300)).await;
                }
                names
            })
        };
        away(&place, Duration::from_secs(seconds)).await;
        let begun = Instant::now();
        names.extend(submitting.await.unwrap());
        let mut again = 0;
        for name in &names {
            let job = caller.reaches(name, State::Succeeded).await;
            again += usize::from(job.attempt > 1);
        }
        let took = begun.elapsed();
        stop.store(true, Ordering::Relaxed);
        for worker in workers {
            worker.await.unwrap();
        }
        place.figure(&format!(
            "away for {seconds} s amid {} jobs of 1.5 s, {WORKERS} workers: all done {:.1} s after it came back, {again} of \
             them in more than one attempt",
            names.len(),
            took.as_secs_f64()
        ));
    }
    server.stop().await;
}
