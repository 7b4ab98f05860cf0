//! Owners, assets, the chain of commitments, and the states of keys.
use std::collections::HashMap;
use std::sync::Arc;

use futures::TryStreamExt;
use guardsplat_commitment::{Chain, FIRST, Link, Signed, SigningKey};
use uuid::Uuid;

use super::super::{
    AssetFilter, AssetRow, KeyId, KeyState, Ledger, LedgerError, NewAsset, NewOwner, OwnerId, OwnerRow, candidates,
};
use super::Factory;
use super::fixture::*;
use super::outputs::{make_key, make_key_of};

fn signer() -> Arc<SigningKey> {
    Arc::new(SigningKey::from_seed(&[7; 32]).unwrap())
}

fn new_owner() -> NewOwner {
    NewOwner {
        project: OURS.into(),
        id: Uuid::now_v7(),
        display_name: "studio".into(),
        request_id: None,
    }
}

pub(super) fn new_asset(owner: OwnerId, key: KeyId) -> NewAsset {
    let id = Uuid::now_v7();
    NewAsset {
        project: OURS.into(),
        id,
        commitment: Uuid::now_v7(),
        owner,
        display_name: "a robot".into(),
        sha256: [3; 32],
        artifact: None,
        key,
        sealed_nonce: id.as_bytes().to_vec(),
        nonce_hash: [4; 32],
        request_id: None,
    }
}

pub(super) async fn register(ledger: &dyn Ledger, new: NewAsset, now: i64) -> AssetRow {
    ledger
        .create_asset(new, signer(), now)
        .await
        .expect("an asset is registered")
}

/// An owner and a key.
pub(super) async fn owner_and_key(ledger: &dyn Ledger) -> (OwnerId, KeyId) {
    let owner = ledger.create_owner(new_owner(), at(0)).await.unwrap().id;
    (owner, make_key(ledger, at(0)).await.1.id)
}

/// The whole chain, which must hold, read in pages of two.
async fn chain(ledger: &dyn Ledger) -> Vec<Signed> {
    let mut checked = Chain::new(signer().public_key());
    let mut all = Vec::new();
    loop {
        let page = ledger.list_commitments(OURS, all.len() as i64, 2).await.unwrap();
        if page.is_empty() {
            break;
        }
        for signed in page {
            checked.push(&signed).expect("the chain holds");
            all.push(signed);
        }
    }
    let head = ledger.head(OURS).await.unwrap();
    assert_eq!(head.as_ref().map_or(Link::START, Link::at), checked.head());
    all
}

pub(crate) async fn an_asset_is_kept_and_committed_to(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let made = ledger.create_owner(new_owner(), at(1)).await.unwrap();
    let expected = OwnerRow {
        project: OURS.into(),
        id: made.id,
        display_name: "studio".into(),
        create_time: at(1),
    };
    assert_eq!(made, expected);
    assert_eq!(ledger.get_owner(made.id).await.unwrap(), Some(expected));
    let key = make_key(&*ledger, at(0)).await.1.id;
    assert_eq!(ledger.head(OURS).await.unwrap(), None);
    let upload = upload(&*ledger, at(1)).await;
    let artifact = Some(upload);
    let new = NewAsset {
        artifact,
        ..new_asset(made.id, key)
    };
    let asset = register(&*ledger, new.clone(), at(2)).await;
    let expected = AssetRow {
        project: OURS.into(),
        id: new.id,
        commitment: new.commitment,
        owner: made.id,
        display_name: "a robot".into(),
        sha256: [3; 32],
        artifact,
        key,
        payload: 1,
        create_time: at(2),
        reveal_time: None,
    };
    assert_eq!(asset, expected);
    assert_eq!(ledger.get_asset(new.id).await.unwrap(), Some(expected));

    let signed = ledger.get_commitment(new.commitment).await.unwrap().unwrap();
    signed.verify(&signer().public_key()).unwrap();
    let said = &signed.commitment;
    assert_eq!(
        (said.sequence, said.previous, said.payload, said.time),
        (1, FIRST, 1, at(2))
    );
    assert_eq!(
        (said.id, said.asset, said.owner, said.key),
        (new.commitment, new.id, made.id, key)
    );
    assert_eq!((said.sha256, said.nonce_hash), ([3; 32], [4; 32]));
    assert_eq!(chain(&*ledger).await, [signed]);
    // The artifact may go: the hash was taken.
    ledger.delete_artifact(upload, at(3)).await.unwrap();
    for nowhere in [made.id, key] {
        assert_eq!(ledger.get_asset(nowhere).await.unwrap(), None);
        assert_eq!(ledger.get_commitment(nowhere).await.unwrap(), None);
    }
}

pub(crate) async fn the_same_request_registers_once(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let request = Uuid::new_v4();
    let request_id = Some(request);
    let owner = |display_name: &str| NewOwner {
        request_id,
        display_name: display_name.into(),
        ..new_owner()
    };
    let first = ledger.create_owner(owner("studio"), at(0)).await.unwrap();
    assert_eq!(ledger.create_owner(owner("studio"), at(1)).await.unwrap(), first);
    refused!(ledger.create_owner(owner("other"), at(1)).await, LedgerError::RequestIdReused(id) if Some(id) == request_id);

    let key = make_key(&*ledger, at(0)).await.1.id;
    let asset = || NewAsset {
        request_id,
        ..new_asset(first.id, key)
    };
    assert_eq!(ledger.find_asset_request(request).await.unwrap(), None);
    let made = register(&*ledger, asset(), at(2)).await;
    assert_eq!(ledger.find_asset_request(request).await.unwrap(), Some(made.clone()));
    assert_eq!(register(&*ledger, asset(), at(3)).await, made);
    let others: [fn(&mut NewAsset); 4] = [
        |new| new.sha256[31] ^= 1,
        |new| new.display_name.push('2'),
        |new| new.owner = Uuid::now_v7(),
        |new| new.key = Uuid::now_v7(),
    ];
    for change in others {
        let mut other = asset();
        change(&mut other);
        let answer = ledger.create_asset(other, signer(), at(4)).await;
        refused!(answer, LedgerError::RequestIdReused(id) if Some(id) == request_id);
    }
    // Whatever has become of the key.
    ledger
        .update_key_state(key, KeyState::Revoked, "lost", at(5))
        .await
        .unwrap();
    assert_eq!(register(&*ledger, asset(), at(6)).await, made);
    assert_eq!(chain(&*ledger).await.len(), 1);
}

pub(crate) async fn one_registration_sent_many_times_at_once_is_one_asset(factory: &dyn Factory) {
    let ledgers = factory.open_several(4).await;
    let (owner, key) = owner_and_key(&*ledgers[0]).await;
    let request_id = Some(Uuid::new_v4());
    let tasks: Vec<_> = (0..20)
        .map(|i| {
            let ledger = ledgers[i % 4].clone();
            let new = NewAsset {
                request_id,
                ..new_asset(owner, key)
            };
            tokio::spawn(async move { register(&*ledger, new, at(1)).await })
        })
        .collect();
    let mut made = Vec::new();
    for task in tasks {
        made.push(task.await.unwrap());
    }
    made.dedup();
    assert_eq!((made.len(), made[0].payload), (1, 1));
    assert_eq!(chain(&*ledgers[0]).await.len(), 1);
}

pub(crate) async fn what_an_asset_needs_must_be_there(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let (owner, key) = owner_and_key(&*ledger).await;
    let nowhere = Uuid::now_v7();
    let create = |new: NewAsset| ledger.create_asset(new, signer(), at(1));
    refused!(create(new_asset(nowhere, key)).await, LedgerError::NotFound { kind: "owner", id } if id == nowhere);
    refused!(create(new_asset(owner, nowhere)).await, LedgerError::NotFound { kind: "key", id } if id == nowhere);
    for state in [KeyState::Retired, KeyState::Revoked] {
        ledger.update_key_state(key, state, "", at(2)).await.unwrap();
        refused!(
            create(new_asset(owner, key)).await,
            LedgerError::KeyNotActive { state: found, .. } if found == state
        );
    }
    assert_eq!(chain(&*ledger).await, []);
    assert_eq!(
        ledger
            .list_assets(OURS, AssetFilter::default(), None, 10)
            .await
            .unwrap(),
        []
    );
}

pub(crate) async fn registrations_at_once_make_one_chain_without_gaps(factory: &dyn Factory) {
    const EACH: usize = 20;
    let ledgers = factory.open_several(4).await;
    let ledger = &ledgers[0];
    let (owner, first) = owner_and_key(&**ledger).await;
    let second = make_key(&**ledger, at(0)).await.1.id;
    let tasks: Vec<_> = (0..8)
        .map(|task| {
            // Servers and keys in all pairs.
            let (ledger, key) = (ledgers[task / 2].clone(), [first, second][task % 2]);
            tokio::spawn(async move {
                for i in 0..EACH {
                    // Clocks that do not agree.
                    register(&*ledger, new_asset(owner, key), at((task * i) as i64)).await;
                }
            })
        })
        .collect();
    for task in tasks {
        task.await.unwrap();
    }
    let all = chain(&**ledger).await;
    assert_eq!(all.len(), 8 * EACH);
    let mut numbers: HashMap<KeyId, Vec<u64>> = HashMap::new();
    for signed in &all {
        let said = &signed.commitment;
        numbers.entry(said.key).or_default().push(said.payload);
        let asset = ledger.get_asset(said.asset).await.unwrap().unwrap();
        assert_eq!((asset.payload as u64, asset.commitment), (said.payload, said.id));
    }
    for key in [first, second] {
        let wanted: Vec<u64> = (1..=4 * EACH as u64).collect();
        assert_eq!(numbers[&key], wanted);
    }
}

pub(crate) async fn a_chain_goes_on_after_a_restart(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let (owner, key) = owner_and_key(&*ledger).await;
    let mut made = vec![register(&*ledger, new_asset(owner, key), at(10)).await];
    made.push(register(&*ledger, new_asset(owner, key), at(11)).await);
    let before = chain(&*ledger).await;
    drop(ledger);

    let ledger = factory.open().await;
    assert_eq!(chain(&*ledger).await, before);
    // With a clock that was set back: the asset keeps its time, and the chain goes on at the one it had.
    made.push(register(&*ledger, new_asset(owner, key), at(5)).await);
    let after = chain(&*ledger).await;
    assert_eq!(after[..2], before);
    assert_eq!((after[2].commitment.time, made[2].create_time), (at(11), at(5)));
    let numbers: Vec<i64> = made.iter().map(|asset| asset.payload).collect();
    assert_eq!(numbers, [1, 2, 3]);
    for asset in made {
        assert_eq!(ledger.get_asset(asset.id).await.unwrap(), Some(asset));
    }
    assert!(ledger.get_owner(owner).await.unwrap().is_some());
}

pub(crate) async fn payload_numbers_run_out(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let owner = ledger.create_owner(new_owner(), at(0)).await.unwrap().id;
    let key = make_key_of(&*ledger, 2, at(0)).await.1.id;
    for payload in 1..=3 {
        assert_eq!(register(&*ledger, new_asset(owner, key), at(1)).await.payload, payload);
    }
    let fourth = ledger.create_asset(new_asset(owner, key), signer(), at(2)).await;
    refused!(fourth, LedgerError::PayloadsUsedUp { limit: 3, .. });
    assert_eq!(chain(&*ledger).await.len(), 3);
}

pub(crate) async fn owners_and_assets_come_in_pages(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let (one, first) = owner_and_key(&*ledger).await;
    let two = ledger.create_owner(new_owner(), at(0)).await.unwrap().id;
    let second = make_key(&*ledger, at(0)).await.1.id;
    let mut all = Vec::new();
    for i in 0..9 {
        let (owner, key) = ([one, two][i % 2], [first, second, second][i % 3]);
        // Several at the same instant.
        all.insert(0, register(&*ledger, new_asset(owner, key), at(i as i64 / 3)).await);
    }
    let owners = [None, Some(one), Some(two), Some(Uuid::now_v7())];
    for owner in owners {
        for key in [None, Some(first), Some(second), Some(one)] {
            let filter = AssetFilter { owner, key };
            let (mut seen, mut before) = (Vec::new(), None);
            loop {
                let page = ledger.list_assets(OURS, filter, before, 2).await.unwrap();
                let Some(last) = page.last() else { break };
                assert!(page.len() <= 2);
                before = Some((last.create_time, last.id));
                seen.extend(page);
            }
            let fits = |asset: &&AssetRow| owner.is_none_or(|o| o == asset.owner) && key.is_none_or(|k| k == asset.key);
            let wanted: Vec<AssetRow> = all.iter().filter(fits).cloned().collect();
            assert_eq!(seen, wanted, "{filter:?}");
        }
    }
    let page = ledger.list_owners(OURS, None, 1).await.unwrap();
    let rest = ledger.list_owners(OURS, Some((at(0), page[0].id)), 5).await.unwrap();
    assert_eq!((page[0].id, rest.len(), rest[0].id), (two, 1, one));
}

pub(crate) async fn a_search_sees_every_asset_of_its_key_once(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let (owner, key) = owner_and_key(&*ledger).await;
    let other = make_key(&*ledger, at(0)).await.1.id;
    let mut wanted = Vec::new();
    for i in 0..7 {
        register(&*ledger, new_asset(owner, other), at(i)).await;
        wanted.push(register(&*ledger, new_asset(owner, key), at(-i)).await);
    }
    let seen: Vec<_> = candidates::of_key(&*ledger, key).try_collect().await.unwrap();
    assert_eq!(seen.len(), 7);
    for (seen, wanted) in seen.iter().zip(&wanted) {
        assert_eq!(
            (seen.asset, seen.owner, seen.payload),
            (wanted.id, wanted.owner, wanted.payload)
        );
        assert_eq!(seen.sealed_nonce, wanted.id.as_bytes());
        assert_eq!(ledger.candidate(wanted.id).await.unwrap().as_ref(), Some(seen));
    }
    let page = ledger.candidates(key, 2, 3).await.unwrap();
    assert_eq!(page, seen[2..5]);
    assert_eq!(ledger.candidates(key, 7, 3).await.unwrap(), []);
    assert_eq!(ledger.candidates(owner, 0, 3).await.unwrap(), []);
    assert_eq!(ledger.candidate(owner).await.unwrap(), None);
}

pub(crate) async fn keys_are_retired_and_revoked_for_good(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let key = make_key(&*ledger, at(0)).await.1.id;
    let update = |state, reason: &'static str, now| ledger.update_key_state(key, state, reason, now);
    let before = ledger.get_key(key).await.unwrap().unwrap();
    assert_eq!((before.state, before.state_time), (KeyState::Active, None));
    // Nothing changes where nothing is to change.
    assert_eq!(update(KeyState::Active, "again", at(1)).await.unwrap(), before);
    let retired = update(KeyState::Retired, "too short", at(2)).await.unwrap();
    assert_eq!(
        (retired.state, retired.state_reason.as_str(), retired.state_time),
        (KeyState::Retired, "too short", Some(at(2)))
    );
    assert_eq!(update(KeyState::Retired, "said again", at(3)).await.unwrap(), retired);
    refused!(
        update(KeyState::Active, "", at(4)).await,
        LedgerError::KeyStateFinal {
            state: KeyState::Retired,
            wanted: KeyState::Active,
            ..
        }
    );
    let revoked = update(KeyState::Revoked, "stolen", at(5)).await.unwrap();
    assert_eq!((revoked.state, revoked.state_time), (KeyState::Revoked, Some(at(5))));
    for state in [KeyState::Active, KeyState::Retired] {
        refused!(
            update(state, "", at(6)).await,
            LedgerError::KeyStateFinal {
                state: KeyState::Revoked,
                ..
            }
        );
    }
    assert_eq!(ledger.get_key(key).await.unwrap(), Some(revoked.clone()));
    assert_eq!(ledger.list_keys(OURS, None, 5).await.unwrap(), [revoked]);
    let nowhere = Uuid::now_v7();
    let answer = ledger.update_key_state(nowhere, KeyState::Revoked, "", at(7)).await;
    refused!(answer, LedgerError::NotFound { kind: "key", id } if id == nowhere);
}
