//! What every ledger must do with tokens.
use uuid::Uuid;

use super::super::access::{NewToken, TokenRow};
use super::super::{Ledger, LedgerError};
use super::Factory;
use super::fixture::{at, refused};
use crate::access::{Scope, Scopes};

/// Makes a test of each function here, as `conformance_suite!` does of the others.
macro_rules! access_suite {
    ($factory:expr) => {
        $crate::ledger::conformance::conformance_suite!(@tests $factory;
            a_token_is_kept_and_found_by_its_hash
            a_revoked_token_stays_revoked
            the_use_of_a_token_is_noted
            tokens_come_in_pages_of_their_project
        );
    };
}
pub(crate) use access_suite;

fn new_token(project: &str) -> NewToken {
    let id = Uuid::now_v7();
    let mut hash = [7; 32];
    hash[..16].copy_from_slice(id.as_bytes());
    NewToken {
        id,
        hash,
        display_name: "the shop".into(),
        project: project.into(),
        scopes: [Scope::Embed, Scope::Worker].into_iter().collect(),
        expire_time: Some(at(90)),
    }
}

async fn keep(ledger: &dyn Ledger, new: &NewToken, now: i64) -> TokenRow {
    ledger.create_token(new.clone(), now).await.expect("a token is kept")
}

pub async fn a_token_is_kept_and_found_by_its_hash(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let new = new_token("studio");
    let kept = keep(&*ledger, &new, at(1)).await;
    let expected = TokenRow {
        id: new.id,
        display_name: "the shop".into(),
        project: "studio".into(),
        scopes: new.scopes,
        create_time: at(1),
        expire_time: Some(at(90)),
        last_use_time: None,
        revoke_time: None,
    };
    assert_eq!(kept, expected);
    assert_eq!(ledger.find_token(&new.hash).await.unwrap(), Some(expected.clone()));
    assert_eq!(ledger.get_token(new.id).await.unwrap(), Some(expected.clone()));
    let mut other = new.hash;
    other[31] ^= 1;
    assert_eq!(ledger.find_token(&other).await.unwrap(), None);
    assert_eq!(ledger.get_token(Uuid::now_v7()).await.unwrap(), None);
    // Two tokens never share a hash: one of them could be used with the rights of the other.
    let twin = NewToken {
        id: Uuid::now_v7(),
        ..new
    };
    refused!(ledger.create_token(twin, at(2)).await, LedgerError::Database(_));
    drop(ledger);
    let ledger = factory.open().await;
    assert_eq!(ledger.find_token(&new.hash).await.unwrap(), Some(expected));
}

pub async fn a_revoked_token_stays_revoked(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let new = new_token("studio");
    let other = keep(&*ledger, &new_token("studio"), at(1)).await;
    keep(&*ledger, &new, at(1)).await;
    for now in [at(5), at(9)] {
        let revoked = ledger.revoke_token(new.id, now).await.unwrap();
        assert_eq!(revoked.revoke_time, Some(at(5)));
        assert_eq!(ledger.find_token(&new.hash).await.unwrap(), Some(revoked));
    }
    assert_eq!(ledger.get_token(other.id).await.unwrap(), Some(other));
    refused!(
        ledger.revoke_token(Uuid::now_v7(), at(5)).await,
        LedgerError::NotFound { kind: "token", .. }
    );
}

pub async fn the_use_of_a_token_is_noted(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let new = NewToken {
        expire_time: None,
        scopes: Scopes::all(),
        ..new_token("studio")
    };
    keep(&*ledger, &new, at(1)).await;
    for (now, noted) in [(at(3), at(3)), (at(2), at(3)), (at(4), at(4))] {
        ledger.touch_token(new.id, now).await.unwrap();
        let row = ledger.get_token(new.id).await.unwrap().unwrap();
        assert_eq!((row.last_use_time, row.expire_time), (Some(noted), None));
        assert_eq!(row.scopes, Scopes::all());
    }
    ledger.touch_token(Uuid::now_v7(), at(4)).await.unwrap();
}

pub async fn tokens_come_in_pages_of_their_project(factory: &dyn Factory) {
    let ledger = factory.open().await;
    let mut expected = Vec::new();
    for i in 0..5 {
        // Some were made at the same time.
        let row = keep(&*ledger, &new_token("studio"), at(i / 2)).await;
        keep(&*ledger, &new_token("other"), at(i / 2)).await;
        expected.push(row);
    }
    expected.sort_by_key(|row| std::cmp::Reverse((row.create_time, row.id)));
    let mut found: Vec<TokenRow> = Vec::new();
    loop {
        let before = found.last().map(|row| (row.create_time, row.id));
        let page = ledger.list_tokens(Some("studio"), before, 2).await.unwrap();
        if page.is_empty() {
            break;
        }
        found.extend(page);
    }
    assert_eq!(found, expected);
    assert_eq!(ledger.list_tokens(None, None, 100).await.unwrap().len(), 10);
    assert_eq!(ledger.list_tokens(Some("nobody"), None, 100).await.unwrap(), []);
}
