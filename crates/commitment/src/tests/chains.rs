//! A chain shows what was done to it.
use super::*;
use crate::{Chain, Error, Link};

/// A chain of so many, a second apart.
fn chain(length: u64) -> Vec<Signed> {
    let mut made: Vec<Signed> = Vec::new();
    for sequence in 1..=length {
        let previous = made.last().map_or(FIRST, Signed::hash);
        let time = 1_700_000_000_000_000 + sequence as i64 * 1_000_000;
        made.push(signing_key().sign(commitment(sequence, previous, time)));
    }
    made
}

/// Checks from the beginning.
fn check(signed: &[Signed]) -> Result<Link, Error> {
    let mut chain = Chain::new(signing_key().public_key());
    for next in signed {
        chain.push(next)?;
    }
    Ok(chain.head())
}

#[test]
fn a_whole_chain_holds() {
    assert_eq!(check(&[]), Ok(Link::START));
    let all = chain(5);
    let head = check(&all).unwrap();
    assert_eq!((head.sequence, head.hash), (5, all[4].hash()));
    // From a head that was published, only the rest is needed.
    let mut rest = Chain::after(signing_key().public_key(), Link::at(&all[2]));
    rest.push(&all[3]).unwrap();
    rest.push(&all[4]).unwrap();
    assert_eq!(rest.head(), head);
}

#[test]
fn what_is_missing_or_moved_shows() {
    let all = chain(5);
    for missing in 0..4 {
        let mut some = all.clone();
        some.remove(missing);
        let wanted = missing as u64 + 1;
        assert_eq!(
            check(&some),
            Err(Error::OutOfOrder {
                wanted,
                found: wanted + 1
            })
        );
    }
    let mut twice = all.clone();
    twice.insert(1, all[0].clone());
    assert_eq!(check(&twice), Err(Error::OutOfOrder { wanted: 2, found: 1 }));
    let mut swapped = all.clone();
    swapped.swap(1, 2);
    assert!(matches!(check(&swapped), Err(Error::OutOfOrder { .. })));
    // One cut off at the end does not show in the chain itself: that is what a published head is for.
    assert_eq!(check(&all[..4]).unwrap().sequence, 4);
}

/// Whoever has the signing key can put another one in its place, but not without changing all that follow.
#[test]
fn what_was_replaced_by_the_signer_shows() {
    let all = chain(4);
    let mut replaced = all.clone();
    let mut other = all[1].commitment.clone();
    other.owner = Uuid::from_bytes([6; 16]);
    replaced[1] = signing_key().sign(other);
    assert!(matches!(check(&replaced), Err(Error::NotLinked { sequence: 3, .. })));
}

#[test]
fn what_is_dated_back_or_signed_by_another_shows() {
    let all = chain(2);
    let mut late = commitment(3, all[1].hash(), all[1].commitment.time);
    check(&[&all[..], &[signing_key().sign(late.clone())]].concat()).unwrap();
    late.time -= 5;
    assert_eq!(
        check(&[&all[..], &[signing_key().sign(late.clone())]].concat()),
        Err(Error::BackDated {
            sequence: 3,
            earlier: 5
        })
    );
    late.time += 5;
    assert_eq!(
        check(&[&all[..], &[another_key().sign(late)]].concat()),
        Err(Error::BadSignature { sequence: 3 })
    );
    let end = Link {
        sequence: u64::MAX,
        ..Link::START
    };
    assert!(Chain::after(signing_key().public_key(), end).push(&all[0]).is_err());
}

#[test]
fn what_is_refused_leaves_the_chain_as_it_was() {
    let all = chain(2);
    let mut chain = Chain::new(signing_key().public_key());
    assert!(chain.push(&all[1]).is_err());
    assert_eq!(chain.head(), Link::START);
    chain.push(&all[0]).unwrap();
    chain.push(&all[1]).unwrap();
}
