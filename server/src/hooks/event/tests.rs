//! Events as they are sent.
use guardsplat_proto::v1::verify_result::Verdict;
use serde_json::Value;

use super::*;
use guardsplat_proto::v1::{EmbedSpec, KeyResult, VerifySpec};

use crate::ledger::{DeliveryState, Failure as Failed, KeyOrder, Progress, ResourceRequirements};

const SECRET: &str = "5ec2e75ec2e75ec2";

fn row(spec: JobSpec, state: JobState, result: Option<JobResult>) -> JobRow {
    JobRow {
        id: Uuid::from_u128(7),
        project: "studio".into(),
        display_name: "a \"scene\"".into(),
        spec,
        state,
        cancel_requested: false,
        attempt: 2,
        max_attempts: 3,
        progress: Some(Progress::default()),
        result,
        failure: None,
        create_time: 1_000_000,
        update_time: 2_000_001,
        start_time: Some(1_500_000),
        end_time: Some(2_000_001),
        run_after: None,
        revision: 5,
        trace_parent: None,
        priority: 0,
        requirements: ResourceRequirements::default(),
        queue_position: None,
    }
}

fn event(job: &JobRow) -> Value {
    let delivery = DeliveryRow {
        id: Uuid::from_u128(9),
        hook: Uuid::from_u128(1),
        project: job.project.clone(),
        job: job.id,
        job_state: job.state,
        state: DeliveryState::Pending,
        attempts: 1,
        last_error: String::new(),
        create_time: 2_000_001,
        since: 2_000_001,
        next_time: 3_000_000,
        last_time: None,
        end_time: None,
    };
    let body = body(&delivery, job, false, None, Vec::new());
    let text = String::from_utf8(body.clone()).unwrap();
    assert!(!text.contains(SECRET) && !text.contains("4711"), "{text}");
    serde_json::from_slice(&body).unwrap()
}

#[test]
fn what_a_suspect_says_is_left_out() {
    let result = VerifyResult {
        verdict: Verdict::NoMatch.into(),
        p_value: Some(0.25),
        matched_bits: Some(40),
        message: SECRET.into(),
        payload_number: Some(4711),
        evidence_json: format!("artifacts/{}", Uuid::from_u128(3)),
        evidence_html: "nonsense".into(),
        asset: "assets/7".into(),
        ..VerifyResult::default()
    };
    let job = row(
        JobSpec::Verify(VerifySpec {
            message: SECRET.into(),
            ..VerifySpec::default()
        }),
        JobState::Succeeded,
        Some(JobResult::Verify(result)),
    );
    assert_eq!(outputs(&job), [("evidence_json", Uuid::from_u128(3))]);
    let event = event(&job);
    assert_eq!(event["type"], "guardsplat.job.succeeded.v1");
    assert_eq!(
        (&event["time"], &event["data"]["attempt"]),
        (&"1970-01-01T00:00:02.000001Z".into(), &2.into())
    );
    let figures = &event["data"]["figures"];
    assert_eq!(
        (&figures["verdict"], &figures["p_value"], &figures["matched_bits"]),
        (&"no_match".into(), &Value::Null, &Value::Null)
    );
    assert_eq!(
        (&figures["asset"], &figures["owner"]),
        (&"assets/7".into(), &Value::Null)
    );
}

#[test]
fn a_key_is_named_and_a_failure_has_its_reason() {
    let result = KeyResult {
        key: "keys/7".into(),
        bit_accuracy_unseen: Some(f64::NAN),
        ..KeyResult::default()
    };
    let made = event(&row(
        JobSpec::CreateKey(KeyOrder { bits: 64, seed: None }),
        JobState::Succeeded,
        Some(JobResult::CreateKey(result)),
    ));
    assert_eq!(made["data"]["figures"]["key"], "keys/7");
    // What is no number has no form in JSON.
    assert_eq!(made["data"]["figures"]["bit_accuracy_unseen"], Value::Null);
    let failed = JobRow {
        failure: Some(Failed {
            reason: FailureReason::TargetMissed,
            message: format!("read {SECRET}"),
        }),
        ..row(
            JobSpec::Embed(EmbedSpec {
                message: SECRET.into(),
                ..EmbedSpec::default()
            }),
            JobState::Failed,
            None,
        )
    };
    let told = event(&failed);
    assert_eq!(
        (&told["data"]["failure_reason"], &told["data"]["state"]),
        (&"target_missed".into(), &"failed".into())
    );
    assert_eq!(
        (&told["data"]["figures"], &told["data"]["display_name"]),
        (&Value::Null, &"a \"scene\"".into())
    );
    // A job that was cancelled between attempts has a failure, and did not end by it.
    let cancelled = JobRow {
        state: JobState::Cancelled,
        ..failed
    };
    assert_eq!(event(&cancelled)["data"]["failure_reason"], Value::Null);
}
