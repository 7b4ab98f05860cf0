//! The store on a real folder and on a real S3 server: what arrives whole is kept, everything else leaves nothing. One list
//! of tests for both.
mod both;
#[path = "../../../tests/support/s3.rs"]
pub(crate) mod endpoint;
mod faults;
mod folder;
mod memory;
mod paths;
mod s3;
mod service;

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use futures::TryStreamExt;
use tempfile::TempDir;
use uuid::Uuid;

use super::*;
use endpoint::{BUCKET, Endpoint};

const LIMIT: u64 = 16 << 20;
/// What paths of the tests' bucket begin with.
const PREFIX: &str = "some/where";

/// A store of its own for each test.
struct Bench {
    store: ArtifactStore,
    place: Laid,
}

enum Laid {
    Folder(TempDir),
    S3(Endpoint),
}

impl Bench {
    async fn folder() -> Self {
        let folder = TempDir::new().unwrap();
        Self {
            store: ArtifactStore::open(&folder.path().join("artifacts"), LIMIT).unwrap(),
            place: Laid::Folder(folder),
        }
    }

    async fn s3() -> Self {
        let endpoint = Endpoint::start().await;
        Self {
            store: at(&endpoint, LIMIT),
            place: Laid::S3(endpoint),
        }
    }

    /// All files that there are, of artifacts and of parts.
    fn files(&self) -> Vec<PathBuf> {
        match &self.place {
            Laid::Folder(folder) => files(folder.path()),
            Laid::S3(endpoint) => [endpoint.objects(), endpoint.parts()].concat(),
        }
    }

    /// Where an artifact lies.
    fn file(&self, path: &ArtifactPath) -> PathBuf {
        match &self.place {
            Laid::Folder(folder) => folder.path().join("artifacts").join(path.to_string()),
            Laid::S3(endpoint) => endpoint.path(&format!("{PREFIX}/{path}")),
        }
    }

    /// Waits for the store to be without files; a dropped writer is cleaned up behind its back.
    async fn becomes_empty(&self) {
        for _ in 0..1000 {
            if self.files().is_empty() {
                return;
            }
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
        panic!("left behind: {:?}", self.files());
    }
}

/// A store at an S3 server.
fn at(endpoint: &Endpoint, most: u64) -> ArtifactStore {
    let place = Place::parse(&format!("s3://{BUCKET}/{PREFIX}")).unwrap();
    ArtifactStore::open_at(&place, endpoint.environment(), Duration::from_secs(60), most).unwrap()
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
    let (mut reader, mut pieces) = (store.read(path, offset).await?, Vec::new());
    while let Some(piece) = reader.piece().await? {
        pieces.push(piece.to_vec());
    }
    Ok(pieces)
}

/// Sent as any other program would: without a word of ours.
async fn fetch(url: &str) -> (u16, Vec<u8>) {
    let answer = reqwest::get(url).await.unwrap();
    (answer.status().as_u16(), answer.bytes().await.unwrap().to_vec())
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
