//! Bytes that are reserved for uploads: counted from the beginning, given back once.
use uuid::Uuid;

use super::super::{NewArtifact, UploadReservation};
use super::Factory;
use super::fixture::*;

const LIMIT: u64 = 100;

fn reservation(size: i64, begun: i64) -> UploadReservation {
    UploadReservation {
        id: Uuid::now_v7(),
        project: OURS.into(),
        size,
        address_end: at(begun + 10),
        end_time: at(begun + 100),
    }
}

pub(crate) async fn bytes_are_reserved_until_the_artifact_is_there(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let used = async || ledger.usage(OURS).await.unwrap().bytes();
    upload(&*ledger, at(0)).await; // of 10 bytes
    let first = reservation(60, 0);
    assert!(ledger.reserve_upload(first.clone(), LIMIT).await.unwrap());
    assert_eq!(used().await, 70);
    assert!(!ledger.reserve_upload(reservation(31, 0), LIMIT).await.unwrap());
    // Another project has bytes of its own.
    let other = UploadReservation {
        project: "other".into(),
        ..reservation(100, 0)
    };
    assert!(ledger.reserve_upload(other, LIMIT).await.unwrap());
    let second = reservation(30, 0);
    assert!(ledger.reserve_upload(second.clone(), LIMIT).await.unwrap());
    assert_eq!(used().await, 100);

    // What was reserved for an artifact is the artifact's.
    let made = NewArtifact {
        id: first.id,
        size: 60,
        ..new_artifact(by_us(), false)
    };
    assert!(ledger.is_reserved(first.id).await.unwrap());
    ledger.create_artifact(made, at(1)).await.unwrap();
    assert!(!ledger.is_reserved(first.id).await.unwrap());
    ledger.artifact_ready(first.id, None, at(2)).await.unwrap();
    assert_eq!(used().await, 100);
    for _ in 0..2 {
        ledger.release_upload(second.id).await.unwrap();
        assert_eq!(used().await, 70);
    }
}

pub(crate) async fn reservations_end(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let (refused, left) = (reservation(10, 0), reservation(20, 1));
    for new in [&refused, &left] {
        assert!(ledger.reserve_upload(new.clone(), LIMIT).await.unwrap());
    }
    let ended = async |time| ledger.ended_reservations(at(time), 10).await.unwrap();
    assert!(ended(99).await.is_empty());
    for _ in 0..2 {
        ledger.end_with_address(refused.id).await.unwrap();
    }
    // Whoever has the address may send again for so long.
    assert!(ended(9).await.is_empty());
    assert_eq!(ended(10).await, [refused.id]);
    assert_eq!(ended(101).await, [refused.id, left.id]);
    assert_eq!(ledger.ended_reservations(at(101), 1).await.unwrap(), [refused.id]);
    assert_eq!(ledger.usage(OURS).await.unwrap().bytes(), 30);
    ledger.release_upload(refused.id).await.unwrap();
    assert_eq!(ended(101).await, [left.id]);
}

pub(crate) async fn reservations_at_once_stay_within_the_limit(factory: &dyn Factory) {
    let ledgers = factory.open_several(3).await;
    let reserving = (0..12).map(|i| {
        let ledger = ledgers[i % ledgers.len()].clone();
        tokio::spawn(async move { ledger.reserve_upload(reservation(30, 0), LIMIT).await.unwrap() })
    });
    let reserved = futures::future::join_all(reserving).await;
    assert_eq!(reserved.into_iter().filter(|done| *done.as_ref().unwrap()).count(), 3);
    assert_eq!(ledgers[0].usage(OURS).await.unwrap().bytes(), 90);
}
