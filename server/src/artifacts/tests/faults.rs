//! A store that fails, lies or is away: what is written is whole or is not there, and nobody waits for long.
use std::sync::atomic::Ordering::Relaxed;
use std::time::Instant;

use super::*;

/// Artifacts of the test.
const COUNT: usize = 24;

/// Small ones, and some of several parts.
fn size(i: usize) -> usize {
    match i % 6 {
        0 => 11 * CHUNK_BYTES + i,
        1 => 6 * CHUNK_BYTES,
        _ => 1 + i * 40_000,
    }
}

async fn write(store: &ArtifactStore, path: &ArtifactPath, data: &[u8]) -> StoreResult<Announced> {
    let chunks: Vec<_> = data.chunks(CHUNK_BYTES).collect();
    put(store, path, Announced::of(data), &chunks).await
}

/// Errors, answers that are lost or cut off: some writes fail, and can be tried again under another path. Whatever was
/// said to be written is there, and whatever is there is whole.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn what_is_there_is_whole() {
    let endpoint = Endpoint::start().await;
    let store = at(&endpoint, LIMIT);
    let faults = &endpoint.faults;
    for (kind, share) in [(&faults.refused, 60), (&faults.unanswered, 60), (&faults.cut, 30)] {
        kind.store(share, Relaxed);
    }
    faults.latency.store(5, Relaxed);
    let written = futures::future::join_all((0..COUNT).map(|i| {
        let store = store.clone();
        async move {
            let data = bytes(size(i));
            for _ in 0..20 {
                let path = upload();
                match write(&store, &path, &data).await {
                    Ok(_) => return (path, data),
                    Err(error) => assert!(error.passes(), "{error:?}"),
                }
            }
            panic!("never written");
        }
    }));
    let written = written.await;
    for (path, data) in &written {
        let read = async || get(&store, path, 0).await.map(|chunks| chunks.concat());
        let mut tries = 0;
        let found = loop {
            match read().await {
                Ok(found) => break found,
                Err(error) => assert!(error.passes() && tries < 20, "{error:?}"),
            }
            tries += 1;
        };
        assert!(found == *data, "{path} differs");
    }
    assert!(faults.faults.load(Relaxed) > 10, "{faults:?}");
    // Also what was said to have failed is whole or not there.
    for file in endpoint.objects() {
        let found = fs::read(&file).unwrap();
        assert!(
            (0..COUNT).any(|i| found.len() == size(i) && found == bytes(size(i))),
            "{}",
            file.display()
        );
    }
}

/// A part that is cut off on its way may be stored after its upload was given up: it is waited for, or it stays for ever.
#[tokio::test]
async fn a_part_that_is_stored_late_does_not_stay() {
    let bench = Bench::s3().await;
    let Laid::S3(endpoint) = &bench.place else {
        panic!("not on S3")
    };
    endpoint.faults.stored_late.store(500, Relaxed);
    let data = bytes(7 * CHUNK_BYTES);
    let begun = async || {
        let mut writer = bench.store.write(&upload(), Announced::of(&data)).await.unwrap();
        for chunk in data.chunks(CHUNK_BYTES).take(6) {
            writer.chunk(chunk.to_vec()).await.unwrap();
        }
        // The part has arrived, and is not stored yet.
        tokio::time::sleep(Duration::from_millis(250)).await;
        writer
    };
    begun().await.abort().await.unwrap();
    drop(begun().await);
    tokio::time::sleep(Duration::from_millis(1000)).await;
    assert!(bench.files().is_empty(), "{:?}", bench.files());
    assert_eq!(endpoint.faults.given_up_early.load(Relaxed), 0);
}

#[tokio::test]
async fn a_store_that_is_away_is_told_in_seconds() {
    let bench = Bench::s3().await;
    let Laid::S3(endpoint) = &bench.place else {
        panic!("not on S3")
    };
    let (store, path, other) = (&bench.store, upload(), upload());
    write(store, &path, b"here").await.unwrap();
    endpoint.end();
    let began = Instant::now();
    let (read, written) = tokio::join!(store.read(&path, 0), write(store, &other, b"there"));
    let [read, written] = [read.err().unwrap(), written.unwrap_err()];
    assert!(began.elapsed() < Duration::from_secs(20), "{:?}", began.elapsed());
    for error in [read, written] {
        assert!(error.passes(), "{error:?}");
        let error = crate::error::Error::from(error);
        assert!(matches!(error, crate::error::Error::Unavailable { .. }), "{error:?}");
    }
}

#[tokio::test]
async fn a_store_that_says_nothing_is_not_waited_for() {
    let bench = Bench::s3().await;
    let limit = Duration::from_millis(50);
    let nothing = std::future::pending::<object_store::Result<()>>();
    let silent = bench.store.in_time(limit, nothing).await;
    assert!(
        matches!(silent, Err(StoreError::Silent(said)) if said == limit),
        "{silent:?}"
    );
}
