//! What every ledger must do with the generation of its store.
use uuid::Uuid;

use super::super::Generation;
use super::Factory;
use super::fixture::*;

pub async fn a_generation_follows_another(factory: &dyn Factory) {
    let ledger = factory.open().await;
    assert_eq!(ledger.generation().await.unwrap(), None);
    let [one, two, three] = [(); 3].map(|()| Uuid::now_v7());
    let first = Generation {
        current: one,
        previous: None,
        time: at(1),
    };
    assert_eq!(ledger.advance_generation(None, one, at(1)).await.unwrap(), first);
    // Another server that begins at the same time.
    assert_eq!(ledger.advance_generation(None, two, at(2)).await.unwrap(), first);
    let second = Generation {
        current: two,
        previous: Some(one),
        time: at(3),
    };
    assert_eq!(ledger.advance_generation(Some(one), two, at(3)).await.unwrap(), second);
    // One that was slower.
    assert_eq!(
        ledger.advance_generation(Some(one), three, at(4)).await.unwrap(),
        second
    );
    drop(ledger);
    assert_eq!(factory.open().await.generation().await.unwrap(), Some(second));
}
