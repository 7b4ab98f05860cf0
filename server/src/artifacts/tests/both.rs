//! What a store does wherever it is: each of these is a test on a folder, and one on S3.
use secrecy::{ExposeSecret, SecretSlice};

use super::*;
use crate::secrets::{MasterKey, SecretError};

/// Makes a test of each function, on a folder and on S3.
macro_rules! on_both {
    ($($test:ident)*) => {
        mod on_a_folder {
            $(#[tokio::test] async fn $test() { super::$test(super::Bench::folder().await).await; })*
        }
        mod on_s3 {
            $(#[tokio::test] async fn $test() { super::$test(super::Bench::s3().await).await; })*
        }
    };
}

on_both! {
    what_was_written_is_read_from_any_byte_in_chunks
    an_empty_artifact_is_one
    nothing_shows_before_the_end
    every_mistake_is_told_and_leaves_nothing
    a_stream_that_breaks_off_leaves_nothing
    what_is_deleted_is_gone
    a_reader_of_what_is_deleted_meanwhile_is_told
    a_secret_lies_sealed_and_only_for_its_path
    a_secret_may_not_be_endless
    the_store_is_one_ledgers
    all_that_lies_at_paths_of_artifacts_is_listed
}

async fn what_was_written_is_read_from_any_byte_in_chunks(bench: Bench) {
    let store = &bench.store;
    // Two parts and a half.
    let data = bytes(13 * CHUNK_BYTES + 17);
    let chunks: Vec<_> = data.chunks(700_001).collect();
    let path = upload();
    assert_eq!(
        put(store, &path, Announced::of(&data), &chunks).await.unwrap(),
        Announced::of(&data)
    );
    for offset in [0, 1, CHUNK_BYTES, CHUNK_BYTES + 1, data.len() - 1, data.len()] {
        let read = get(store, &path, offset as u64).await.unwrap();
        assert!(read.iter().all(|chunk| !chunk.is_empty() && chunk.len() <= PIECE_BYTES));
        assert!(read.concat() == data[offset..], "from {offset}");
    }
    assert_eq!(store.read(&path, 0).await.unwrap().size(), data.len() as u64);
    for most in [1, 700, CHUNK_BYTES + 1, data.len(), data.len() + 1] {
        let (head, size) = store.head(&path, most).await.unwrap();
        assert!(head[..] == data[..most.min(data.len())], "{most}");
        assert_eq!(size, data.len() as u64);
    }
    let error = get(store, &path, data.len() as u64 + 1).await.unwrap_err();
    assert!(
        matches!(error, StoreError::BadOffset { offset, size } if offset == size + 1),
        "{error}"
    );
}

async fn an_empty_artifact_is_one(bench: Bench) {
    let store = &bench.store;
    let path = upload();
    put(store, &path, Announced::of(b""), &[]).await.unwrap();
    assert!(get(store, &path, 0).await.unwrap().is_empty());
}

async fn nothing_shows_before_the_end(bench: Bench) {
    let store = &bench.store;
    let (data, path) = (bytes(12 * CHUNK_BYTES), upload());
    let mut writer = store.write(&path, Announced::of(&data)).await.unwrap();
    for chunk in data.chunks(CHUNK_BYTES) {
        writer.chunk(chunk.to_vec()).await.unwrap();
        assert!(matches!(store.read(&path, 0).await, Err(StoreError::Gone { .. })));
    }
    writer.finish().await.unwrap();
    assert_eq!(get(store, &path, 0).await.unwrap().concat(), data);
}

async fn every_mistake_is_told_and_leaves_nothing(bench: Bench) {
    let store = &bench.store;
    let data = bytes(1000);
    let good = Announced::of(&data);
    let wrong = Announced {
        sha256: [7; 32],
        ..good
    };
    let long = vec![0; CHUNK_BYTES + 1];
    let parts = bytes(12 * CHUNK_BYTES);
    let cut: Vec<_> = parts[..11 * CHUNK_BYTES].chunks(CHUNK_BYTES).collect();
    let too_large = format!("{} bytes are announced, and at most {LIMIT} are taken", LIMIT + 1);
    let cases: [(Announced, &[&[u8]], &str); 7] = [
        (
            Announced {
                size: LIMIT + 1,
                ..good
            },
            &[],
            &too_large,
        ),
        (good, &[&data, b"x"], "1000 bytes were announced, and more arrived"),
        (good, &[&data[..999]], "1000 bytes were announced, and 999 arrived"),
        (good, &[], "1000 bytes were announced, and 0 arrived"),
        (wrong, &[&data], "was announced"),
        (
            Announced { size: LIMIT, ..good },
            &[&long],
            "a chunk has 1048577 bytes, and at most 1048576 are taken",
        ),
        (
            Announced::of(&parts),
            &cut,
            "12582912 bytes were announced, and 11534336 arrived",
        ),
    ];
    for (announced, chunks, text) in cases {
        let path = upload();
        let error = put(store, &path, announced, chunks).await.unwrap_err();
        assert!(error.to_string().contains(text), "{error}");
        assert!(matches!(store.read(&path, 0).await, Err(StoreError::Gone { .. })));
    }
    bench.becomes_empty().await;
}

async fn a_stream_that_breaks_off_leaves_nothing(bench: Bench) {
    let store = &bench.store;
    let data = bytes(12 * CHUNK_BYTES);
    let begun = async || {
        let mut writer = store.write(&upload(), Announced::of(&data)).await.unwrap();
        for chunk in data.chunks(CHUNK_BYTES).take(11) {
            writer.chunk(chunk.to_vec()).await.unwrap();
        }
        for _ in 0..500 {
            if !bench.files().is_empty() {
                return writer;
            }
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
        panic!("nothing was written meanwhile");
    };
    drop(begun().await);
    bench.becomes_empty().await;
    begun().await.abort().await.unwrap();
    bench.becomes_empty().await;
}

async fn a_reader_of_what_is_deleted_meanwhile_is_told(bench: Bench) {
    let store = &bench.store;
    let (data, path) = (bytes(6 * CHUNK_BYTES), upload());
    put(
        store,
        &path,
        Announced::of(&data),
        &data.chunks(CHUNK_BYTES).collect::<Vec<_>>(),
    )
    .await
    .unwrap();
    let mut reader = store.read(&path, 0).await.unwrap();
    assert_eq!(reader.piece().await.unwrap().unwrap().len(), PIECE_BYTES);
    store.delete(&path).await.unwrap();
    let end = loop {
        match reader.piece().await {
            // What was fetched together with the first.
            Ok(Some(_)) => {}
            end => break end,
        }
    };
    assert!(matches!(end, Err(StoreError::Gone { .. })));
}

async fn a_secret_lies_sealed_and_only_for_its_path(bench: Bench) {
    let store = &bench.store;
    let master = MasterKey::generate().unwrap();
    let secret = bytes(2 * CHUNK_BYTES + 5);
    let (path, other) = (upload(), upload());
    store
        .write_sealed(&path, &master, &SecretSlice::from(secret.clone()))
        .await
        .unwrap();
    assert_eq!(store.read_sealed(&path, &master).await.unwrap().expose_secret(), secret);
    let file = bench.file(&path);
    assert!(
        !fs::read(&file)
            .unwrap()
            .windows(16)
            .any(|window| window == &secret[..16])
    );
    fs::copy(&file, bench.file(&other)).unwrap();
    assert!(matches!(
        store.read_sealed(&other, &master).await,
        Err(StoreError::Sealed(SecretError::Altered))
    ));
    let another = MasterKey::generate().unwrap();
    assert!(matches!(
        store.read_sealed(&path, &another).await,
        Err(StoreError::Sealed(SecretError::WrongKey { .. }))
    ));
}

async fn a_secret_may_not_be_endless(bench: Bench) {
    let store = &bench.store;
    let secret = SecretSlice::from(vec![0; MAX_SECRET_BYTES as usize + 1]);
    let error = store
        .write_sealed(&upload(), &MasterKey::generate().unwrap(), &secret)
        .await
        .unwrap_err();
    assert!(matches!(error, StoreError::TooLarge { .. }), "{error}");
}

async fn what_is_deleted_is_gone(bench: Bench) {
    let store = &bench.store;
    let (job, data) = (Uuid::now_v7(), bytes(10));
    let [first, second] = ["a", "b"].map(|lease| ArtifactPath::output(job, lease, Uuid::now_v7()));
    for path in [&first, &second] {
        put(store, path, Announced::of(&data), &[&data]).await.unwrap();
    }
    store.delete(&first).await.unwrap();
    store.delete(&first).await.unwrap();
    assert!(matches!(store.read(&first, 0).await, Err(StoreError::Gone { .. })));
    assert_eq!(get(store, &second, 0).await.unwrap().concat(), data);
    store.delete(&second).await.unwrap();
    bench.becomes_empty().await;
    put(store, &second, Announced::of(&data), &[&data]).await.unwrap();
}

/// Of two ledgers one would collect what the other has as nobody's.
async fn the_store_is_one_ledgers(bench: Bench) {
    let store = &bench.store;
    store.check().await.unwrap();
    bench.becomes_empty().await;
    let both = tokio::join!(store.claim("one"), store.claim("one"));
    assert!(both.0.is_ok() && both.1.is_ok(), "{both:?}");
    store.claim("one").await.unwrap();
    let error = store.claim("two").await.unwrap_err();
    assert!(matches!(error, StoreError::OfAnother { .. }), "{error}");
    store.claim("one").await.unwrap();
}

async fn all_that_lies_at_paths_of_artifacts_is_listed(bench: Bench) {
    let store = &bench.store;
    store.claim("one").await.unwrap();
    let mut all = vec![upload(), upload()];
    all.push(ArtifactPath::output(Uuid::now_v7(), "token", Uuid::now_v7()));
    for path in &all {
        put(store, path, Announced::of(b"x"), &[b"x"]).await.unwrap();
    }
    // What is not this program's: it is not listed, and so never deleted.
    let strange = bench.file(&upload()).with_file_name("holiday.jpg");
    fs::write(strange, "x").unwrap();
    let listed: Vec<Listed> = store.list().try_collect().await.unwrap();
    let mut found: Vec<String> = listed.iter().map(|listed| listed.path.to_string()).collect();
    let mut expected: Vec<String> = all.iter().map(ToString::to_string).collect();
    found.sort();
    expected.sort();
    assert_eq!(found, expected);
    let now = std::time::SystemTime::now()
        .duration_since(std::time::UNIX_EPOCH)
        .unwrap();
    let now = i64::try_from(now.as_micros()).unwrap();
    for listed in listed {
        assert!((now - listed.written).abs() < 60_000_000, "{listed:?}");
    }
}
