//! What an error becomes on the wire: the one place that chooses codes and `google.rpc` details.
use std::collections::HashMap;
use std::time::Duration;

use tonic::{Code, Status};
use tonic_types::{ErrorDetails, FieldViolation, PreconditionViolation, QuotaViolation, StatusExt};

use crate::error::{Error, chain};

/// Domain of every `google.rpc.ErrorInfo`.
pub const DOMAIN: &str = "guardsplat";
/// When to try again what is not available.
const SOON: Duration = Duration::from_secs(1);

impl From<Error> for Status {
    fn from(error: Error) -> Self {
        let (code, reason) = kind(&error);
        let mut details = ErrorDetails::with_error_info(reason, DOMAIN, metadata(&error));
        add_details(&mut details, &error);
        if let Error::Internal { source, .. } | Error::Unavailable { source, .. } = &error {
            // Causes go to the log only: they speak of files and tables that are nobody else's business.
            tracing::error!(cause = %chain(source.as_ref()), "{error}");
        }
        Status::with_error_details(code, error.to_string(), details)
    }
}

/// The code of an error, and its reason for programs.
fn kind(error: &Error) -> (Code, &'static str) {
    match error {
        Error::Invalid(_) => (Code::InvalidArgument, "INVALID_FIELD"),
        Error::NotFound { .. } => (Code::NotFound, "NOT_FOUND"),
        Error::RequestIdReused { .. } => (Code::AlreadyExists, "REQUEST_ID_REUSED"),
        Error::Finished { .. } => (Code::FailedPrecondition, "JOB_FINISHED"),
        Error::NotFailed { .. } => (Code::FailedPrecondition, "JOB_NOT_FAILED"),
        Error::NotCancelled { .. } => (Code::FailedPrecondition, "CANCEL_NOT_REQUESTED"),
        Error::InUse { .. } => (Code::FailedPrecondition, "ARTIFACT_IN_USE"),
        Error::SceneDoesNotFit { .. } => (Code::FailedPrecondition, "SCENE_DOES_NOT_FIT"),
        Error::KeyNotActive { .. } => (Code::FailedPrecondition, "KEY_NOT_ACTIVE"),
        Error::KeyRevoked { .. } => (Code::FailedPrecondition, "KEY_REVOKED"),
        Error::KeyStateFinal { .. } => (Code::FailedPrecondition, "KEY_STATE_FINAL"),
        Error::PayloadsUsedUp { .. } => (Code::ResourceExhausted, "PAYLOADS_USED_UP"),
        Error::LeaseLost { .. } => (Code::Aborted, "LEASE_LOST"),
        Error::TokenMissing => (Code::Unauthenticated, "TOKEN_MISSING"),
        Error::TokenUnknown => (Code::Unauthenticated, "TOKEN_UNKNOWN"),
        Error::TokenExpired => (Code::Unauthenticated, "TOKEN_EXPIRED"),
        Error::TokenRevoked => (Code::Unauthenticated, "TOKEN_REVOKED"),
        Error::ScopeMissing { .. } | Error::ScopeNeeded { .. } => (Code::PermissionDenied, "SCOPE_MISSING"),
        Error::NoSuchCall => (Code::Unimplemented, "UNIMPLEMENTED"),
        Error::QueueFull { .. } => (Code::ResourceExhausted, "QUEUE_FULL"),
        Error::TooManyCalls { .. } => (Code::ResourceExhausted, "TOO_MANY_CALLS"),
        Error::TooManyWatches { .. } => (Code::ResourceExhausted, "TOO_MANY_WATCHES"),
        Error::TooManyTransfers { .. } => (Code::ResourceExhausted, "TOO_MANY_TRANSFERS"),
        Error::QuotaUsedUp { .. } => (Code::ResourceExhausted, "QUOTA_USED_UP"),
        Error::NoSpace => (Code::ResourceExhausted, "NO_SPACE"),
        Error::UploadStalled(_) => (Code::Aborted, "UPLOAD_STALLED"),
        Error::UploadTooSlow(_) => (Code::Aborted, "UPLOAD_TOO_SLOW"),
        Error::DeadlineExceeded => (Code::DeadlineExceeded, "DEADLINE_EXCEEDED"),
        // As where a connection is lost: a client that resumes a watch or a download then, resumes it now.
        Error::WatchStalled(_) => (Code::Unavailable, "WATCH_STALLED"),
        Error::DownloadStalled(_) => (Code::Unavailable, "DOWNLOAD_STALLED"),
        Error::Stopping => (Code::Unavailable, "STOPPING"),
        Error::Unavailable { .. } => (Code::Unavailable, "UNAVAILABLE"),
        Error::Internal { .. } | Error::Startup(_) => (Code::Internal, "INTERNAL"),
    }
}

/// What `google.rpc.ErrorInfo` says besides the reason.
fn metadata(error: &Error) -> HashMap<String, String> {
    let entries = match error {
        Error::InUse { name, job } => vec![("name", name.clone()), ("job", job.clone())],
        Error::Finished { name } | Error::NotFailed { name } | Error::LeaseLost { name } => {
            vec![("name", name.clone())]
        }
        Error::NotFound { name, .. } | Error::NotCancelled { name } => vec![("name", name.clone())],
        Error::KeyNotActive { name } => vec![("name", name.clone()), ("state", "retired".to_owned())],
        Error::KeyRevoked { name } => vec![("name", name.clone()), ("state", "revoked".to_owned())],
        Error::KeyStateFinal { name, state, .. } => vec![("name", name.clone()), ("state", (*state).to_owned())],
        Error::PayloadsUsedUp { name, limit } => vec![("name", name.clone()), ("limit", limit.to_string())],
        Error::RequestIdReused { request_id } => vec![("request_id", request_id.to_string())],
        Error::TooManyCalls { what, per_minute, .. } => {
            vec![("class", (*what).to_owned()), ("limit", per_minute.to_string())]
        }
        Error::QuotaUsedUp { limit, project, .. } => vec![("project", project.clone()), ("limit", limit.to_string())],
        Error::ScopeMissing { needed } => vec![("scopes", needed.join(","))],
        Error::ScopeNeeded { needed, .. } => vec![("scopes", (*needed).to_owned())],
        Error::QueueFull { limit, .. } => vec![("limit", limit.to_string())],
        Error::TooManyWatches { limit } | Error::TooManyTransfers { limit } => vec![("limit", limit.to_string())],
        Error::SceneDoesNotFit {
            name,
            gaussians,
            degree,
            needed,
            likely,
            limit,
        } => vec![
            ("name", name.clone()),
            ("gaussians", gaussians.to_string()),
            ("sh_degree", degree.to_string()),
            ("needed_bytes", needed.to_string()),
            ("likely_bytes", likely.to_string()),
            ("limit_bytes", limit.to_string()),
        ],
        _ => Vec::new(),
    };
    let entries = entries.into_iter().map(|(key, value)| (key.to_owned(), value));
    entries.collect()
}

fn add_details(details: &mut ErrorDetails, error: &Error) {
    match error {
        Error::Invalid(violations) => {
            let each = violations.iter().map(|v| FieldViolation::new(&v.field, &v.description));
            details.set_bad_request(each.collect::<Vec<_>>());
        }
        Error::RequestIdReused { .. } => {
            details.set_bad_request(vec![FieldViolation::new("request_id", error.to_string())]);
        }
        Error::PayloadsUsedUp { .. } => {
            details.set_bad_request(vec![FieldViolation::new("asset.key", error.to_string())]);
        }
        Error::NotFound { kind, name } => {
            details.set_resource_info(format!("guardsplat.v1/{kind}"), name, "", error.to_string());
        }
        Error::Finished { name }
        | Error::NotFailed { name }
        | Error::InUse { name, .. }
        | Error::NotCancelled { name }
        | Error::KeyNotActive { name }
        | Error::KeyRevoked { name }
        | Error::KeyStateFinal { name, .. }
        | Error::SceneDoesNotFit { name, .. } => {
            let violation = PreconditionViolation::new(kind(error).1, name, error.to_string());
            details.set_precondition_failure(vec![violation]);
        }
        Error::QueueFull { retry_after, .. } => {
            details.set_retry_info(Some(*retry_after));
        }
        Error::TooManyCalls { what, retry_after, .. } => {
            details.set_quota_failure(vec![QuotaViolation::new(*what, error.to_string())]);
            details.set_retry_info(Some(*retry_after));
        }
        Error::QuotaUsedUp { project, .. } => {
            details.set_quota_failure(vec![QuotaViolation::new(
                format!("project:{project}"),
                error.to_string(),
            )]);
        }
        Error::TooManyWatches { .. } => {
            details.set_quota_failure(vec![QuotaViolation::new("watches", error.to_string())]);
        }
        Error::TooManyTransfers { .. } => {
            details.set_quota_failure(vec![QuotaViolation::new("transfers", error.to_string())]);
        }
        Error::Stopping | Error::WatchStalled(_) | Error::DownloadStalled(_) | Error::Unavailable { .. } => {
            details.set_retry_info(Some(SOON));
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Violation;

    #[test]
    fn every_status_tells_its_reason() {
        let name = || "jobs/x".to_owned();
        let errors = [
            Error::invalid("job.display_name", "is too long"),
            Error::NotFound {
                kind: "job",
                name: name(),
            },
            Error::Finished { name: name() },
            Error::LeaseLost { name: name() },
            Error::QueueFull {
                limit: 3,
                retry_after: SOON,
            },
            Error::NoSpace,
            Error::internal("reading", "disk /dev/secret is gone"),
        ];
        for error in errors {
            let text = error.to_string();
            let status = Status::from(error);
            let info = status.get_details_error_info().expect(&text);
            assert_eq!(info.domain, "guardsplat");
            assert!(!info.reason.is_empty() && info.reason.bytes().all(|b| b.is_ascii_uppercase() || b == b'_'));
            assert_eq!(status.message(), text);
        }
    }

    #[test]
    fn details_fit_the_error() {
        let violation = |field: &str| Violation {
            field: field.into(),
            description: "is wrong".into(),
        };
        let status = Status::from(Error::Invalid(vec![violation("a.b"), violation("c")]));
        let fields = status.get_details_bad_request().unwrap().field_violations;
        assert_eq!(
            fields.iter().map(|f| f.field.as_str()).collect::<Vec<_>>(),
            ["a.b", "c"]
        );

        let status = Status::from(Error::QueueFull {
            limit: 3,
            retry_after: Duration::from_secs(9),
        });
        assert_eq!(status.code(), Code::ResourceExhausted);
        assert_eq!(
            status.get_details_retry_info().unwrap().retry_delay,
            Some(Duration::from_secs(9))
        );

        let status = Status::from(Error::InUse {
            name: "artifacts/1".into(),
            job: "jobs/2".into(),
        });
        assert_eq!(status.get_details_error_info().unwrap().metadata["job"], "jobs/2");
        assert_eq!(
            status.get_details_precondition_failure().unwrap().violations[0].subject,
            "artifacts/1"
        );

        let status = Status::from(Error::NotFound {
            kind: "key",
            name: "keys/1".into(),
        });
        assert_eq!(status.get_details_resource_info().unwrap().resource_name, "keys/1");
    }

    #[test]
    fn every_reason_is_documented() {
        let page = include_str!("../../../docs/api.md");
        let source = include_str!("status.rs");
        let table = source.split("fn kind(").nth(1).unwrap().split("\n}\n").next().unwrap();
        let reasons: Vec<_> = table.split('"').skip(1).step_by(2).collect();
        assert!(reasons.contains(&"LEASE_LOST") && reasons.len() > 12, "{reasons:?}");
        for reason in reasons {
            assert!(
                page.contains(&format!("`{reason}`")),
                "docs/api.md does not name {reason}"
            );
        }
    }

    #[test]
    fn causes_stay_inside() {
        let status = Status::from(Error::internal("reading", "disk /dev/secret is gone"));
        assert_eq!(status.message(), "reading failed");
        assert!(!String::from_utf8_lossy(status.details()).contains("secret"));
    }
}
