//! What a hook is sent: a CloudEvents 1.0 message in structured JSON that says what became of a job. It has figures and
//! names, and never a message, a payload or a key.
use guardsplat_proto::v1::VerifyResult;
use guardsplat_proto::v1::failure::Reason;
use serde::Serialize;
use uuid::Uuid;

use crate::ledger::{
    ArtifactId, ArtifactRow, DeliveryRow, FailureReason, JobKind, JobResult, JobRow, JobSpec, JobState,
};
use crate::service::claims::Disclosure;
use crate::service::clock::text;

/// What such a message is, for the header.
pub const CONTENT_TYPE: &str = "application/cloudevents+json; charset=utf-8";

#[derive(Serialize)]
struct Event<'a> {
    specversion: &'static str,
    id: String,
    source: String,
    r#type: String,
    subject: String,
    time: String,
    datacontenttype: &'static str,
    data: Data<'a>,
}

#[derive(Serialize)]
struct Data<'a> {
    job: String,
    display_name: &'a str,
    kind: &'static str,
    state: &'static str,
    request_id: Option<String>,
    attempt: i32,
    create_time: String,
    end_time: String,
    artifacts: Vec<Artifact>,
    #[serde(skip_serializing_if = "Option::is_none")]
    figures: Option<Figures>,
    #[serde(skip_serializing_if = "Option::is_none")]
    failure_reason: Option<String>,
}

#[derive(Serialize)]
struct Artifact {
    role: &'static str,
    name: String,
    display_name: String,
    sha256: String,
    size_bytes: i64,
}

#[derive(Serialize)]
#[serde(untagged)]
enum Figures {
    Embed {
        bit_accuracy: f64,
        bit_accuracy_worst_view: f64,
        message_recovered: bool,
        psnr_db: Option<f64>,
        ssim: f64,
        lpips: Option<f64>,
        steps: u32,
        gaussians: u64,
        changed_gaussians: u64,
        target_missed: Vec<String>,
    },
    Verify {
        verdict: String,
        p_value: Option<f64>,
        threshold: Option<f64>,
        matched_bits: Option<u32>,
        rank_sum: Option<u32>,
        needed_rank_sum: Option<u32>,
        bits: u32,
        views: u32,
        bit_accuracy: Option<f64>,
        asset_registered_later: bool,
        asset: Option<String>,
        owner: Option<String>,
    },
    CreateKey {
        /// Its name.
        key: String,
        bit_accuracy_unseen: Option<f64>,
        bit_accuracy_unseen_noisy: Option<f64>,
    },
}

/// The type of the event that tells of such an end.
pub fn event_type(state: JobState) -> String {
    format!("guardsplat.job.{}.v1", word_of(state))
}

/// Artifacts that came out of a job, and what each is.
pub fn outputs(job: &JobRow) -> Vec<(&'static str, ArtifactId)> {
    let named = match &job.result {
        Some(JobResult::Embed(result)) => vec![
            ("scene", &result.scene),
            ("comparison", &result.comparison),
            ("evidence_html", &result.evidence_html),
            ("evidence_json", &result.evidence_json),
        ],
        Some(JobResult::Verify(result)) => vec![
            ("evidence_html", &result.evidence_html),
            ("evidence_json", &result.evidence_json),
        ],
        Some(JobResult::CreateKey(_)) | None => Vec::new(),
    };
    let id = |name: &str| Uuid::try_parse(name.strip_prefix("artifacts/")?).ok();
    let found = named.iter().filter_map(|(role, name)| Some((*role, id(name)?)));
    found.collect()
}

/// The message for a delivery; the same however often it is sent. Whoever receives it is no admin, whoever made the hook.
/// Raw verifications are told as `raw_allowed` has it.
pub fn body(
    delivery: &DeliveryRow,
    job: &JobRow,
    raw_allowed: bool,
    asked_id: Option<Uuid>,
    artifacts: Vec<(&'static str, ArtifactRow)>,
) -> Vec<u8> {
    let failure = job.failure.as_ref().filter(|_| job.state == JobState::Failed);
    let event = Event {
        specversion: "1.0",
        id: delivery.id.to_string(),
        source: format!("/guardsplat/projects/{}", delivery.project),
        r#type: event_type(delivery.job_state),
        subject: format!("jobs/{}", job.id),
        time: text(delivery.create_time),
        datacontenttype: "application/json",
        data: Data {
            job: format!("jobs/{}", job.id),
            display_name: &job.display_name,
            kind: match job.kind() {
                JobKind::Embed => "embed",
                JobKind::Verify => "verify",
                JobKind::CreateKey => "create_key",
            },
            state: word_of(delivery.job_state),
            request_id: asked_id.map(|id| id.to_string()),
            attempt: job.attempt,
            create_time: text(job.create_time),
            end_time: text(delivery.create_time),
            artifacts: artifacts.into_iter().map(artifact).collect(),
            figures: figures(job, Disclosure::Verdict { raw: raw_allowed }),
            failure_reason: failure.map(|failure| reason(failure.reason)),
        },
    };
    // Structs with text for keys always have a JSON form.
    serde_json::to_vec(&event).unwrap_or_default()
}

fn figures(job: &JobRow, disclosure: Disclosure) -> Option<Figures> {
    Some(match job.result.as_ref()? {
        JobResult::Embed(result) => Figures::Embed {
            bit_accuracy: result.bit_accuracy,
            bit_accuracy_worst_view: result.bit_accuracy_worst_view,
            message_recovered: result.message_recovered,
            psnr_db: result.psnr_db,
            ssim: result.ssim,
            lpips: result.lpips,
            steps: result.steps,
            gaussians: result.gaussians,
            changed_gaussians: result.changed_gaussians,
            target_missed: result.target_missed.clone(),
        },
        JobResult::Verify(result) => verified(match &job.spec {
            JobSpec::Verify(spec) => disclosure.result(spec, result.clone()),
            JobSpec::Embed(_) | JobSpec::CreateKey(_) => return None,
        }),
        JobResult::CreateKey(result) => Figures::CreateKey {
            key: result.key.clone(),
            bit_accuracy_unseen: result.bit_accuracy_unseen,
            bit_accuracy_unseen_noisy: result.bit_accuracy_unseen_noisy,
        },
    })
}

fn verified(result: VerifyResult) -> Figures {
    let some = |text: String| Some(text).filter(|text| !text.is_empty());
    Figures::Verify {
        verdict: word(result.verdict().as_str_name(), "VERDICT_"),
        p_value: result.p_value,
        threshold: result.threshold,
        matched_bits: result.matched_bits,
        rank_sum: result.rank_sum,
        needed_rank_sum: result.needed_rank_sum,
        bits: result.bits,
        views: result.views,
        bit_accuracy: result.bit_accuracy,
        asset_registered_later: result.asset_registered_later,
        asset: some(result.asset),
        owner: some(result.owner),
    }
}

fn artifact((role, row): (&'static str, ArtifactRow)) -> Artifact {
    Artifact {
        role,
        name: format!("artifacts/{}", row.id),
        display_name: row.display_name,
        sha256: row.sha256,
        size_bytes: row.size,
    }
}

fn reason(reason: FailureReason) -> String {
    // Numbers are those of the API.
    let known = Reason::try_from(reason as i32).unwrap_or_default();
    word(known.as_str_name(), "REASON_")
}

fn word(name: &str, prefix: &str) -> String {
    name.strip_prefix(prefix).unwrap_or(name).to_ascii_lowercase()
}

fn word_of(state: JobState) -> &'static str {
    match state {
        JobState::Queued => "queued",
        JobState::Running => "running",
        JobState::Succeeded => "succeeded",
        JobState::Failed => "failed",
        JobState::Cancelled => "cancelled",
    }
}

#[cfg(test)]
mod tests {
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
}
