//! What a refused call says: the status, and the google.rpc details that came with it.
use std::collections::BTreeMap;
use std::fmt;
use std::time::Duration;

use serde::Serialize;
use tonic::{Code, Status};
use tonic_types::StatusExt;

use crate::output::printable;

/// A status in the words of its details.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Details {
    /// The gRPC code, as `NOT_FOUND`.
    pub code: String,
    /// For people.
    pub message: String,
    /// For programs, as `RESOURCE_EXHAUSTED`.
    pub reason: Option<String>,
    /// What is wrong with which field of the request.
    pub field_violations: Vec<Violation>,
    /// What the error is about, as `keys/…`.
    pub resource: Option<String>,
    /// Figures and names that go with the reason.
    pub metadata: BTreeMap<String, String>,
    /// When to try again.
    pub retry_after_seconds: Option<f64>,
}

/// What is wrong with a field.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Violation {
    /// Path of the field in the request.
    pub field: String,
    /// What is wrong.
    pub description: String,
}

impl From<&Status> for Details {
    fn from(status: &Status) -> Self {
        let details = status.get_error_details();
        let info = details.error_info();
        let violations = details.bad_request().map(|bad| &bad.field_violations[..]);
        Self {
            code: code_name(status.code()),
            message: status.message().to_owned(),
            reason: info.map(|info| info.reason.clone()),
            field_violations: violations
                .unwrap_or_default()
                .iter()
                .map(|violation| Violation {
                    field: violation.field.clone(),
                    description: violation.description.clone(),
                })
                .collect(),
            resource: details.resource_info().map(|resource| resource.resource_name.clone()),
            metadata: info
                .map(|info| info.metadata.clone().into_iter().collect())
                .unwrap_or_default(),
            retry_after_seconds: retry_delay(status).map(|delay| delay.as_secs_f64()),
        }
    }
}

/// How long the server asks to be left alone.
pub fn retry_delay(status: &Status) -> Option<Duration> {
    status.get_details_retry_info().and_then(|info| info.retry_delay)
}

/// `NotFound` as `NOT_FOUND`, which is how the specification writes it.
fn code_name(code: Code) -> String {
    let mut name = String::new();
    for letter in format!("{code:?}").chars() {
        if letter.is_ascii_uppercase() && !name.is_empty() {
            name.push('_');
        }
        name.push(letter.to_ascii_uppercase());
    }
    name
}

impl fmt::Display for Details {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let message = if self.message.is_empty() {
            "no reason given"
        } else {
            &self.message
        };
        write!(f, "{} ({}", printable(message), self.code)?;
        if let Some(reason) = self.reason.as_ref().filter(|reason| **reason != self.code) {
            write!(f, ", {}", printable(reason))?;
        }
        write!(f, ")")?;
        for violation in &self.field_violations {
            let text = format!("{}: {}", violation.field, violation.description);
            // The message may be made of them, or be the only one.
            if !self.message.contains(&text) && self.message != violation.description {
                write!(f, "\n  {}", printable(&text))?;
            }
        }
        if let Some(resource) = &self.resource
            && !self.message.contains(resource)
        {
            write!(f, "\n  about {}", printable(resource))?;
        }
        if let Some(seconds) = self.retry_after_seconds {
            write!(f, "\n  try again in {seconds:.0} s")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tonic_types::ErrorDetails;

    #[test]
    fn fields_and_reason_are_told() {
        let mut details = ErrorDetails::new();
        details
            .set_error_info("INVALID_FIELD", "guardsplat", [("limit".to_owned(), "8".to_owned())])
            .add_bad_request_violation("job.embed.message", "must be 8 digits")
            .set_resource_info("key", "keys/7", "", "")
            .set_retry_info(Some(Duration::from_secs(2)));
        let status = Status::with_error_details(Code::InvalidArgument, "the job is not valid", details);
        let told = Details::from(&status);
        assert_eq!(
            told.to_string(),
            "the job is not valid (INVALID_ARGUMENT, INVALID_FIELD)\n  job.embed.message: must be 8 digits\n  about \
             keys/7\n  try again in 2 s"
        );
        assert_eq!(told.metadata["limit"], "8");
        assert_eq!(told.retry_after_seconds, Some(2.0));
    }

    #[test]
    fn what_the_message_says_is_not_repeated() {
        let mut details = ErrorDetails::new();
        details
            .add_bad_request_violation("a", "is wrong")
            .add_bad_request_violation("b", "too");
        let status = Status::with_error_details(Code::InvalidArgument, "a: is wrong", details);
        assert_eq!(
            Details::from(&status).to_string(),
            "a: is wrong (INVALID_ARGUMENT)\n  b: too"
        );
    }

    #[test]
    fn one_violation_that_is_the_message_is_told_once() {
        let mut details = ErrorDetails::new();
        details.add_bad_request_violation("request_id", "request_id 7 was used for another job");
        let status = Status::with_error_details(Code::AlreadyExists, "request_id 7 was used for another job", details);
        assert_eq!(
            Details::from(&status).to_string(),
            "request_id 7 was used for another job (ALREADY_EXISTS)"
        );
    }

    #[test]
    fn a_reason_that_says_no_more_than_the_code_is_left_out() {
        let mut details = ErrorDetails::new();
        details.set_error_info("NOT_FOUND", "guardsplat", []);
        let told = Details::from(&Status::with_error_details(Code::NotFound, "no such key", details));
        assert_eq!(told.to_string(), "no such key (NOT_FOUND)");
        assert_eq!(told.reason.as_deref(), Some("NOT_FOUND"));
    }

    #[test]
    fn a_bare_status_is_told_too() {
        assert_eq!(
            Details::from(&Status::not_found("no such key")).to_string(),
            "no such key (NOT_FOUND)"
        );
        assert_eq!(Details::from(&Status::ok("")).code, "OK");
        assert!(
            Details::from(&Status::unknown(""))
                .to_string()
                .starts_with("no reason given")
        );
    }
}
