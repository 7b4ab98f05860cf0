//! How near a claim was: what only admins are told, in every way that a job is told of.
use guardsplat_proto::v1::artifact_service_client::ArtifactServiceClient;
use guardsplat_proto::v1::job::Result as JobResult;
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::verify_result::Verdict;
use guardsplat_proto::v1::{
    DownloadArtifactRequest, GetDownloadUrlRequest, GetJobRequest, ListJobsRequest, VerifyResult, WatchJobRequest,
};
use tonic::Code;

use super::calls::asking;
use super::claims::{bench, framed, logits, of_asset};
use super::harness::{Server, refused};
use crate::access::DEFAULT_PROJECT;
use crate::access::Scope::{Admin, Embed, Verify};
use crate::service::Limits;

/// What somebody is told of a job in all ways that there are.
async fn told(door: &Server, token: &str, job: &str) -> Vec<VerifyResult> {
    let mut jobs = JobServiceClient::new(door.channel.clone());
    let mut all = Vec::new();
    let get = GetJobRequest { name: job.into() };
    all.push(jobs.get_job(asking(token, get)).await.unwrap().into_inner());
    let list = jobs.list_jobs(asking(token, ListJobsRequest::default())).await;
    all.extend(
        list.unwrap()
            .into_inner()
            .jobs
            .into_iter()
            .filter(|other| other.name == job),
    );
    let watch = WatchJobRequest {
        name: job.into(),
        cursor: String::new(),
    };
    let mut watch = jobs.watch_job(asking(token, watch)).await.unwrap().into_inner();
    all.extend(watch.message().await.unwrap().unwrap().job);
    assert_eq!(all.len(), 3);
    let result = |job: guardsplat_proto::v1::Job| match job.result {
        Some(JobResult::VerifyResult(result)) => result,
        other => panic!("{other:?}"),
    };
    all.into_iter().map(result).collect()
}

#[tokio::test]
async fn how_near_a_claim_was_is_told_to_admins_only() {
    let bench = bench().await;
    let word = bench.word(0).await;
    let (first, second) = (&bench.assets[0].0, &bench.assets[1].0);
    let read = || vec![framed(0, logits(&word, 4))];
    let (missed, _) = bench.claimed(of_asset(second), read()).await;
    let (matched, _) = bench.claimed(of_asset(first), read()).await;
    let door = bench.server.with_a_door(Limits::default()).await;
    let shop = door.token(DEFAULT_PROJECT, &[Embed, Verify]).await;
    let admin = door.token(DEFAULT_PROJECT, &[Admin]).await;
    for (result, verdict) in [(&missed, Verdict::NoMatch), (&matched, Verdict::Match)] {
        let report = bench.job_of(result).await;
        for told in told(&door, &shop, &report).await {
            assert_eq!(told.verdict(), verdict);
            assert_eq!(
                (told.matched_bits, told.rank_sum, told.corrected_bits),
                (None, None, None),
                "{told:?}"
            );
            // Of a match what it had to be at most, and of anything else nothing.
            assert_eq!(
                told.p_value,
                told.threshold.filter(|_| verdict == Verdict::Match),
                "{told:?}"
            );
            assert_eq!((told.mean_abs_logit, told.view_agreement), (0.0, 0.0), "{told:?}");
            assert_eq!(told.framing, "");
            assert_eq!(
                (told.bits, told.needed_rank_sum, told.threshold),
                (64, result.needed_rank_sum, Some(1e-6))
            );
        }
        for told in told(&door, &admin, &report).await {
            assert_eq!(&told, result);
        }
        // The reports have all of it.
        let mut artifacts = ArtifactServiceClient::new(door.channel.clone());
        for name in [&result.evidence_html, &result.evidence_json] {
            let download = || DownloadArtifactRequest {
                name: name.clone(),
                offset: 0,
            };
            let answer = artifacts.download_artifact(asking(&shop, download())).await;
            refused(answer.map(|_| ()), Code::PermissionDenied, "SCOPE_MISSING");
            let url = GetDownloadUrlRequest { name: name.clone() };
            let answer = artifacts.get_download_url(asking(&shop, url)).await;
            refused(answer, Code::PermissionDenied, "SCOPE_MISSING");
            let answer = artifacts.download_artifact(asking(&admin, download())).await;
            assert!(answer.unwrap().into_inner().message().await.unwrap().is_some());
        }
    }
}
