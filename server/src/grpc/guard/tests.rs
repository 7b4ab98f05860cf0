//! Who tries tokens out is stopped before the ledger, and a new token works at once.
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};

use super::*;
use crate::access::Scopes;
use crate::ledger::{self, NewToken, TokenId};
use crate::service::rate_limit::Rates;

/// Tokens, and how often one was looked for.
#[derive(Default)]
struct Tokens {
    good: Mutex<Vec<[u8; 32]>>,
    asked: AtomicU32,
}

impl Tokens {
    fn make(&self, text: &str) {
        self.good.lock().unwrap().push(access::hash(text));
    }
}

#[async_trait::async_trait]
impl TokenLedger for Tokens {
    async fn find_token(&self, hash: &[u8; 32]) -> ledger::Result<Option<TokenRow>> {
        self.asked.fetch_add(1, Ordering::Relaxed);
        let known = self.good.lock().unwrap().contains(hash);
        Ok(known.then(|| TokenRow {
            id: TokenId::nil(),
            display_name: String::new(),
            project: "studio".into(),
            scopes: Scopes::all(),
            create_time: 0,
            expire_time: None,
            last_use_time: None,
            revoke_time: None,
        }))
    }

    async fn create_token(&self, _: NewToken, _: i64) -> ledger::Result<TokenRow> {
        unreachable!("the guard makes none")
    }

    async fn get_token(&self, _: TokenId) -> ledger::Result<Option<TokenRow>> {
        Ok(None)
    }

    async fn list_tokens(&self, _: Option<&str>, _: Option<(i64, TokenId)>, _: u32) -> ledger::Result<Vec<TokenRow>> {
        Ok(Vec::new())
    }

    async fn revoke_token(&self, _: TokenId, _: i64) -> ledger::Result<TokenRow> {
        unreachable!("the guard revokes none")
    }

    async fn touch_token(&self, _: TokenId, _: i64) -> ledger::Result<()> {
        Ok(())
    }
}

const PER_MINUTE: u32 = 10;

async fn call(guard: &Guard, token: &str, address: &str) -> Result<()> {
    let mut headers = HeaderMap::new();
    headers.insert("authorization", format!("Bearer {token}").parse().unwrap());
    let path = "/guardsplat.v1.JobService/ListJobs";
    let admitted = guard.admit(path, &headers, Some(address.parse().unwrap())).await;
    admitted.map(|_| ())
}

#[tokio::test]
async fn who_tries_tokens_out_does_not_reach_the_ledger_for_long() {
    let rates = Rates {
        calls: PER_MINUTE,
        ..Rates::default()
    };
    let ledger = Arc::new(Tokens::default());
    ledger.make("ours");
    let guard = Guard::tokens(Arc::new(Meter::new(rates)), ledger.clone(), None);
    let (here, there) = ("192.0.2.1", "192.0.2.2");
    call(&guard, "ours", here).await.unwrap();
    for i in 0..100 {
        let refused = call(&guard, &format!("guess {i}"), here).await.unwrap_err();
        match i < PER_MINUTE {
            true => assert!(matches!(refused, Error::TokenUnknown), "{i}: {refused}"),
            false => assert!(matches!(refused, Error::TooManyCalls { .. }), "{i}: {refused}"),
        }
    }
    let asked = ledger.asked.load(Ordering::Relaxed);
    assert!(asked <= 1 + PER_MINUTE + 1, "the ledger was asked {asked} times");
    // Whoever has a good one is not held up by who calls from beside them, nor is anybody elsewhere.
    call(&guard, "ours", here).await.unwrap();
    ledger.make("new");
    call(&guard, "new", there).await.unwrap();
    // And from here on it is known here too.
    call(&guard, "new", here).await.unwrap();
}

#[tokio::test]
async fn a_new_token_works_at_once_where_others_were_refused() {
    let ledger = Arc::new(Tokens::default());
    let guard = Guard::tokens(Arc::new(Meter::new(Rates::default())), ledger.clone(), None);
    let here = "192.0.2.1";
    for _ in 0..3 {
        call(&guard, "soon", here).await.unwrap_err();
    }
    ledger.make("soon");
    call(&guard, "soon", here).await.unwrap();
}
