//! What is under way draws from one budget, and what stands still gives back what it had.
use super::*;

const MEMORY: u64 = 8 << 20;

/// A store with so much memory, and an artifact of 13 MiB.
async fn kept(bench: Bench) -> (Bench, ArtifactPath, Vec<u8>) {
    let Bench { store, place } = bench;
    let spool = std::env::temp_dir();
    let store = store.within(TransferMemory::new(MEMORY), &spool);
    let (data, path) = (bytes(13 << 20), upload());
    let chunks: Vec<_> = data.chunks(CHUNK_BYTES).collect();
    put(&store, &path, Announced::of(&data), &chunks).await.unwrap();
    assert_eq!(store.memory().free(), MEMORY);
    (Bench { store, place }, path, data)
}

async fn readers_that_stand_still_hold_nothing(bench: Bench) {
    let (bench, path, data) = kept(bench).await;
    let store = &bench.store;
    let (mut readers, mut read) = (Vec::new(), Vec::new());
    // More than there would be memory for.
    for _ in 0..200 {
        let mut reader = store.read(&path, 0).await.unwrap();
        let piece = reader.piece().await.unwrap().unwrap();
        assert_eq!(piece.len(), PIECE_BYTES);
        assert!(store.memory().free() < MEMORY);
        reader.rest();
        assert_eq!(store.memory().free(), MEMORY);
        readers.push(reader);
        read.push(piece.to_vec());
    }
    // It goes on where it was.
    let (mut reader, mut read) = (readers.swap_remove(7), read.swap_remove(7));
    while let Some(piece) = reader.piece().await.unwrap() {
        read.extend_from_slice(&piece);
    }
    assert!(read == data);
    assert_eq!(store.memory().free(), MEMORY);
}

async fn windows_grow_for_whoever_takes_them_and_no_further(bench: Bench) {
    let (bench, path, data) = kept(bench).await;
    let store = &bench.store;
    let mut reader = store.read(&path, 0).await.unwrap();
    let (mut most, mut read) = (0, 0);
    while let Some(piece) = reader.piece().await.unwrap() {
        read += piece.len();
        most = most.max(MEMORY - store.memory().free());
    }
    assert_eq!((read, most), (data.len(), store.window() as u64));
    // Whoever is slow has but little: one who rested, and one who takes long for a window.
    let mut reader = store.read(&path, 0).await.unwrap();
    let mut read = reader.piece().await.unwrap().unwrap().to_vec();
    reader.rest();
    for i in 0..3 * store.slow_window() / PIECE_BYTES {
        read.extend_from_slice(&reader.piece().await.unwrap().unwrap());
        assert!(MEMORY - store.memory().free() <= store.slow_window() as u64, "{i}");
        if i % (store.slow_window() / PIECE_BYTES) == 0 {
            tokio::time::sleep(Duration::from_millis(1100)).await;
        }
    }
    assert!(data.starts_with(&read));
}

async fn uploads_that_stop_hold_nothing(bench: Bench) {
    let (bench, _, data) = kept(bench).await;
    let mut writers = Vec::new();
    for _ in 0..20 {
        let mut writer = bench.store.write(&upload(), Announced::of(&data)).await.unwrap();
        for chunk in data.chunks(CHUNK_BYTES).take(4) {
            writer.chunk(chunk.to_vec()).await.unwrap();
        }
        writers.push(writer);
    }
    assert_eq!(bench.store.memory().free(), MEMORY);
    // All of them at once, though there is not memory for a part of each.
    let ends = writers.into_iter().map(async |mut writer| {
        for chunk in data.chunks(CHUNK_BYTES).skip(4) {
            writer.chunk(chunk.to_vec()).await.unwrap();
        }
        writer.finish().await.unwrap();
    });
    futures::future::join_all(ends).await;
    assert_eq!(bench.store.memory().free(), MEMORY);
}

macro_rules! on_both {
    ($($test:ident)*) => {$(
        mod $test {
            use super::*;

            #[tokio::test]
            async fn in_a_folder() {
                super::$test(Bench::folder().await).await;
            }

            #[tokio::test]
            async fn in_s3() {
                super::$test(Bench::s3().await).await;
            }
        }
    )*};
}

on_both!(
    readers_that_stand_still_hold_nothing
    windows_grow_for_whoever_takes_them_and_no_further
    uploads_that_stop_hold_nothing
);
