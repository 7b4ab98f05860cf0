//! Named sets.
use super::varied;
use crate::attack::Attack;

#[test]
fn suites_are_read_without_repetition_and_begin_with_none() {
    for name in Attack::SUITES {
        let texts: Vec<String> = Attack::suite(name).unwrap().iter().map(Attack::to_string).collect();
        assert_eq!(texts[0], "none");
        let mut distinct = texts.clone();
        distinct.sort_unstable();
        distinct.dedup();
        assert_eq!(distinct.len(), texts.len(), "{name}");
    }
    let error = Attack::suite("papers").unwrap_err().to_string();
    assert_eq!(error, "suite: \"papers\" is none of paper, everyday, all");
}

#[test]
fn all_holds_the_others() {
    let all = Attack::suite("all").unwrap();
    for name in ["paper", "everyday"] {
        assert!(Attack::suite(name).unwrap().iter().all(|attack| all.contains(attack)));
    }
}

#[test]
fn every_attack_of_every_suite_works_on_a_small_picture() {
    for attack in Attack::suite("all").unwrap() {
        attack.apply(&varied(33, 21), 1, 0).unwrap();
    }
}
