//! Many jobs and several workers: all are done, in the order of their priorities, and more workers do more.
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use guardsplat_proto::v1::Job;
use guardsplat_proto::v1::job::State;
use tokio::task::JoinHandle;
use tokio::time::{Duration, Instant, sleep};

use crate::place::{Place, Quantiles, short_or_full};
use crate::stub::Stub;
use crate::support::Server;

/// Jobs that may have been begun before one that is more urgent: claims of the same moment, one a worker.
const AT_ONCE: usize = 8;

fn workers(place: &Place, count: usize, takes: Duration, stop: &Arc<AtomicBool>) -> Vec<JoinHandle<()>> {
    (0..count)
        .map(|i| tokio::spawn(Stub::new(place.caller(), &format!("stub {i}"), takes).serve(stop.clone())))
        .collect()
}

async fn end(workers: Vec<JoinHandle<()>>, stop: &AtomicBool) {
    stop.store(true, Ordering::Relaxed);
    for worker in workers {
        worker.await.unwrap();
    }
}

/// The most memory that the server has had, in MiB.
pub fn peak(server: &Server) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", server.pid())).unwrap_or_default();
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))
        .unwrap_or_default();
    line.split_ascii_whitespace()
        .next()
        .and_then(|kib| kib.parse::<u64>().ok())
        .unwrap_or(0)
        >> 10
}

pub async fn a_thousand_jobs(place: Place) {
    let count = short_or_full(120, 1000);
    let clients = 4;
    let server = place.start(&[]).await;
    let caller = place.caller();
    let inputs = Arc::new(caller.inputs().await);
    let submitting: Vec<_> = (0..clients)
        .map(|client| {
            let (caller, inputs) = (place.caller(), inputs.clone());
            tokio::spawn(async move {
                let (mut names, mut times) = (Vec::new(), Vec::new());
                for i in (client..count).step_by(clients) {
                    let job = Job {
                        priority: Some(i as i32 % 3 - 1),
                        ..inputs.verify()
                    };
                    let begun = Instant::now();
                    names.push(caller.submit(job, "").await.unwrap().name);
                    times.push(begun.elapsed());
                }
                (names, times)
            })
        })
        .collect();
    let (mut names, mut times) = (Vec::new(), Vec::new());
    for task in submitting {
        let (more, took) = task.await.unwrap();
        names.extend(more);
        times.extend(took);
    }
    let begun = Instant::now();
    let stop = Arc::new(AtomicBool::new(false));
    let working = workers(&place, 4, Duration::ZERO, &stop);
    let mut jobs = Vec::new();
    for name in &names {
        jobs.push(caller.reaches(name, State::Succeeded).await);
    }
    let took = begun.elapsed();
    end(working, &stop).await;
    assert!(jobs.iter().all(|job| job.attempt == 1));
    jobs.sort_by_key(|job| job.start_time.map(|time| (time.seconds, time.nanos)));
    let early = |(i, job): (usize, &Job)| jobs[..i].iter().filter(|before| before.priority < job.priority).count();
    let early = jobs.iter().enumerate().map(early).max().unwrap();
    assert!(
        early <= AT_ONCE,
        "{early} jobs were begun before one that is more urgent"
    );
    place.figure(&format!(
        "{count} jobs queued by {clients} clients, 4 workers: all done in {:.1} s, priorities kept; submission {}; the \
         server had {} MiB",
        took.as_secs_f64(),
        Quantiles::of(times),
        peak(&server)
    ));
    server.stop().await;
}

pub async fn more_workers(place: Place) {
    let (each, takes) = short_or_full((4, Duration::from_millis(200)), (40, Duration::from_millis(250)));
    let server = place.start(&[]).await;
    let caller = place.caller();
    let inputs = caller.inputs().await;
    let mut rates = Vec::new();
    for count in [1, 8] {
        let mut names = Vec::new();
        for _ in 0..each * count {
            names.push(caller.submit(inputs.verify(), "").await.unwrap().name);
        }
        let stop = Arc::new(AtomicBool::new(false));
        let begun = Instant::now();
        let working = workers(&place, count, takes, &stop);
        // The last in line is done last, or nearly so.
        while caller.job(names.last().unwrap()).await.unwrap().state() != State::Succeeded {
            sleep(Duration::from_millis(10)).await;
        }
        for name in &names {
            caller.reaches(name, State::Succeeded).await;
        }
        rates.push(names.len() as f64 / begun.elapsed().as_secs_f64());
        end(working, &stop).await;
    }
    let ratio = rates[1] / rates[0];
    place.figure(&format!(
        "jobs of {} ms: {:.2} a second with 1 worker, {:.2} with 8: {ratio:.2} times as many",
        takes.as_millis(),
        rates[0],
        rates[1]
    ));
    // Far below what it is: this machine may be busy with anything.
    assert!(ratio > 3.0, "{ratio}");
    server.stop().await;
}
