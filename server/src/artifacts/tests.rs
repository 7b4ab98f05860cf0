//! The store on a real folder: what arrives whole is kept, everything else leaves nothing.
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use futures::TryStreamExt;
use proptest::prelude::*;
use secrecy::{ExposeSecret, SecretSlice};
use tempfile::TempDir;
use uuid::Uuid;

use super::*;
use crate::secrets::{MasterKey, SecretError};

const LIMIT: u64 = 8 << 20;

fn store() -> (TempDir, ArtifactStore) {
    let folder = TempDir::new().unwrap();
    let store = ArtifactStore::open(&folder.path().join("artifacts"), LIMIT).unwrap();
    (folder, store)
}

fn upload() -> ArtifactPath {
    ArtifactPath::upload(Uuid::now_v7())
}

/// Bytes that differ everywhere.
fn bytes(count: usize) -> Vec<u8> {
    (0..count as u64)
        .map(|i| (i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 56) as u8)
        .collect()
}

async fn put(
    store: &ArtifactStore,
    path: &ArtifactPath,
    announced: Announced,
    chunks: &[&[u8]],
) -> StoreResult<Announced> {
    let mut writer = store.write(path, announced).await?;
    for chunk in chunks {
        writer.chunk(chunk.to_vec()).await?;
    }
    writer.finish().await
}

async fn get(store: &ArtifactStore, path: &ArtifactPath, offset: u64) -> StoreResult<Vec<Vec<u8>>> {
    store
        .read(path, offset)
        .await?
        .into_stream()
        .map_ok(|chunk| chunk.to_vec())
        .try_collect()
        .await
}

/// All files below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path))
        } else {
            found.push(path)
        }
    }
    found
}

/// Waits for the folder to be without files; a dropped writer is cleaned up behind its back.
async fn becomes_empty(folder: &Path) {
    for _ in 0..200 {
        if files(folder).is_empty() {
            return;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    panic!("left behind: {:?}", files(folder));
}

#[tokio::test]
async fn what_was_written_is_read_from_any_byte_in_chunks() {
    let (_folder, store) = store();
    let data = bytes(3 * CHUNK_BYTES + 17);
    let chunks: Vec<_> = data.chunks(700_001).collect();
    let path = upload();
    assert_eq!(
        put(&store, &path, Announced::of(&data), &chunks).await.unwrap(),
        Announced::of(&data)
    );
    for offset in [0, 1, CHUNK_BYTES, CHUNK_BYTES + 1, data.len() - 1, data.len()] {
        let read = get(&store, &path, offset as u64).await.unwrap();
        assert!(read.iter().all(|chunk| !chunk.is_empty() && chunk.len() <= CHUNK_BYTES));
        assert!(read.concat() == data[offset..], "from {offset}");
    }
    assert_eq!(store.read(&path, 0).await.unwrap().size(), data.len() as u64);
    for most in [1, 700, CHUNK_BYTES + 1, data.len(), data.len() + 1] {
        let (head, size) = store.head(&path, most).await.unwrap();
        assert!(head[..] == data[..most.min(data.len())], "{most}");
        assert_eq!(size, data.len() as u64);
    }
    let error = get(&store, &path, data.len() as u64 + 1).await.unwrap_err();
    assert!(
        matches!(error, StoreError::BadOffset { offset, size } if offset == size + 1),
        "{error}"
    );
}

#[tokio::test]
async fn an_empty_artifact_is_one() {
    let (_folder, store) = store();
    let path = upload();
    put(&store, &path, Announced::of(b""), &[]).await.unwrap();
    assert!(get(&store, &path, 0).await.unwrap().is_empty());
}

#[tokio::test]
async fn nothing_shows_before_the_end() {
    let (_folder, store) = store();
    let (data, path) = (bytes(2 * CHUNK_BYTES), upload());
    let mut writer = store.write(&path, Announced::of(&data)).await.unwrap();
    for chunk in data.chunks(CHUNK_BYTES) {
        writer.chunk(chunk.to_vec()).await.unwrap();
        assert!(matches!(store.read(&path, 0).await, Err(StoreError::Gone { .. })));
    }
    writer.finish().await.unwrap();
    assert_eq!(get(&store, &path, 0).await.unwrap().concat(), data);
}

#[tokio::test]
async fn every_mistake_is_told_and_leaves_nothing() {
    let (folder, store) = store();
    let data = bytes(1000);
    let good = Announced::of(&data);
    let wrong = Announced {
        sha256: [7; 32],
        ..good
    };
    let long = vec![0; CHUNK_BYTES + 1];
    let cases: [(Announced, &[&[u8]], &str); 6] = [
        (
            Announced {
                size: LIMIT + 1,
                ..good
            },
            &[],
            "8388609 bytes are announced, and at most 8388608 are taken",
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
    ];
    for (announced, chunks, text) in cases {
        let path = upload();
        let error = put(&store, &path, announced, chunks).await.unwrap_err();
        assert!(error.to_string().contains(text), "{error}");
        assert!(matches!(store.read(&path, 0).await, Err(StoreError::Gone { .. })));
    }
    becomes_empty(folder.path()).await;
}

#[tokio::test]
async fn a_stream_that_breaks_off_leaves_nothing() {
    let (folder, store) = store();
    let data = bytes(3 * CHUNK_BYTES);
    let mut writer = store.write(&upload(), Announced::of(&data)).await.unwrap();
    writer.chunk(data[..CHUNK_BYTES].to_vec()).await.unwrap();
    assert_eq!(files(folder.path()).len(), 1);
    drop(writer);
    becomes_empty(folder.path()).await;
    let mut writer = store.write(&upload(), Announced::of(&data)).await.unwrap();
    writer.chunk(data[..CHUNK_BYTES].to_vec()).await.unwrap();
    writer.abort().await.unwrap();
    assert!(files(folder.path()).is_empty());
}

/// A server that was killed in the middle of an upload: the next one clears up, and touches nothing else.
#[tokio::test]
async fn what_a_killed_server_left_is_removed() {
    let (folder, store) = store();
    let (data, kept, cut) = (bytes(5000), upload(), upload());
    put(&store, &kept, Announced::of(&data), &[&data]).await.unwrap();
    let output = ArtifactPath::output(Uuid::now_v7(), "token", Uuid::now_v7());
    for path in [&cut, &output] {
        let mut writer = store.write(path, Announced::of(&data)).await.unwrap();
        writer.chunk(data[..100].to_vec()).await.unwrap();
        std::mem::forget(writer);
    }
    assert_eq!(files(folder.path()).len(), 3);
    let again = ArtifactStore::open(&folder.path().join("artifacts"), LIMIT).unwrap();
    assert_eq!(files(folder.path()).len(), 1);
    assert_eq!(get(&again, &kept, 0).await.unwrap().concat(), data);
}

#[tokio::test]
async fn deletes_one_and_its_empty_folders() {
    let (folder, store) = store();
    let (job, data) = (Uuid::now_v7(), bytes(10));
    let [first, second] = ["a", "b"].map(|lease| ArtifactPath::output(job, lease, Uuid::now_v7()));
    for path in [&first, &second] {
        put(&store, path, Announced::of(&data), &[&data]).await.unwrap();
    }
    store.delete(&first).await.unwrap();
    store.delete(&first).await.unwrap();
    assert!(matches!(store.read(&first, 0).await, Err(StoreError::Gone { .. })));
    assert_eq!(get(&store, &second, 0).await.unwrap().concat(), data);
    store.delete(&second).await.unwrap();
    assert_eq!(fs::read_dir(folder.path().join("artifacts")).unwrap().count(), 0);
    put(&store, &second, Announced::of(&data), &[&data]).await.unwrap();
}

#[tokio::test]
async fn a_reader_of_what_is_deleted_meanwhile_is_told() {
    let (_folder, store) = store();
    let (data, path) = (bytes(2 * CHUNK_BYTES), upload());
    put(
        &store,
        &path,
        Announced::of(&data),
        &data.chunks(CHUNK_BYTES).collect::<Vec<_>>(),
    )
    .await
    .unwrap();
    let mut reader = store.read(&path, 0).await.unwrap();
    assert_eq!(reader.chunk().await.unwrap().unwrap().len(), CHUNK_BYTES);
    store.delete(&path).await.unwrap();
    assert!(matches!(reader.chunk().await, Err(StoreError::Gone { .. })));
}

#[tokio::test]
async fn a_secret_lies_sealed_and_only_for_its_path() {
    let (folder, store) = store();
    let master = MasterKey::generate().unwrap();
    let secret = bytes(2 * CHUNK_BYTES + 5);
    let (path, other) = (upload(), upload());
    store
        .write_sealed(&path, &master, &SecretSlice::from(secret.clone()))
        .await
        .unwrap();
    assert_eq!(store.read_sealed(&path, &master).await.unwrap().expose_secret(), secret);
    let file = folder.path().join("artifacts").join(path.to_string());
    assert!(
        !fs::read(&file)
            .unwrap()
            .windows(16)
            .any(|window| window == &secret[..16])
    );
    fs::copy(&file, folder.path().join("artifacts").join(other.to_string())).unwrap();
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

#[tokio::test]
async fn a_secret_may_not_be_endless() {
    let (_folder, store) = store();
    let secret = SecretSlice::from(vec![0; MAX_SECRET_BYTES as usize + 1]);
    let error = store
        .write_sealed(&upload(), &MasterKey::generate().unwrap(), &secret)
        .await
        .unwrap_err();
    assert!(matches!(error, StoreError::TooLarge { .. }), "{error}");
}

#[test]
fn a_folder_that_cannot_be_is_named() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("file");
    fs::write(&file, "").unwrap();
    let error = ArtifactStore::open(&file, LIMIT).unwrap_err();
    assert!(
        error.to_string().starts_with(&format!("{}: ", file.display())),
        "{error}"
    );
}

#[test]
fn only_a_full_disk_is_told_as_one() {
    let failed = |kind| object_store::Error::Generic {
        store: "LocalFileSystem",
        source: Box::new(std::io::Error::from(kind)),
    };
    assert!(matches!(
        failed(std::io::ErrorKind::StorageFull).into(),
        StoreError::NoSpace(_)
    ));
    assert!(matches!(
        failed(std::io::ErrorKind::PermissionDenied).into(),
        StoreError::Failed(_)
    ));
}

#[test]
fn paths_are_made_of_ids() {
    let (job, id) = (Uuid::from_u128(1), Uuid::from_u128(2));
    let path = ArtifactPath::output(job, "../../token", id);
    assert_eq!(path.to_string().matches('/').count(), 3);
    assert!(!path.to_string().contains("token"));
    assert_ne!(path, ArtifactPath::output(job, "another", id));
    for path in [path, ArtifactPath::upload(id)] {
        assert_eq!(ArtifactPath::parse(&path.to_string()).unwrap(), path);
    }
    for bad in [
        "",
        "uploads",
        "uploads/",
        "uploads/../../etc/passwd",
        "/uploads/00000000-0000-0000-0000-000000000002",
        "uploads/00000000-0000-0000-0000-000000000002#1",
        "uploads/00000000000000000000000000000002",
        "uploads/00000000-0000-0000-0000-000000000002/",
        "outputs/00000000-0000-0000-0000-000000000002/../00000000-0000-0000-0000-000000000002",
        "outputs/00000000-0000-0000-0000-000000000002/0123456789ABCDEF/00000000-0000-0000-0000-000000000002",
    ] {
        assert!(matches!(ArtifactPath::parse(bad), Err(StoreError::BadPath(_))), "{bad}");
    }
}

proptest! {
    #[test]
    fn no_text_leads_out_of_the_store(
        text in "(uploads|outputs|\\.\\.|[a-z/#.%]*)(/[a-f0-9./#%-]{0,40}){0,4}",
    ) {
        if let Ok(path) = ArtifactPath::parse(&text) {
            prop_assert_eq!(path.to_string(), text);
        }
    }

    /// However bytes are cut into chunks, exactly the announced ones pass.
    #[test]
    fn only_what_was_announced_passes(
        data in prop::collection::vec(any::<u8>(), 1..200),
        cut in 1..50usize,
        longer in -2..=2i64,
        flip in any::<bool>(),
    ) {
        let size = data.len().saturating_add_signed(longer as isize) as u64;
        let mut announced = Announced::of(&data);
        announced.size = size;
        announced.sha256[31] ^= u8::from(flip);
        let mut check = Check::new(announced, LIMIT).unwrap();
        let taken = data.chunks(cut).try_for_each(|chunk| check.chunk(chunk));
        let passed = taken.and_then(|()| check.finish()).is_ok();
        prop_assert_eq!(passed, size == data.len() as u64 && !flip);
    }
}
