//! Attempts of a job.
use guardsplat_proto::v1::JobAttempt;
use guardsplat_proto::v1::job_attempt::Outcome;
use serde::Serialize;

use super::job::FailureReport;
use super::text::{time, word};

/// One time that a worker was given a job.
#[derive(Debug, Serialize)]
pub struct AttemptReport {
    number: i32,
    worker: String,
    start_time: Option<String>,
    end_time: Option<String>,
    /// `running` while it has not ended.
    outcome: String,
    failure: Option<FailureReport>,
}

impl From<&JobAttempt> for AttemptReport {
    fn from(attempt: &JobAttempt) -> Self {
        Self {
            number: attempt.number,
            worker: attempt.worker.clone(),
            start_time: time(attempt.start_time),
            end_time: time(attempt.end_time),
            outcome: outcome_word(attempt),
            failure: attempt.failure.as_ref().map(Into::into),
        }
    }
}

/// How an attempt ended, as a word.
pub fn outcome_word(attempt: &JobAttempt) -> String {
    match attempt.outcome() {
        Outcome::Unspecified => "running".into(),
        outcome => word(outcome.as_str_name(), "OUTCOME_"),
    }
}
