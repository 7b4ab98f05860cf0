//! What is expected of answers.
use std::fmt::Debug;
use std::time::Duration;

use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt};

/// Waits until `holds`, for a few seconds at most.
pub async fn soon(what: &str, mut holds: impl AsyncFnMut() -> bool) {
    for _ in 0..300 {
        if holds().await {
            return;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    panic!("{what} did not happen");
}

/// The details of an error with this code and reason; every error must have both.
#[track_caller]
pub fn refused<T: Debug>(answer: Result<T, Status>, code: Code, reason: &str) -> ErrorDetails {
    let status = answer.expect_err("was taken");
    let details = status.check_error_details().unwrap();
    let info = details
        .error_info()
        .unwrap_or_else(|| panic!("no ErrorInfo: {status:?}"));
    assert_eq!(
        (status.code(), info.reason.as_str(), info.domain.as_str()),
        (code, reason, "guardsplat"),
        "{status:?}"
    );
    details
}

/// As [`refused`], for fields that are wrong: their paths.
#[track_caller]
pub fn invalid<T: Debug>(answer: Result<T, Status>) -> Vec<String> {
    let details = refused(answer, Code::InvalidArgument, "INVALID_FIELD");
    let violations = &details.bad_request().expect("no BadRequest").field_violations;
    assert!(violations.iter().all(|violation| !violation.description.is_empty()));
    violations.iter().map(|violation| violation.field.clone()).collect()
}

/// As [`refused`], for resources that are not there: their names.
#[track_caller]
pub fn not_found<T: Debug>(answer: Result<T, Status>) -> String {
    let details = refused(answer, Code::NotFound, "NOT_FOUND");
    details.resource_info().expect("no ResourceInfo").resource_name.clone()
}
