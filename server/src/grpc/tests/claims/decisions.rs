//! What becomes of markings and claims: verdicts, evidence, and what is refused.
use std::time::Duration;

use guardsplat_evidence::Verdict as Told;
use guardsplat_proto::v1::asset::Original;
use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::job::{Result as JobResult, Spec, State};
use guardsplat_proto::v1::key::State as KeyState;
use guardsplat_proto::v1::verify_result::Verdict;
use guardsplat_proto::v1::{EmbedSpec, UpdateKeyStateRequest, VerifyResult, VerifySpec};
use tonic::Code;
use uuid::Uuid;

use super::super::harness::{invalid, not_found, refused, sha256};
use super::super::registry::{asset, create_asset, create_owner};
use crate::service::Limits;

use super::{bench, bench_with, embed, framed, logits, of_asset, of_owner, search};

#[tokio::test]
async fn an_asset_is_marked_with_a_word_that_only_its_worker_is_told() {
    let bench = bench().await;
    let word = bench.word(0).await;
    // The same every time, and another one for each asset.
    assert_eq!(bench.word(0).await, word);
    assert_ne!(bench.word(1).await, word);
    let request = guardsplat_proto::v1::ListJobsRequest::default();
    let jobs = bench.server.jobs.clone().list_jobs(request).await.unwrap().into_inner();
    assert!(!format!("{jobs:?}").contains(&word));
    let Some(JobResult::EmbedResult(result)) = jobs.jobs[0].result.clone() else {
        panic!()
    };
    assert_eq!((result.message.as_str(), jobs.jobs[0].state()), ("", State::Succeeded));
    let checked = bench.report(&result.evidence_html).await;
    assert!(checked.holds(), "{checked:?}");
    let evidence = checked.evidence.unwrap();
    let read = evidence.verification.unwrap();
    let decision = read.decision.unwrap();
    assert_eq!(
        (read.verdict, decision.matched, decision.hypotheses),
        (Told::Match, 64, 3)
    );
    let hashes: Vec<_> = evidence.inputs.iter().map(|input| input.sha256.to_string()).collect();
    assert_eq!(hashes, [sha256(b"other"), sha256(b"marked")]);
}

#[tokio::test]
async fn what_can_not_be_marked_is_refused_by_field() {
    let bench = bench().await;
    let ((first, scene), (second, _)) = (&bench.assets[0], &bench.assets[1]);
    let nowhere = format!("assets/{}", Uuid::now_v7());
    assert_eq!(not_found(bench.embed(scene, &nowhere).await), nowhere);
    assert_eq!(invalid(bench.embed(scene, "assets/x").await), ["job.embed.asset"]);
    // Another original.
    assert_eq!(invalid(bench.embed(scene, second).await), ["job.embed.scene"]);
    // Two messages, or none.
    let both = EmbedSpec {
        message: "0".repeat(16),
        ..embed(&bench.key, scene, first)
    };
    assert_eq!(invalid(bench.submit(Spec::Embed(both)).await), ["job.embed.message"]);
    assert_eq!(invalid(bench.embed(scene, "").await), ["job.embed.message"]);
    // An asset of another key, and a key whose bits are too few.
    let short = bench.server.key(32, b"short key").await;
    let foreign = Spec::Embed(embed(&short, scene, first));
    assert_eq!(invalid(bench.submit(foreign).await), ["job.embed.asset"]);
    let new = asset(&bench.owners[0], &short, Original::Artifact(scene.clone()));
    let of_short = create_asset(&bench.server, new, "").await.unwrap().name;
    let spec = Spec::Embed(embed(&short, scene, &of_short));
    assert_eq!(invalid(bench.submit(spec).await), ["job.embed.key"]);
    let revoke = UpdateKeyStateRequest {
        name: bench.key.clone(),
        state: KeyState::Revoked.into(),
        reason: "stolen".into(),
    };
    bench.server.keys.clone().update_key_state(revoke).await.unwrap();
    refused(bench.embed(scene, first).await, Code::FailedPrecondition, "KEY_REVOKED");
    refused(
        bench.verify(of_asset(first)).await,
        Code::FailedPrecondition,
        "KEY_REVOKED",
    );
}

#[tokio::test]
async fn a_claim_is_decided_by_the_server_and_leaves_evidence() {
    let bench = bench().await;
    let word = bench.word(0).await;
    let read = || vec![framed(0, logits(&word, 4))];
    let (first, second) = (&bench.assets[0].0, &bench.assets[1].0);

    let (result, checked) = bench.claimed(of_asset(first), read()).await;
    assert_eq!(result.verdict(), Verdict::Match);
    assert_eq!((&result.asset, &result.owner), (first, &bench.owners[0]));
    assert_eq!(
        (result.matched_bits, result.rank_sum, result.bits),
        (Some(60), Some(2004), 64)
    );
    assert_eq!((result.payload_number, result.corrected_bits), (Some(1), Some(4)));
    // All three assets of the key are paid for, though one was named.
    assert_eq!((result.hypotheses, result.framings, result.assets), (Some(3), 1, 1));
    assert_eq!((result.assets_paid, result.readings_paid), (3, 1));
    assert!(result.p_value.unwrap() < 1e-10 && result.threshold == Some(1e-6));
    let told = checked.evidence.unwrap();
    assert_eq!((told.engine.as_str(), told.key.id), ("a test", bench.key.clone()));
    let worker = told.worker.unwrap();
    assert_eq!((worker.name.as_str(), worker.attempt), ("test", 1));
    let told = told.verification.unwrap();
    assert!(told.found.unwrap().owner.starts_with("Studio Nord (owners/"));
    assert_eq!(told.strip.len(), 64);

    // Another asset's mark is not there.
    let (result, _) = bench.claimed(of_asset(second), read()).await;
    assert_eq!((result.verdict(), result.asset.as_str()), (Verdict::NoMatch, ""));
    assert_eq!((result.payload_number, result.hypotheses), (None, Some(3)));

    // Whatever is claimed, all assets of the key are paid for; and each way of reading.
    let (result, _) = bench.claimed(of_owner(&bench.owners[0]), read()).await;
    assert_eq!(
        (result.verdict(), &result.asset, result.hypotheses),
        (Verdict::Match, first, Some(3))
    );
    let (result, _) = bench.claimed(of_owner(&bench.owners[1]), read()).await;
    assert_eq!((result.verdict(), result.assets), (Verdict::NoMatch, 1));
    let two = vec![framed(0, vec![-1.0; 64]), framed(3, logits(&word, 4))];
    let (result, checked) = bench.claimed(search(), two).await;
    assert_eq!((result.verdict(), &result.asset), (Verdict::Match, first));
    assert_eq!(
        (
            result.hypotheses,
            result.framings,
            result.assets,
            result.framing.as_str()
        ),
        (Some(6), 2, 3, "turned by 270 degrees")
    );
    let tried = checked.evidence.unwrap().verification.unwrap().tried;
    assert_eq!((tried.owners, tried.assets, tried.framings.len()), (2, 3, 2));

    // A search that finds nothing shows nobody's word.
    let (result, checked) = bench.claimed(search(), vec![framed(0, vec![1.0; 64])]).await;
    assert_eq!(result.verdict(), Verdict::NoMatch);
    let strip = checked.evidence.unwrap().verification.unwrap().strip;
    assert!(strip.len() == 64 && strip.iter().all(|bit| bit.wanted.is_none()));

    // Nothing that was read decides nothing.
    let (result, _) = bench
        .claimed(of_asset(first), vec![framed(0, vec![f32::NAN; 64])])
        .await;
    assert_eq!(result.verdict(), Verdict::Inconclusive);
    assert!(result.reason.contains("at most 0 of 64 bits"), "{}", result.reason);
}

#[tokio::test]
async fn claims_that_nothing_can_decide_say_why() {
    let mut bench = bench().await;
    let nobody = create_owner(&bench.server, "nobody", "").await.unwrap().name;
    let (result, checked) = bench.claimed(of_owner(&nobody), vec![framed(0, vec![1.0; 64])]).await;
    assert_eq!(
        (result.verdict(), result.assets, result.p_value),
        (Verdict::UnknownKey, 0, None)
    );
    assert!(result.reason.contains("no asset is registered"), "{}", result.reason);
    assert_eq!(
        checked.evidence.unwrap().verification.unwrap().verdict,
        Told::UnknownKey
    );
    // A key whose assets can't be marked.
    bench.key = bench.server.key(32, b"short key").await;
    let (result, _) = bench.claimed(search(), vec![framed(0, vec![1.0; 32])]).await;
    assert_eq!(result.verdict(), Verdict::Inconclusive);
    assert!(
        result.reason.contains("has 32 bits, and assets are marked with 64"),
        "{}",
        result.reason
    );
}

#[tokio::test]
async fn the_rate_is_a_setting_and_may_be_out_of_reach() {
    let limits = Limits {
        false_positive_rate: 2e-19,
        ..Limits::default()
    };
    let bench = bench_with(limits).await;
    let word = bench.word(0).await;
    let read = || vec![framed(0, logits(&word, 0))];
    let (result, _) = bench.claimed(of_asset(&bench.assets[0].0), read()).await;
    assert_eq!((result.verdict(), result.needed_rank_sum), (Verdict::Match, Some(2080)));
    // 2^-64 is 5.4e-20: four readings of three assets are too many.
    let four = (0..4).map(|turns| framed(turns, logits(&word, 0))).collect();
    let (result, checked) = bench.claimed(of_owner(&bench.owners[0]), four).await;
    assert_eq!(
        (result.verdict(), result.needed_rank_sum),
        (Verdict::Inconclusive, None)
    );
    let told = checked.evidence.unwrap().verification.unwrap();
    assert_eq!(told.reason, Some(guardsplat_evidence::Reason::TooManyHypotheses));
}

#[tokio::test]
async fn claims_and_readings_are_checked() {
    let bench = bench().await;
    let two = VerifySpec {
        search: true,
        ..of_asset(&bench.assets[0].0)
    };
    assert_eq!(invalid(bench.verify(two).await), ["job.verify.search"]);
    let malformed = VerifySpec {
        asset: "assets/x".into(),
        ..VerifySpec::default()
    };
    assert_eq!(invalid(bench.verify(malformed).await), ["job.verify.asset"]);
    for (collection, claim) in [("assets", of_asset as fn(&str) -> _), ("owners", of_owner)] {
        let nowhere = format!("{collection}/{}", Uuid::now_v7());
        assert_eq!(not_found(bench.verify(claim(&nowhere)).await), nowhere);
    }
    let job = bench.verify(search()).await.unwrap().name;
    let (_, token) = bench.server.take().await;
    let complete = async |readings| {
        let read = VerifyResult {
            verdict: Verdict::Inconclusive.into(),
            ..VerifyResult::default()
        };
        bench.complete(&job, &token, Output::VerifyResult(read), readings).await
    };
    assert_eq!(invalid(complete(Vec::new()).await), ["readings"]);
    let short = vec![framed(0, vec![1.0; 63])];
    assert_eq!(invalid(complete(short).await), ["readings[0].logits"]);
    let twice = vec![framed(0, vec![1.0; 64]); 2];
    assert_eq!(invalid(complete(twice).await), ["readings[1]"]);
    complete(vec![framed(0, vec![1.0; 64])]).await.unwrap();
    assert!(bench.server.lease(Duration::ZERO).await.job.is_none());
}
