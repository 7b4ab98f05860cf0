//! How long a search of many owners takes beside the extraction: a benchmark, run by hand with
//! `cargo test --release -p guardsplat-server --lib search_speed -- --ignored --nocapture`.
use std::time::{Duration, Instant};

use guardsplat_proto::v1::asset::Original;
use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::job::{Result as JobResult, Spec};
use guardsplat_proto::v1::verify_result::Verdict;
use guardsplat_proto::v1::{CompleteJobRequest, FramedReading, Job, Undone, VerifyResult, VerifySpec};

use super::harness::Server;
use super::registry::{asset, create_asset, create_owner};
use crate::service::Limits;
use crate::service::rate_limit::Rates;

/// Owners, with an asset each.
const OWNERS: u32 = 10_000;
/// Framings of pictures with borders: what a worker reads at most.
const FRAMINGS: u32 = 281;

/// What a scene without a mark reads, different in each framing; the same at every run.
fn framing(number: u32, seed: u32) -> FramedReading {
    let mut state = u64::from(seed) << 32 | u64::from(number);
    let mut next = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 23) as f32 - 1.0
    };
    FramedReading {
        views: 10,
        logits: (0..64).map(|_| next()).collect(),
        undone: Some(Undone {
            kind: 2,
            factor: 1.0 + number as f32 / 100.0,
            ..Undone::default()
        }),
        ..FramedReading::default()
    }
}

#[tokio::test(flavor = "multi_thread")]
#[ignore = "a benchmark of some minutes: ten thousand owners are registered"]
async fn ten_thousand_owners() {
    // Ten thousand owners at once are more than a caller may register.
    let rates = Rates {
        submissions: 0,
        claims: 0,
        calls: 0,
    };
    let limits = Limits {
        rates,
        ..Limits::default()
    };
    let server = Server::with(limits).await;
    let key = server.key(64, b"key file").await;
    let start = Instant::now();
    for number in 0..OWNERS {
        let owner = create_owner(&server, &format!("owner {number}"), "")
            .await
            .unwrap()
            .name;
        let original = Original::Sha256(format!("{number:064x}"));
        create_asset(&server, asset(&owner, &key, original), "").await.unwrap();
    }
    println!(
        "{OWNERS} owners and assets registered in {:.1} s",
        start.elapsed().as_secs_f64()
    );
    let suspect = server.upload("suspect.ply", b"suspect").await.name;
    let mut worst = Duration::ZERO;
    for seed in 0..10 {
        let spec = VerifySpec {
            suspects: vec![suspect.clone()],
            key: key.clone(),
            search: true,
            ..VerifySpec::default()
        };
        let job = Job {
            spec: Some(Spec::Verify(spec)),
            ..Job::default()
        };
        let job = server.submit(job, "").await.unwrap().into_inner().name;
        let (_, token) = server.take().await;
        let read = VerifyResult {
            verdict: Verdict::Inconclusive.into(),
            ..VerifyResult::default()
        };
        let request = CompleteJobRequest {
            name: job.clone(),
            lease_token: token,
            result: Some(Output::VerifyResult(read)),
            readings: (0..FRAMINGS).map(|number| framing(number, seed)).collect(),
            engine: "a benchmark".into(),
            ..CompleteJobRequest::default()
        };
        let start = Instant::now();
        server.worker.clone().complete_job(request).await.unwrap();
        let took = start.elapsed();
        let Some(JobResult::VerifyResult(result)) = server.job(&job).await.result else {
            panic!()
        };
        assert_eq!(result.hypotheses, Some(u64::from(OWNERS * FRAMINGS)));
        assert_eq!(result.verdict(), Verdict::NoMatch);
        println!(
            "search {seed}: {:.0} ms, p = {:.2}",
            1e3 * took.as_secs_f64(),
            result.p_value()
        );
        worst = worst.max(took);
    }
    println!("slowest: {:.0} ms, signed evidence included", 1e3 * worst.as_secs_f64());
}
