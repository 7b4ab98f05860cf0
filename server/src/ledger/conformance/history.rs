//! Files that were seen, readings of them, and what else a claim is weighed with.
use super::super::{JobKind, JobSpec, KeyId, KeyOrder, Ledger, LedgerError, NewJob, NewReading, ReadBefore, Seed};
use super::Factory;
use super::fixture::*;
use super::outputs::make_key;
use super::registry::{new_asset, owner_and_key, register};
use uuid::Uuid;

fn file(byte: u8) -> String {
    hex::encode([byte; 32])
}

fn reading(id: u8, key: KeyId, files: &[(u8, i64)]) -> NewReading {
    NewReading {
        id: [id; 32],
        project: OURS.into(),
        key,
        files: files.iter().map(|&(byte, time)| (file(byte), time)).collect(),
    }
}

async fn before(ledger: &dyn Ledger, id: u8) -> Option<(i64, u64, u64)> {
    let before = ledger.before([id; 32]).await.unwrap();
    let told = |before: ReadBefore| (before.first_seen, before.readings, before.readings_of_key);
    before.map(told)
}

pub(crate) async fn every_reading_of_a_file_is_known(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let (one, other) = (
        make_key(&*ledger, at(0)).await.1.id,
        make_key(&*ledger, at(0)).await.1.id,
    );
    assert_eq!(before(&*ledger, 1).await, None);
    let note = async |new: NewReading| ledger.note_reading(new, at(9)).await.unwrap();
    note(reading(1, one, &[(7, at(5))])).await;
    // The same once more is no other.
    note(reading(1, one, &[(7, at(6))])).await;
    assert_eq!(before(&*ledger, 1).await, Some((at(5), 1, 1)));
    // With another key, and an artifact that had been there longer.
    note(reading(2, other, &[(7, at(4))])).await;
    assert_eq!(before(&*ledger, 2).await, Some((at(4), 2, 1)));
    assert_eq!(before(&*ledger, 1).await, Some((at(4), 2, 1)));
    // Several files, one of them twice: what was read of either counts, each reading once.
    note(reading(3, one, &[(8, at(8)), (8, at(7))])).await;
    note(reading(4, one, &[(8, at(8)), (7, at(8))])).await;
    assert_eq!(before(&*ledger, 3).await, Some((at(7), 2, 3)));
    assert_eq!(before(&*ledger, 4).await, Some((at(4), 4, 3)));
    // Another project has seen nothing of it.
    let theirs = NewReading {
        project: "theirs".into(),
        ..reading(5, one, &[(7, at(8))])
    };
    note(theirs).await;
    assert_eq!(before(&*ledger, 5).await, Some((at(8), 1, 4)));
    drop(ledger);
    let ledger = factory.open().await;
    assert_eq!(before(&*ledger, 4).await, Some((at(4), 4, 4)));
}

pub(crate) async fn an_upload_is_seen_for_good(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let key = make_key(&*ledger, at(0)).await.1.id;
    let id = upload(&*ledger, at(1)).await;
    let sha256 = ledger.get_artifact(id).await.unwrap().unwrap().sha256;
    ledger.delete_artifact(id, at(2)).await.unwrap();
    ledger.forget_artifact(id).await.unwrap();
    let new = NewReading {
        files: vec![(sha256, at(8))],
        ..reading(1, key, &[])
    };
    ledger.note_reading(new, at(9)).await.unwrap();
    assert_eq!(before(&*ledger, 1).await, Some((at(1), 1, 1)));
}

pub(crate) async fn assets_are_counted_and_opened_once(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let (owner, key) = owner_and_key(&*ledger).await;
    let (second, other) = owner_and_key(&*ledger).await;
    let count = async |key, owner| ledger.count_assets(key, owner).await.unwrap();
    assert_eq!((count(key, None).await, count(key, Some(owner)).await), (0, 0));
    let mut asset = None;
    for (owner, key) in [(owner, key), (owner, key), (second, key), (owner, other)] {
        asset = Some(register(&*ledger, new_asset(owner, key), at(1)).await.id);
    }
    assert_eq!((count(key, None).await, count(other, None).await), (3, 1));
    assert_eq!(
        (count(key, Some(owner)).await, count(other, Some(second)).await),
        (2, 0)
    );
    let asset = asset.unwrap();
    assert_eq!(ledger.get_asset(asset).await.unwrap().unwrap().reveal_time, None);
    for time in [at(5), at(6)] {
        let row = ledger.reveal_asset(asset, time).await.unwrap();
        assert_eq!((row.id, row.reveal_time), (asset, Some(at(5))));
    }
    let nowhere = Uuid::now_v7();
    refused!(ledger.reveal_asset(nowhere, at(7)).await, LedgerError::NotFound { id, .. } if id == nowhere);
}

pub(crate) async fn seeds_are_sealed_where_they_lay_open(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let order = |seed| KeyOrder { bits: 64, seed };
    let made = async |seed| {
        let new = NewJob {
            spec: JobSpec::CreateKey(order(seed)),
            ..new_job()
        };
        ledger.create_job(new, at(0)).await.unwrap().id
    };
    let sealed = || Some(Seed::Sealed(vec![1, 2, 3]));
    let open = made(Some(Seed::Open(7))).await;
    let others = [made(None).await, made(sealed()).await];
    assert_eq!(ledger.open_seeds().await.unwrap(), [(open, order(Some(Seed::Open(7))))]);
    ledger.seal_seed(open, order(sealed()), [9; 32]).await.unwrap();
    assert_eq!(ledger.open_seeds().await.unwrap(), []);
    for (job, seed) in [(open, sealed()), (others[0], None), (others[1], sealed())] {
        let row = ledger.get_job(job).await.unwrap().unwrap();
        assert_eq!(
            (row.kind(), row.spec),
            (JobKind::CreateKey, JobSpec::CreateKey(order(seed)))
        );
    }
}
