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
mod tests;
