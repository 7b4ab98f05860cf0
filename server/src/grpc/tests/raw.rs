//! Raw verification, which gives back every bit that was read: who may ask for it, and who is told.
use guardsplat_proto::v1::job::{Result as JobResult, Spec};
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::{CreateJobRequest, GetJobRequest, Job, VerifyResult, VerifySpec, verify_result::Verdict};
use tonic::{Code, Status};

use super::calls::asking;
use super::claims::{bench, search};
use super::harness::{Server, refused};
use crate::access::DEFAULT_PROJECT;
use crate::access::Scope::{Admin, Embed, Verify};
use crate::service::Limits;

async fn asked(door: &Server, token: &str, spec: VerifySpec) -> Result<Job, Status> {
    let request = CreateJobRequest {
        job: Some(Job {
            spec: Some(Spec::Verify(spec)),
            ..Job::default()
        }),
        request_id: String::new(),
    };
    let mut jobs = JobServiceClient::new(door.channel.clone());
    jobs.create_job(asking(token, request))
        .await
        .map(|answer| answer.into_inner())
}

async fn result(door: &Server, token: &str, job: &str) -> VerifyResult {
    let mut jobs = JobServiceClient::new(door.channel.clone());
    let request = GetJobRequest { name: job.into() };
    match jobs.get_job(asking(token, request)).await.unwrap().into_inner().result {
        Some(JobResult::VerifyResult(result)) => result,
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn every_bit_is_for_admins_unless_the_operator_says_otherwise() {
    let bench = bench().await;
    let suspect = bench.server.upload("suspect.ply", b"suspect").await.name;
    let spec = |more: VerifySpec| VerifySpec {
        suspects: vec![suspect.clone()],
        key: bench.key.clone(),
        ..more
    };
    let named = VerifySpec {
        message: "0123456789abcdef".into(),
        ..VerifySpec::default()
    };
    let door = bench.server.with_a_door(Limits::default()).await;
    let shop = door.token(DEFAULT_PROJECT, &[Embed, Verify]).await;
    let admin = door.token(DEFAULT_PROJECT, &[Verify, Admin]).await;
    for raw in [VerifySpec::default(), named] {
        let answer = asked(&door, &shop, spec(raw.clone())).await;
        let details = refused(answer, Code::PermissionDenied, "SCOPE_MISSING");
        assert_eq!(details.error_info().unwrap().metadata["scopes"], "admin");
        let job = asked(&door, &admin, spec(raw)).await.unwrap().name;
        let (_, token) = bench.server.take().await;
        let read = VerifyResult {
            verdict: Verdict::NoMatch.into(),
            message: "fedcba9876543210".into(),
            matched_bits: Some(20),
            p_value: Some(0.9),
            bit_accuracy: Some(0.25),
            mean_abs_logit: 3.0,
            ..VerifyResult::default()
        };
        let output = guardsplat_proto::v1::complete_job_request::Result::VerifyResult(read.clone());
        bench.server.complete(&job, &token, output).await.unwrap();
        assert_eq!(result(&door, &admin, &job).await.message, read.message);
        let told = result(&door, &shop, &job).await;
        assert_eq!(
            (
                told.verdict(),
                told.message.as_str(),
                told.matched_bits,
                told.p_value,
                told.bit_accuracy
            ),
            (Verdict::NoMatch, "", None, None, None)
        );
    }
    // A claim is for whoever may verify, as ever.
    asked(&door, &shop, spec(search())).await.unwrap();
}
