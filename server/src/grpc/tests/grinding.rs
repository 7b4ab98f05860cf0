//! Claims of somebody who registers as many assets as it takes until one fits what an unmarked scene reads.
use std::collections::HashMap;
use std::time::Duration;

use guardsplat_evidence::{History, Reason, Verdict as Told};
use guardsplat_proto::v1::asset::Original;
use guardsplat_proto::v1::verify_result::Verdict;
use guardsplat_proto::v1::{VerifyResult, VerifySpec};

use super::claims::{Bench, bench, bench_with, framed, logits, of_asset, of_owner, search};
use super::registry::{asset, create_asset, create_owner};
use crate::service::{Limits, clock};

/// Assets of the attack, and the owners that they are spread over.
const ASSETS: usize = 3000;
const OWNERS: usize = 50;

/// What an unmarked scene reads: logits that have nothing to do with any word.
fn unmarked() -> Vec<f32> {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut next = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 23) as f32 - 1.0
    };
    (0..64).map(|_| next()).collect()
}

/// Registers assets of many owners, which cost nothing, by hashes of files that need not exist.
async fn registered(bench: &Bench) -> HashMap<String, Vec<String>> {
    let mut all = HashMap::new();
    for owner in 0..OWNERS {
        let name = create_owner(&bench.server, &format!("owner {owner}"), "")
            .await
            .unwrap()
            .name;
        let mut assets = Vec::new();
        for i in 0..ASSETS / OWNERS {
            let mut hash = [0; 32];
            hash[..8].copy_from_slice(&((owner << 32 | i) as u64).to_be_bytes());
            let new = asset(&name, &bench.key, Original::Sha256(hex::encode(hash)));
            assets.push(create_asset(&bench.server, new, "").await.unwrap().name);
        }
        all.insert(name, assets);
    }
    all
}

/// The attack at a scale that a test can pay for: a rate of 1 in 500, and six times as many assets.
#[tokio::test]
async fn whoever_registers_until_one_fits_gets_no_evidence_of_one_hypothesis() {
    let limits = Limits {
        false_positive_rate: 2e-3,
        ..Limits::default()
    };
    let bench = bench_with(limits).await;
    let registered = registered(&bench).await;
    let read = || vec![framed(0, unmarked())];
    // Owner by owner, as far as anybody is told how near each was; then asset by asset of the nearest.
    let mut nearest = Vec::new();
    for owner in registered.keys() {
        let (result, _) = bench.claimed(of_owner(owner), read()).await;
        nearest.push((result.rank_sum, owner));
    }
    nearest.sort();
    for asset in nearest.iter().rev().take(3).flat_map(|(_, owner)| &registered[*owner]) {
        let (result, checked) = bench.claimed(of_asset(asset), read()).await;
        if result.verdict() != Verdict::Match {
            continue;
        }
        let evidence = checked.evidence.unwrap().verification.unwrap();
        let decision = evidence.decision.unwrap();
        assert_eq!(evidence.verdict, Told::Match);
        assert!(
            decision.hypotheses as usize >= ASSETS,
            "evidence of {} hypothesis for one asset of {ASSETS}: {} of 64 bits, p = {:e}",
            decision.hypotheses,
            decision.matched,
            decision.p_value
        );
    }
}

/// The claim on an asset, on a suspect with these bytes.
async fn claimed_of(bench: &Bench, bytes: &[u8], spec: VerifySpec, logits: Vec<f32>) -> (VerifyResult, History) {
    let suspect = bench.server.upload("suspect.ply", bytes).await.name;
    let spec = VerifySpec {
        suspects: vec![suspect],
        ..spec
    };
    let (result, checked) = bench.claimed(spec, vec![framed(0, logits)]).await;
    (result, checked.evidence.unwrap().verification.unwrap().history.unwrap())
}

/// Only the word of an asset can match a file from before it by so many bits, and no word was drawn then: somebody chose.
#[tokio::test]
async fn an_asset_that_is_younger_than_its_suspect_is_no_match() {
    let mut bench = bench().await;
    let (early, _) = claimed_of(&bench, b"a scene", of_asset(&bench.assets[0].0), unmarked()).await;
    assert_eq!(early.verdict(), Verdict::NoMatch);
    assert!(!early.asset_registered_later && early.asset_commit_time.is_some());
    let scene = bench.server.upload("later.ply", b"later").await.name;
    let new = asset(&bench.owners[0], &bench.key, Original::Artifact(scene.clone()));
    let later = create_asset(&bench.server, new, "").await.unwrap().name;
    bench.assets.push((later.clone(), scene));
    let word = bench.word(3).await;

    let (result, history) = claimed_of(&bench, b"a scene", of_asset(&later), logits(&word, 0)).await;
    assert_eq!(
        (result.verdict(), result.matched_bits),
        (Verdict::Inconclusive, Some(64))
    );
    assert!(result.asset_registered_later && result.asset.is_empty());
    let micros = |time: Option<prost_types::Timestamp>| clock::micros_of(&time.unwrap()).unwrap();
    assert!(micros(result.first_seen_time) < micros(result.asset_commit_time));
    assert!(result.reason.contains("was registered at"), "{}", result.reason);
    assert!(history.registered_later());
    let registered = history.asset.unwrap();
    assert_eq!((registered.asset.as_str(), registered.sequence), (later.as_str(), 4));
    // Whatever names the asset, and also where another file of the suspect is new.
    for (spec, more) in [(search(), &b""[..]), (of_owner(&bench.owners[0]), b"new")] {
        let mut suspects = vec![bench.server.upload("suspect.ply", b"a scene").await.name];
        if !more.is_empty() {
            suspects.push(bench.server.upload("new.png", more).await.name);
        }
        let spec = VerifySpec { suspects, ..spec };
        let (result, checked) = bench.claimed(spec, vec![framed(0, logits(&word, 0))]).await;
        assert_eq!(result.verdict(), Verdict::Inconclusive);
        assert!(result.asset_registered_later);
        let told = checked.evidence.unwrap().verification.unwrap();
        assert_eq!((told.reason, told.found), (Some(Reason::RegisteredLater), None));
    }
    // A file that came after the asset may carry its mark.
    let (result, history) = claimed_of(&bench, b"a copy", of_asset(&later), logits(&word, 4)).await;
    assert_eq!(
        (result.verdict(), result.asset.as_str()),
        (Verdict::Match, later.as_str())
    );
    assert!(!result.asset_registered_later && !history.registered_later());
    assert_eq!(history.assets_of_owner, Some(3));
}

/// Other views, or another key, are other readings; each of the same file is paid for, and the same once more is free.
#[tokio::test]
async fn every_reading_of_a_file_is_paid_for() {
    let bench = bench().await;
    let word = bench.word(0).await;
    let first = || of_asset(&bench.assets[0].0);
    let seed = |seed| VerifySpec { seed, ..first() };
    let read = || logits(&word, 4);
    let paid = |result: &VerifyResult| (result.readings_paid, result.hypotheses);
    for (i, spec) in [first(), seed(1), seed(2)].into_iter().enumerate() {
        let count = i as u64 + 1;
        let (result, history) = claimed_of(&bench, b"a scene", spec, read()).await;
        assert_eq!(paid(&result), (count, Some(3 * count)));
        assert_eq!((history.readings_of_key, result.verdict()), (count, Verdict::Match));
    }
    // What was read before, uploaded anew and compared with whatever else: all assets were paid for then.
    let (result, _) = claimed_of(&bench, b"a scene", search(), read()).await;
    assert_eq!(paid(&result), (3, Some(9)));
    // Another file has not been read; what had been read with the key is told.
    let (result, history) = claimed_of(&bench, b"another", first(), read()).await;
    assert_eq!((paid(&result), history.readings_of_key), ((1, Some(3)), 4));
    // From other places it is another reading; from the same ones, sent again, the same.
    for name in ["cameras.json", "again.json"] {
        let cameras = bench.server.upload(name, b"[]").await.name;
        let spec = VerifySpec { cameras, ..first() };
        let (result, history) = claimed_of(&bench, b"a scene", spec, read()).await;
        assert_eq!((paid(&result), history.readings_of_key), ((4, Some(12)), 5));
    }
    // So it is where the scene is said to be of a kind, and is read from where viewers of such a scene are.
    let spec = VerifySpec {
        scene_kind: 2,
        ..first()
    };
    let (result, _) = claimed_of(&bench, b"a scene", spec, read()).await;
    assert_eq!(paid(&result), (5, Some(15)));
    // And where it is compared with the original, sent once or twice.
    for name in ["original.ply", "again.ply"] {
        let original = bench.server.upload(name, b"first").await.name;
        let spec = VerifySpec { original, ..first() };
        let (result, _) = claimed_of(&bench, b"a scene", spec, read()).await;
        assert_eq!(paid(&result), (6, Some(18)));
    }
    // A reading of several files pays for those of each.
    let mut suspects = Vec::new();
    for bytes in [&b"a scene"[..], b"another"] {
        suspects.push(bench.server.upload("suspect.ply", bytes).await.name);
    }
    let spec = VerifySpec { suspects, ..first() };
    let (result, _) = bench.claimed(spec, vec![framed(0, read())]).await;
    assert_eq!(paid(&result), (8, Some(24)));
}

/// A claim pays for all assets of the key, so whoever marks is held to as much.
#[tokio::test]
async fn a_mark_is_made_as_strong_as_a_claim_takes() {
    let bench = bench().await;
    let (asset, scene) = &bench.assets[0];
    bench.embed(scene, asset).await.unwrap();
    let lease = bench.server.lease(Duration::ZERO).await;
    assert_eq!(lease.false_positive_rate, 1e-6 / 3.0);
    bench.verify(search()).await.unwrap();
    assert_eq!(bench.server.lease(Duration::ZERO).await.false_positive_rate, 1e-6);
}
