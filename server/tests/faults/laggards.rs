//! Clients that read or send too slowly: others are served as before, and what never comes is not waited for.
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use guardsplat_proto::v1::upload_artifact_request::Payload;
use guardsplat_proto::v1::{UploadArtifactRequest, UploadMetadata, WatchJobRequest};
use tokio::task::JoinHandle;
use tokio::time::{Duration, Instant, sleep};

use crate::caller::{Caller, Inputs};
use crate::load::peak;
use crate::place::{Place, Quantiles, short_or_full};
use crate::stub::Stub;
use crate::support::SOON;

/// What healthy clients wait for, calling one after the other for so long.
async fn healthy(place: &Place, inputs: &Arc<Inputs>, long: Duration) -> Quantiles {
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

pub async fn do_not_hold_up_others(place: Place) {
    let (count, long) = short_or_full((20, Duration::from_secs(1)), (200, Duration::from_secs(20)));
    let upload_timeout = short_or_full("1", "10");
    let server = place.start(&["--upload-timeout-seconds", upload_timeout]).await;
    let caller = place.caller();
    let inputs = Arc::new(caller.inputs().await);
    // Something goes on all the time that watchers are to hear of.
    let watched = caller.submit(inputs.embed(), "").await.unwrap().name;
    let stop = Arc::new(AtomicBool::new(false));
    let worker = tokio::spawn(Stub::new(place.caller(), "stub", Duration::from_secs(2)).serve(stop.clone()));
    let before = healthy(&place, &inputs, long).await;

    let mut watchers = Vec::new();
    for _ in 0..count {
        let caller = place.caller();
        let request = WatchJobRequest {
            name: watched.clone(),
            cursor: String::new(),
        };
        let mut stream = caller.jobs.clone().watch_job(request).await.unwrap().into_inner();
        stream.message().await.unwrap();
        // Held, and never read again.
        watchers.push((caller, stream));
    }
    let uploading: Vec<_> = (0..count).map(|_| uploads(place.caller())).collect();
    let during = healthy(&place, &inputs, long).await;
    let begun = Instant::now();
    for upload in uploading {
        let code = upload.await.unwrap();
        assert_ne!(code, tonic::Code::Ok);
    }
    let shed = begun.elapsed();
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
    place.figure(&format!(
        "{count} watchers that do not read and {count} uploads that stop: healthy calls {before}; with them {during} \
         (p99 {:+.0} %); uploads all broken off, {:.1} s after that; the server had {} MiB",
        (during.p99 / before.p99 - 1.0) * 100.0,
        shed.as_secs_f64(),
        peak(&server)
    ));
    drop(watchers);
    stop.store(true, Ordering::Relaxed);
    worker.await.unwrap();
    server.stop().await;
}
