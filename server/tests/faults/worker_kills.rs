//! Workers that are killed, `kill -9`: real processes, at every point of their work.
use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use guardsplat_proto::v1::Job;
use guardsplat_proto::v1::job::{Result as Outcome, State};
use tokio::time::{Duration, Instant, sleep};

use crate::place::{Place, short_or_full};
use crate::stub::{self, POINTS, marked};
use crate::support::SOON;

const WORKERS: usize = 4;

/// Starts one after the other until told to stop, as an init would, and counts those that were killed.
async fn supervise(url: String, name: String, graves: PathBuf, stop: Arc<AtomicBool>, killed: Arc<AtomicUsize>) {
    while !stop.load(Ordering::Relaxed) {
        let mut child = stub::spawn(&url, &name, &graves);
        let status = loop {
            if stop.load(Ordering::Relaxed) {
                break None;
            }
            if let Some(status) = child.try_wait().unwrap() {
                break Some(status);
            }
            sleep(Duration::from_millis(5)).await;
        };
        if let Some(status) = status {
            assert_eq!(status.signal(), Some(9), "a stub ended by itself: {status}");
            killed.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// Every job is done in the end, and what is published is whole and of the one attempt that was completed.
pub async fn at_every_point(place: Place) {
    let seeds = short_or_full(1, 20);
    let flags = [
        "--lease-seconds",
        "2",
        "--max-attempts",
        "10",
        "--abandoned-after-seconds",
        "3",
    ];
    let server = place.start(&flags).await;
    let caller = place.caller();
    let inputs = caller.inputs().await;
    let mut jobs = Vec::new();
    for seed in 0..seeds {
        for point in POINTS {
            let job = Job {
                display_name: format!("{point}; seed {seed}"),
                ..inputs.embed()
            };
            jobs.push(caller.submit(job, "").await.unwrap().name);
        }
    }
    let graves = place.bench.data().join("../graves");
    fs::create_dir(&graves).unwrap();
    let begun = Instant::now();
    let (stop, killed) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicUsize::new(0)));
    let workers: Vec<_> = (0..WORKERS)
        .map(|i| {
            let name = format!("stub {i}");
            tokio::spawn(supervise(
                place.url(),
                name,
                graves.clone(),
                stop.clone(),
                killed.clone(),
            ))
        })
        .collect();
    for name in &jobs {
        let job = caller.reaches(name, State::Succeeded).await;
        let Some(Outcome::EmbedResult(result)) = &job.result else {
            panic!("{job:?}")
        };
        let scene = caller.download(&result.scene).await.unwrap();
        assert!(
            scene == marked(&job),
            "{}: not what attempt {} made",
            job.display_name,
            job.attempt
        );
    }
    let took = begun.elapsed();
    // The last of them die after their job is done.
    let begun = Instant::now();
    while killed.load(Ordering::Relaxed) < jobs.len() {
        assert!(begun.elapsed() < SOON, "only {killed:?} were killed");
        sleep(Duration::from_millis(10)).await;
    }
    stop.store(true, Ordering::Relaxed);
    for worker in workers {
        worker.await.unwrap();
    }
    let killed = killed.load(Ordering::Relaxed);
    assert_eq!(
        (killed, fs::read_dir(&graves).unwrap().count()),
        (jobs.len(), jobs.len())
    );
    // Of every other attempt nothing is left: a key, an upload, and two outputs of each job are all there is, beside what
    // says whose artifacts these are.
    let files = || {
        place
            .bench
            .kept()
            .iter()
            .filter(|path| path.to_string_lossy().contains("/artifacts/"))
            .filter(|path| !path.ends_with("artifacts/ledger") && !path.ends_with("artifacts/generation"))
            .count()
    };
    let begun = Instant::now();
    while files() != 2 + 2 * jobs.len() {
        assert!(begun.elapsed() < 2 * SOON, "{} files", files());
        sleep(Duration::from_millis(100)).await;
    }
    place.figure(&format!(
        "{killed} workers killed at {} points, {} jobs done by {WORKERS} processes in {:.0} s, each published once",
        POINTS.len(),
        jobs.len(),
        took.as_secs_f64()
    ));
    server.stop().await;
}
