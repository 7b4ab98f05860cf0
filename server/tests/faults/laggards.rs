//! Clients that read or send too slowly: others are served as before, and what never comes is not waited for.
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use guardsplat_proto::v1::upload_artifact_request::Payload;
use guardsplat_proto::v1::{UploadArtifactRequest, UploadMetadata, WatchJobRequest, WatchJobResponse};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::task::JoinHandle;
use tokio::time::{Duration, Instant, sleep};
use tonic::Streaming;

use crate::caller::{Caller, Inputs};
use crate::cancelling::cancel;
use crate::load::peak;
use crate::place::{Place, Quantiles, free_address, short_or_full};
use crate::stub::Stub;
use crate::support::SOON;

/// What healthy clients wait for, calling one after the other for so long.
pub async fn healthy(place: &Place, inputs: &Arc<Inputs>, long: Duration) -> Quantiles {
    let clients: Vec<_> = (0..4)
        .map(|_| {
            let (caller, inputs) = (place.caller(), inputs.clone());
            tokio::spawn(async move {
                let (begun, mut times) = (Instant::now(), Vec::new());
                while begun.elapsed() < long {
                    let call = Instant::now();
                    let job = caller.submit(inputs.verify(), "").await.unwrap();
                    times.push(call.elapsed());
                    let call = Instant::now();
                    caller.job(&job.name).await.unwrap();
                    times.push(call.elapsed());
                    // A queue that grew would make calls slower whoever else is there.
                    cancel(&caller, &job.name).await.unwrap();
                    // Clients have other things to do.
                    sleep(Duration::from_millis(20)).await;
                }
                times
            })
        })
        .collect();
    let mut times = Vec::new();
    for client in clients {
        times.extend(client.await.unwrap());
    }
    Quantiles::of(times)
}

/// Announces a megabyte, sends a little of it, and then nothing.
fn uploads(caller: Caller) -> JoinHandle<tonic::Code> {
    tokio::spawn(async move {
        let metadata = UploadMetadata {
            display_name: "slow.ply".into(),
            size_bytes: 1 << 20,
            sha256: "ab".repeat(32),
        };
        let said = [Payload::Metadata(metadata), Payload::Chunk(vec![0; 1000])];
        let said = said.map(|payload| UploadArtifactRequest { payload: Some(payload) });
        let messages = futures::StreamExt::chain(tokio_stream::iter(said), futures::stream::pending());
        let sent = caller.artifacts.clone().upload_artifact(messages).await;
        sent.map_or_else(|status| status.code(), |_| tonic::Code::Ok)
    })
}

/// Jobs that go before the one that is watched: enough for a while, however slow those are that submit more.
const BEFORE: u32 = 60;
/// Bytes that may be on the way to a watcher, so that few messages show that it does not read.
const WINDOW: u32 = 64;

/// Begins to watch on a connection of its own, and reads the first message.
async fn watching(place: &Place, job: &str, window: Option<u32>) -> Streaming<WatchJobResponse> {
    let caller = Caller::with_window(&place.url(), window);
    let request = WatchJobRequest {
        name: job.to_owned(),
        cursor: String::new(),
    };
    let mut stream = caller.jobs.clone().watch_job(request).await.unwrap().into_inner();
    stream.message().await.unwrap().unwrap();
    stream
}

/// A figure of the server's metrics.
async fn told(address: &str, name: &str) -> u32 {
    let mut stream = TcpStream::connect(address).await.unwrap();
    let request = format!("GET /metrics HTTP/1.1\r\nhost: {address}\r\nconnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    let figure = answer
        .lines()
        .find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
    figure
        .unwrap_or_else(|| panic!("no {name} in {answer}"))
        .parse()
        .unwrap()
}

pub async fn do_not_hold_up_others(place: Place) {
    let (count, long) = short_or_full((20, Duration::from_secs(1)), (200, Duration::from_secs(20)));
    let (patience, takes) = short_or_full(("1", Duration::from_millis(500)), ("10", Duration::from_secs(2)));
    let metrics = free_address();
    let flags = [
        "--upload-timeout-seconds",
        patience,
        "--watch-stall-seconds",
        patience,
        "--max-transfers-per-caller",
        "0",
        "--metrics-listen",
        &metrics,
    ];
    let server = place.start(&flags).await;
    let caller = place.caller();
    let inputs = Arc::new(caller.inputs().await);
    // Something goes on all the time that watchers are to hear of: others are done that go first.
    let watched = caller.submit(inputs.embed(), "").await.unwrap().name;
    for _ in 0..BEFORE {
        caller.submit(inputs.verify(), "").await.unwrap();
    }
    let stop = Arc::new(AtomicBool::new(false));
    let worker = tokio::spawn(Stub::new(place.caller(), "stub", takes).serve(stop.clone()));
    let before = healthy(&place, &inputs, long).await;

    let mut watchers = Vec::new();
    for _ in 0..count {
        // Held, and never read again.
        watchers.push(watching(&place, &watched, Some(WINDOW)).await);
    }
    let mut reading = watching(&place, &watched, Some(WINDOW)).await;
    let reader = tokio::spawn(async move { while let Ok(Some(_)) = reading.message().await {} });
    let opened = Instant::now();
    let uploading: Vec<_> = (0..count).map(|_| uploads(place.caller())).collect();
    let during = healthy(&place, &inputs, long).await;
    let begun = Instant::now();
    for upload in uploading {
        let code = upload.await.unwrap();
        assert_ne!(code, tonic::Code::Ok);
    }
    let broken_off = begun.elapsed();
    // The watched job is last in the queue, and its place moves meanwhile.
    while told(&metrics, "guardsplat_watches_shed_total").await < count {
        assert!(
            opened.elapsed() < 2 * SOON,
            "not all of {count} watchers that do not read are shed"
        );
        sleep(Duration::from_millis(50)).await;
    }
    let shed = opened.elapsed();
    // The one who reads is left.
    assert_eq!(told(&metrics, "guardsplat_watches").await, 1);
    assert!(!reader.is_finished());
    // Nothing of them is left on the disk.
    let staged = || {
        let kept = place.bench.kept();
        kept.iter()
            .filter(|path| path.metadata().is_ok_and(|file| file.len() == 1000))
            .count()
    };
    while staged() > 0 {
        assert!(begun.elapsed() < 2 * SOON, "{} uploads are left", staged());
        sleep(Duration::from_millis(50)).await;
    }
    // The ledger is longer by every call, with and without laggards: what was before and what is after stand on either
    // side of them.
    drop(watchers);
    reader.abort();
    while told(&metrics, "guardsplat_watches").await > 0 {
        assert!(begun.elapsed() < 3 * SOON, "watches are left");
        sleep(Duration::from_millis(50)).await;
    }
    let after = healthy(&place, &inputs, long).await;
    place.figure(&format!(
        "{count} watchers that do not read and {count} uploads that stop: healthy calls {before}; with them {during}; \
         after them {after} (p99 {:+.0} % of the geometric mean of before and after); watchers all shed {:.1} s after they \
         were there, uploads broken off {:.1} s after the calls; the server had {} MiB",
        (during.p99 / (before.p99 * after.p99).sqrt() - 1.0) * 100.0,
        shed.as_secs_f64(),
        broken_off.as_secs_f64(),
        peak(&server)
    ));
    stop.store(true, Ordering::Relaxed);
    worker.await.unwrap();
    server.stop().await;
}
