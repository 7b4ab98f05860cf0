//! SIGTERM amid a job: health says so at once, the job is handed back or goes on, and no attempt is charged.
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use guardsplat_proto::v1::job::{Spec, State};
use guardsplat_proto::v1::{Job, KeySpec};
use nix::sys::signal::Signal;
use tokio::time::{Duration, Instant, timeout};
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;

use crate::caller::Caller;
use crate::place::{Place, Quantiles, short_or_full};
use crate::stub::{self, Stub};
use crate::support::SOON;

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

pub async fn hands_back(place: Place) {
    let rounds = short_or_full(1, 10);
    let (mut told, mut ended) = (Vec::new(), Vec::new());
    for _ in 0..rounds {
        // With its own worker, a process that is asked to leave too.
        let server = place
            .bench
            .start_with_worker(&stub::script(Duration::from_secs(60)))
            .await;
        let caller = Caller::new(&format!("http://{}", server.address()));
        let name = caller.submit(job(), "").await.unwrap().name;
        caller.reaches(&name, State::Running).await;
        let mut health = HealthClient::new(caller.channel.clone());
        let watched = health.watch(HealthCheckRequest::default()).await.unwrap();
        let mut watched = watched.into_inner();
        let status = watched.message().await.unwrap().unwrap().status();
        assert_eq!(status, ServingStatus::Serving);
        let begun = Instant::now();
        server.signal(Signal::SIGTERM);
        let status = timeout(SOON, watched.message())
            .await
            .unwrap()
            .unwrap()
            .unwrap()
            .status();
        assert_eq!(status, ServingStatus::NotServing);
        told.push(begun.elapsed());
        drop((watched, health));
        assert_eq!(server.ended().await.code(), Some(0));
        ended.push(begun.elapsed());

        let server = place.start(&[]).await;
        let caller = place.caller();
        let back = caller.job(&name).await.unwrap();
        assert_eq!((back.state(), back.attempt), (State::Queued, 0), "{back:?}");
        assert_eq!(back.failure, None);
        // And one amid a job of a worker elsewhere, which keeps it while no server is there.
        let stop = Arc::new(AtomicBool::new(false));
        let worker = tokio::spawn(Stub::new(place.caller(), "elsewhere", Duration::from_secs(2)).serve(stop.clone()));
        caller.reaches(&name, State::Running).await;
        assert_eq!(server.stop().await.code(), Some(0));
        let server = place.start(&[]).await;
        let done = caller.reaches(&name, State::Succeeded).await;
        assert_eq!(done.attempt, 1);
        stop.store(true, Ordering::Relaxed);
        worker.await.unwrap();
        server.stop().await;
    }
    place.figure(&format!(
        "{rounds} times SIGTERM amid a job: NOT_SERVING after {}; gone after {}; no attempt charged",
        Quantiles::of(told),
        Quantiles::of(ended)
    ));
}
