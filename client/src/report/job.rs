//! Jobs.
use guardsplat_proto::v1::job::{Result as Outcome, Spec};
use guardsplat_proto::v1::{EmbedSpec, Failure, Job, KeySpec, Progress, VerifySpec};
use serde::Serialize;

use super::embed::EmbedReport;
use super::key::KeyResultReport;
use super::text::{some, time, word};
use super::verify::VerifyReport;
use crate::distortion;

/// A job as it stands.
#[derive(Debug, Serialize)]
pub struct JobReport {
    name: String,
    display_name: String,
    /// `embed`, `verify` or `create_key`.
    kind: Option<&'static str>,
    spec: Option<SpecReport>,
    state: String,
    cancel_requested: bool,
    attempt: i32,
    max_attempts: i32,
    queue_position: Option<i64>,
    priority: Option<i32>,
    /// Why nobody could be given it, while that is so.
    waiting_reason: Option<String>,
    progress: Option<ProgressReport>,
    result: Option<ResultReport>,
    failure: Option<FailureReport>,
    create_time: Option<String>,
    update_time: Option<String>,
    start_time: Option<String>,
    end_time: Option<String>,
    retry_time: Option<String>,
}

/// What to do, by kind.
#[derive(Debug, Serialize)]
#[serde(untagged)]
enum SpecReport {
    Embed {
        scene: String,
        key: String,
        message: Option<String>,
        asset: Option<String>,
        preset: String,
        seed: u64,
        size: Option<u32>,
        force: bool,
        ignore_bad_rows: bool,
        /// Empty where the preset decides.
        robust_to: Vec<String>,
        credentials: bool,
    },
    Verify {
        suspects: Vec<String>,
        key: String,
        message: Option<String>,
        asset: Option<String>,
        owner: Option<String>,
        search: bool,
        views: Option<u32>,
        size: Option<u32>,
        seed: u64,
        ignore_bad_rows: bool,
    },
    CreateKey {
        bits: u32,
        seeded: bool,
    },
}

#[derive(Debug, Serialize)]
struct ProgressReport {
    stage: String,
    done: i64,
    total: i64,
    bit_accuracy: Option<f64>,
    psnr_db: Option<f64>,
}

/// What came out, by kind.
#[derive(Debug, Serialize)]
#[serde(untagged)]
enum ResultReport {
    Embed(Box<EmbedReport>),
    Verify(Box<VerifyReport>),
    Key(KeyResultReport),
}

/// Why a job, or an attempt of it, failed.
#[derive(Debug, Serialize)]
pub struct FailureReport {
    reason: String,
    message: String,
}

impl From<&Job> for JobReport {
    fn from(job: &Job) -> Self {
        Self {
            name: job.name.clone(),
            display_name: job.display_name.clone(),
            kind: kind(job),
            spec: job.spec.as_ref().map(Into::into),
            state: word(job.state().as_str_name(), "STATE_"),
            cancel_requested: job.cancel_requested,
            attempt: job.attempt,
            max_attempts: job.max_attempts,
            queue_position: job.queue_position,
            priority: job.priority,
            waiting_reason: some(&job.waiting_reason),
            progress: job.progress.as_ref().map(Into::into),
            result: job.result.as_ref().map(|result| match result {
                Outcome::EmbedResult(result) => ResultReport::Embed(Box::new(result.into())),
                Outcome::VerifyResult(result) => ResultReport::Verify(Box::new(result.into())),
                Outcome::KeyResult(result) => ResultReport::Key(result.into()),
            }),
            failure: job.failure.as_ref().map(Into::into),
            create_time: time(job.create_time),
            update_time: time(job.update_time),
            start_time: time(job.start_time),
            end_time: time(job.end_time),
            retry_time: time(job.retry_time),
        }
    }
}

/// What kind of job it is.
pub fn kind(job: &Job) -> Option<&'static str> {
    Some(match job.spec.as_ref()? {
        Spec::Embed(_) => "embed",
        Spec::Verify(_) => "verify",
        Spec::CreateKey(_) => "create_key",
    })
}

impl From<&Spec> for SpecReport {
    fn from(spec: &Spec) -> Self {
        let given = |n: u32| (n > 0).then_some(n);
        match spec {
            Spec::Embed(spec) => Self::Embed {
                scene: spec.scene.clone(),
                key: spec.key.clone(),
                message: some(&spec.message),
                asset: some(&spec.asset),
                preset: preset(spec),
                seed: spec.seed,
                size: given(spec.size),
                force: spec.force,
                ignore_bad_rows: spec.ignore_bad_rows,
                robust_to: distortion::names(spec),
                credentials: spec.credentials,
            },
            Spec::Verify(spec) => verify(spec, given(spec.views), given(spec.size)),
            // A seed is as good as the key: it is not printed.
            Spec::CreateKey(KeySpec { bits, seed, seeded }) => Self::CreateKey {
                bits: *bits,
                seeded: *seeded || seed.is_some(),
            },
        }
    }
}

fn verify(spec: &VerifySpec, views: Option<u32>, size: Option<u32>) -> SpecReport {
    SpecReport::Verify {
        suspects: spec.suspects.clone(),
        key: spec.key.clone(),
        message: some(&spec.message),
        asset: some(&spec.asset),
        owner: some(&spec.owner),
        search: spec.search,
        views,
        size,
        seed: spec.seed,
        ignore_bad_rows: spec.ignore_bad_rows,
    }
}

/// The preset of a job, where none means the recommended one.
pub fn preset(spec: &EmbedSpec) -> String {
    match word(spec.preset().as_str_name(), "PRESET_").as_str() {
        "unspecified" => "standard".into(),
        named => named.into(),
    }
}

impl From<&Progress> for ProgressReport {
    fn from(progress: &Progress) -> Self {
        Self {
            stage: word(progress.stage().as_str_name(), "STAGE_"),
            done: progress.done,
            total: progress.total,
            bit_accuracy: progress.bit_accuracy,
            psnr_db: progress.psnr_db,
        }
    }
}

impl From<&Failure> for FailureReport {
    fn from(failure: &Failure) -> Self {
        Self {
            reason: word(failure.reason().as_str_name(), "REASON_"),
            message: failure.message.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use guardsplat_proto::v1::job::State;

    #[test]
    fn a_job_has_all_fields_and_no_seed_of_a_key() {
        let mut job = Job {
            name: "jobs/7".into(),
            spec: Some(Spec::CreateKey(KeySpec {
                bits: 32,
                seed: Some(424_242),
                ..KeySpec::default()
            })),
            queue_position: Some(2),
            priority: Some(-3),
            ..Job::default()
        };
        job.set_state(State::Queued);
        let json = serde_json::to_value(JobReport::from(&job)).unwrap();
        assert_eq!(json["kind"], "create_key");
        assert_eq!(json["state"], "queued");
        assert_eq!(json["queue_position"], 2);
        assert_eq!(
            (&json["priority"], &json["waiting_reason"]),
            (&(-3).into(), &serde_json::Value::Null)
        );
        assert_eq!(json["spec"]["seeded"], true);
        assert!(json["result"].is_null() && json["failure"].is_null());
        assert!(!json.to_string().contains("424242"));
    }

    #[test]
    fn what_is_left_to_the_server_is_null() {
        let spec = Spec::Embed(EmbedSpec {
            scene: "artifacts/1".into(),
            ..EmbedSpec::default()
        });
        let json = serde_json::to_value(SpecReport::from(&spec)).unwrap();
        assert_eq!(json["preset"], "standard");
        assert!(json["size"].is_null());
    }
}
