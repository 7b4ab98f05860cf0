//! A copy of a ledger over the same store: it must not take what came since for bytes that nothing points at.
use std::sync::Arc;

use tempfile::TempDir;

use super::harness::{Server, soon};
use super::stores::{bucket, download};
use crate::artifacts::tests::endpoint::Endpoint;
use crate::ledger::{Ledger, SqliteLedger};
use crate::notary::Notary;
use crate::run::store;
use crate::secrets::{self, KeySource};
use crate::service::store_generation::{Standing, standing, take_over};
use crate::service::{Limits, clock};

const MINUTES: i64 = 60_000_000;

async fn open(folder: &TempDir) -> Arc<dyn Ledger> {
    let file = folder.path().join("ledger.sqlite");
    Arc::new(SqliteLedger::open(&file).await.unwrap())
}

/// What a rehearsal of a restore has: the ledger as it was, and the master key.
async fn copy_of(server: &Server) -> (TempDir, Arc<dyn Ledger>) {
    let folder = server.folder_of_a_twin();
    let from = server.folder().join("ledger.sqlite");
    let to = folder.path().join("ledger.sqlite");
    crate::ledger::sqlite::copy::copy(&from, &to).await.unwrap();
    let ledger = open(&folder).await;
    (folder, ledger)
}

/// What a server does with the store when it begins.
async fn begin(ledger: &dyn Ledger, folder: &TempDir, endpoint: &Endpoint, now: i64) -> Result<(), String> {
    let master = secrets::load(KeySource::DataFolder, folder.path()).unwrap();
    let notary = Notary::open(ledger, &master, now).await.unwrap();
    let begun = store::claim(&bucket(endpoint), &notary, ledger, now).await;
    begun.map_err(|error| error.to_string())
}

/// A server over a bucket, that began as servers do.
async fn production(endpoint: &Endpoint) -> Server {
    let folder = TempDir::new().unwrap();
    secrets::load(KeySource::DataFolder, folder.path()).unwrap();
    let ledger = open(&folder).await;
    begin(&*ledger, &folder, endpoint, clock::now() - 20 * MINUTES)
        .await
        .unwrap();
    Server::with_store(ledger, bucket(endpoint), folder, Limits::default(), false).await
}

#[tokio::test]
async fn a_copied_ledger_does_not_delete_what_came_since() {
    let endpoint = Endpoint::start().await;
    let server = production(&endpoint).await;
    let (folder, copy) = copy_of(&server).await;
    // Production goes on, for longer than a generation lasts, and takes something new.
    soon("the next generation", async || {
        server.ledger().generation().await.unwrap() != copy.generation().await.unwrap()
    })
    .await;
    let scene = server.upload("scene.ply", b"what came since").await.name;

    let refused = begin(&*copy, &folder, &endpoint, clock::now()).await.unwrap_err();
    assert!(refused.contains("store take-over"), "{refused}");
    // Even a server that did not ask at its start deletes nothing, and production hears of it.
    let rehearsal = Server::with_store(copy, bucket(&endpoint), folder, Limits::default(), false).await;
    assert!(!rehearsal.api.is_ours().await);
    assert!(!server.api.is_ours().await);
    assert_eq!(download(&server, &scene).await.unwrap(), b"what came since");

    // Production is the one that stays.
    rehearsal.api.stop();
    take_over(&*server.ledger(), &bucket(&endpoint), clock::now())
        .await
        .unwrap();
    assert!(server.api.is_ours().await);
    let refused = begin(
        &*rehearsal.ledger(),
        &server.folder_of_a_twin(),
        &endpoint,
        clock::now(),
    )
    .await;
    refused.unwrap_err();
}

/// Whoever goes on first is told from the other, also when the copy is so young that it was no copy yet.
#[tokio::test]
async fn two_that_go_on_from_the_same_generation_both_stop_deleting() {
    let endpoint = Endpoint::start().await;
    let store = bucket(&endpoint);
    let (one, two) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    let (one, two) = (open(&one).await, open(&two).await);
    let now = clock::now();
    assert_eq!(standing(&*one, &store, now).await.unwrap(), Standing::Ours);
    let first = one.generation().await.unwrap().unwrap();
    two.advance_generation(None, first.current, now).await.unwrap();
    // The copy is young, and neither can tell.
    for ledger in [&one, &two] {
        assert_eq!(
            standing(&**ledger, &store, now + MINUTES).await.unwrap(),
            Standing::Ours
        );
    }
    assert_eq!(
        standing(&*two, &store, now + 6 * MINUTES).await.unwrap(),
        Standing::Ours
    );
    assert_eq!(
        standing(&*one, &store, now + 6 * MINUTES).await.unwrap(),
        Standing::Behind
    );
    store.contest().await.unwrap();
    for ledger in [&one, &two] {
        assert_eq!(
            standing(&**ledger, &store, now + 7 * MINUTES).await.unwrap(),
            Standing::Contested
        );
    }
    take_over(&*one, &store, now + 8 * MINUTES).await.unwrap();
    assert_eq!(
        standing(&*one, &store, now + 9 * MINUTES).await.unwrap(),
        Standing::Ours
    );
    assert_eq!(
        standing(&*two, &store, now + 9 * MINUTES).await.unwrap(),
        Standing::Behind
    );
}

/// Between ledger and store a server may be killed.
#[tokio::test]
async fn a_store_that_was_not_told_is_told() {
    let endpoint = Endpoint::start().await;
    let store = bucket(&endpoint);
    let folder = TempDir::new().unwrap();
    let ledger = open(&folder).await;
    let now = clock::now();
    standing(&*ledger, &store, now).await.unwrap();
    let before = ledger.generation().await.unwrap().unwrap().current;
    let next = uuid::Uuid::now_v7();
    ledger.advance_generation(Some(before), next, now).await.unwrap();
    assert_eq!(store.generation().await.unwrap(), Some(before));
    assert_eq!(standing(&*ledger, &store, now).await.unwrap(), Standing::Ours);
    assert_eq!(store.generation().await.unwrap(), Some(next));
}
