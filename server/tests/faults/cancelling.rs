//! Jobs that are cancelled while they run end soon, and what is over never changes again.
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use guardsplat_proto::v1::job::State;
use guardsplat_proto::v1::{CancelJobRequest, FailJobRequest, Failure, Job, failure::Reason};
use tokio::time::{Duration, Instant, sleep};
use tonic::Code;

use crate::caller::Caller;
use crate::place::{Place, Quantiles, short_or_full};
use crate::stub::{self, Stub};
use crate::zombies::says_everything;

const WORKERS: usize = 4;

pub async fn cancel(caller: &Caller, name: &str) -> Result<Job, tonic::Status> {
    let request = CancelJobRequest { name: name.into() };
    Ok(caller.jobs.clone().cancel_job(request).await?.into_inner())
}

async fn fail(caller: &Caller, job: &Job, token: &str, cancelled: bool) {
    let failure = Failure {
        reason: Reason::InvalidInput.into(),
        message: "no such row".into(),
    };
    let request = FailJobRequest {
        name: job.name.clone(),
        lease_token: token.into(),
        failure: (!cancelled).then_some(failure),
        retryable: false,
        cancelled,
        ..FailJobRequest::default()
    };
    caller.worker.clone().fail_job(request).await.unwrap();
}

pub async fn ends_soon(place: Place) {
    let count = short_or_full(8, 100);
    let server = place.start(&[]).await;
    let caller = place.caller();
    let inputs = caller.inputs().await;
    let stop = Arc::new(AtomicBool::new(false));
    let workers: Vec<_> = (0..WORKERS)
        .map(|i| {
            let stub = Stub::new(place.caller(), &format!("stub {i}"), Duration::from_secs(600));
            tokio::spawn(stub.serve(stop.clone()))
        })
        .collect();
    let (mut times, mut over) = (Vec::new(), Vec::new());
    for _ in 0..count {
        let name = caller.submit(inputs.embed(), "").await.unwrap().name;
        caller.reaches(&name, State::Running).await;
        let begun = Instant::now();
        cancel(&caller, &name).await.unwrap();
        while caller.job(&name).await.unwrap().state() != State::Cancelled {
            assert!(begun.elapsed() < Duration::from_secs(60), "{name} goes on");
            sleep(Duration::from_millis(5)).await;
        }
        times.push(begun.elapsed());
        over.push(caller.job(&name).await.unwrap());
    }
    stop.store(true, Ordering::Relaxed);
    for worker in workers {
        worker.await.unwrap();
    }
    // One that ends in each of its ways, with its worker's token.
    let mut ended = Vec::new();
    for way in 0..4 {
        let name = caller.submit(inputs.embed(), "").await.unwrap().name;
        let (job, token) = caller.take().await;
        assert_eq!(job.name, name);
        match way {
            0 => stub::complete(&caller, &job, &token).await.unwrap(),
            1 => fail(&caller, &job, &token, false).await,
            2 => {
                cancel(&caller, &name).await.unwrap();
                fail(&caller, &job, &token, true).await;
            }
            _ => {
                stub::release(&caller, (&name, &token)).await.unwrap();
                cancel(&caller, &name).await.unwrap();
            }
        }
        over.push(caller.job(&name).await.unwrap());
        ended.push((job, token));
    }
    let mut refused = 0;
    for (job, token) in &ended {
        for (call, status) in says_everything(&caller, job, token).await {
            assert_eq!(status.code(), Code::Aborted, "{call}: {status}");
            refused += 1;
        }
    }
    for job in &over {
        let status = cancel(&caller, &job.name).await.unwrap_err();
        assert_eq!(status.code(), Code::FailedPrecondition);
        refused += 1;
    }
    let server = {
        server.kill().await;
        place.start(&[]).await
    };
    for job in &over {
        let now = crate::caller::persist(|| caller.job(&job.name)).await;
        assert_eq!(&now.unwrap(), job);
    }
    place.figure(&format!(
        "{count} jobs cancelled while they ran: over after {}; {refused} later calls refused, {} jobs unchanged after them \
         and a kill of the server",
        Quantiles::of(times),
        over.len()
    ));
    server.stop().await;
}
