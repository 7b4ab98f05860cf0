//! Claims on pictures that were compared with an original: only the file that was registered counts as one. Any other could
//! have the mark in it, and give it to pictures that have none.
use guardsplat_evidence::{HypothesisKind, Role};
use guardsplat_proto::v1::undone::Kind;
use guardsplat_proto::v1::verify_result::Verdict;
use guardsplat_proto::v1::{FramedReading, Undone, VerifySpec};

use super::claims::{bench, framed, logits, of_asset, search};
use super::harness::invalid;

/// What the picture reads by itself, nothing, and what it reads beside the original.
fn compared(word: &str) -> Vec<FramedReading> {
    let beside = FramedReading {
        undone: Some(Undone {
            kind: Kind::Original.into(),
            factor: 1.0,
            ..Undone::default()
        }),
        ..framed(0, logits(word, 2))
    };
    let by_itself = (0..64).map(|i| if i % 3 == 0 { 1.0 } else { -1.0 }).collect();
    vec![framed(0, by_itself), beside]
}

#[tokio::test]
async fn an_asset_is_claimed_beside_its_own_original() {
    let bench = bench().await;
    let word = bench.word(0).await;
    let (asset, original) = bench.assets[0].clone();
    let spec = VerifySpec {
        original: original.clone(),
        ..of_asset(&asset)
    };
    let (result, checked) = bench.claimed(spec, compared(&word)).await;
    assert_eq!((result.verdict(), &result.asset), (Verdict::Match, &asset));
    assert_eq!(result.framing, "compared with the original, tones as given");
    assert!(checked.holds(), "{:#?}", checked.findings);
    let evidence = checked.evidence.unwrap();
    let files: Vec<_> = evidence.inputs.iter().map(|input| input.role).collect();
    assert_eq!(files, [Role::Suspect, Role::Original]);
    let tried = evidence.verification.unwrap().tried.framings;
    let kinds: Vec<_> = tried.iter().map(|group| (group.kind, group.tries)).collect();
    use HypothesisKind::{AsGiven, Registered};
    assert_eq!(kinds, [(AsGiven, Some(2)), (Registered, Some(2))]);
    // Another file is refused before any work, also one of the same owner.
    for (i, original) in [
        bench.assets[1].1.clone(),
        bench.server.upload("marked.ply", b"marked").await.name,
    ]
    .into_iter()
    .enumerate()
    {
        let spec = VerifySpec {
            original,
            ..of_asset(&asset)
        };
        assert_eq!(invalid(bench.verify(spec).await), ["job.verify.original"], "{i}");
    }
}

#[tokio::test]
async fn a_search_beside_an_original_is_for_its_assets() {
    let bench = bench().await;
    let word = bench.word(0).await;
    let beside = |original: String| VerifySpec { original, ..search() };
    let (found, _) = bench.claimed(beside(bench.assets[0].1.clone()), compared(&word)).await;
    assert_eq!((found.verdict(), &found.asset), (Verdict::Match, &bench.assets[0].0));
    // All assets of the key are paid for all the same.
    assert_eq!((found.assets, found.assets_paid), (1, 3));
    let (other, _) = bench.claimed(beside(bench.assets[1].1.clone()), compared(&word)).await;
    assert_eq!(other.verdict(), Verdict::NoMatch);
    // The marked scene itself, which would give its mark to whatever is compared with it, is refused before any work.
    let marked = bench.server.upload("marked.ply", b"marked").await.name;
    let answer = bench.verify(beside(marked)).await;
    let told = answer.as_ref().unwrap_err().message().to_owned();
    assert!(
        told.contains("from which no asset of this key was registered"),
        "{told}"
    );
    assert_eq!(invalid(answer), ["job.verify.original"]);
}

#[tokio::test]
async fn an_owner_is_claimed_beside_her_own_originals() {
    let bench = bench().await;
    // The first two assets are of the first owner.
    for (i, (_, original)) in bench.assets.iter().enumerate() {
        let spec = VerifySpec {
            owner: bench.owners[0].clone(),
            original: original.clone(),
            ..Default::default()
        };
        let answer = bench.verify(spec).await;
        match i {
            0 | 1 => drop(answer.unwrap()),
            _ => assert_eq!(invalid(answer), ["job.verify.original"]),
        }
    }
}
