//! What metrics are told apart by: words of a few fixed sets, and never a name that somebody chose, so that the number
//! of series is bounded whatever is sent.
use guardsplat_proto::v1::failure::Reason;
use guardsplat_proto::v1::progress::Stage;
use prometheus_client::encoding::EncodeLabelSet;

use crate::access::METHODS;
use crate::ledger::{JobKind, JobState, Outcome};

/// What stands for a call that there is not.
const OTHER: &str = "other";

/// All kinds of jobs.
pub const KINDS: [JobKind; 3] = [JobKind::Embed, JobKind::Verify, JobKind::CreateKey];
/// All states in which a job is over.
pub const ENDS: [JobState; 3] = [JobState::Succeeded, JobState::Failed, JobState::Cancelled];
/// All stages of the work on a job.
pub const STAGES: [Stage; 4] = [Stage::Preparing, Stage::Optimising, Stage::Reading, Stage::Storing];
/// All ends of attempts.
pub const ATTEMPT_ENDS: [&str; 5] = ["succeeded", "failed", "lost", "cancelled", "released"];
/// All reasons of failures.
pub const REASONS: [Reason; 5] = [
    Reason::InvalidInput,
    Reason::TargetMissed,
    Reason::WorkerLost,
    Reason::Internal,
    Reason::AttemptsExhausted,
];
/// What workers compute on: all that there is, and what is none of it.
pub const DEVICES: [&str; 3] = ["cpu", "wgpu", OTHER];
/// Why calls are refused that others than the caller may want to know of: reasons of errors.
pub const REFUSALS: [&str; 11] = [
    "TOKEN_MISSING",
    "TOKEN_UNKNOWN",
    "TOKEN_EXPIRED",
    "TOKEN_REVOKED",
    "SCOPE_MISSING",
    "TOO_MANY_CALLS",
    "TOO_MANY_WATCHES",
    "TOO_MANY_TRANSFERS",
    "QUOTA_USED_UP",
    "QUEUE_FULL",
    "NO_SPACE",
];

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
pub struct OfKind {
    pub kind: &'static str,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
pub struct Ended {
    pub kind: &'static str,
    pub state: &'static str,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
pub struct AttemptEnded {
    pub kind: &'static str,
    pub outcome: &'static str,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
pub struct GivenUp {
    pub kind: &'static str,
    pub reason: &'static str,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
pub struct AtStage {
    pub kind: &'static str,
    pub stage: &'static str,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
pub struct Call {
    pub method: &'static str,
    pub code: &'static str,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
pub struct OfMethod {
    pub method: &'static str,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
pub struct Refused {
    pub reason: &'static str,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
pub struct Part {
    pub part: &'static str,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
pub struct Bytes {
    pub what: &'static str,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
pub struct Mark {
    pub recovered: &'static str,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
pub struct OnDevice {
    pub device: &'static str,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash, EncodeLabelSet)]
pub struct Build {
    pub version: &'static str,
}

/// The word for a kind of jobs.
pub fn kind(kind: JobKind) -> &'static str {
    match kind {
        JobKind::Embed => "embed",
        JobKind::Verify => "verify",
        JobKind::CreateKey => "create_key",
    }
}

/// The word for a state of jobs.
pub fn state(state: JobState) -> &'static str {
    match state {
        JobState::Queued => "queued",
        JobState::Running => "running",
        JobState::Succeeded => "succeeded",
        JobState::Failed => "failed",
        JobState::Cancelled => "cancelled",
    }
}

/// The word for a stage.
pub fn stage(stage: Stage) -> &'static str {
    match stage {
        Stage::Unspecified => "unspecified",
        Stage::Preparing => "preparing",
        Stage::Optimising => "optimising",
        Stage::Reading => "reading",
        Stage::Storing => "storing",
    }
}

/// The word for the end of an attempt.
pub fn outcome(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::UnderWay => "under_way",
        Outcome::Succeeded => "succeeded",
        Outcome::Failed => "failed",
        Outcome::Cancelled => "cancelled",
        Outcome::Released => "released",
    }
}

/// The reason of a failure, as the ledger has it.
pub fn reason(number: i32) -> &'static str {
    match Reason::try_from(number) {
        Ok(Reason::InvalidInput) => "invalid_input",
        Ok(Reason::TargetMissed) => "target_missed",
        Ok(Reason::WorkerLost) => "worker_lost",
        Ok(Reason::Internal) => "internal",
        Ok(Reason::AttemptsExhausted) => "attempts_exhausted",
        Ok(Reason::Unspecified) | Err(_) => "unspecified",
    }
}

/// A path as the label of a call, without the slash it begins with; one that is not in the table of calls is anybody's
/// invention.
pub fn method(path: &str) -> &'static str {
    let known = METHODS.iter().find(|(known, _)| *known == path);
    known.map_or(OTHER, |(path, _)| path.trim_start_matches('/'))
}

/// The word for what a worker computes on. It says so in words of its own, of which the first is one of a few.
pub fn device(said: &str) -> &'static str {
    let first = said.split(':').next().unwrap_or_default();
    DEVICES.into_iter().find(|known| *known == first).unwrap_or(OTHER)
}

/// The reason of a refusal, if it is one that is counted.
pub fn refusal(reason: &str) -> Option<&'static str> {
    REFUSALS.into_iter().find(|known| *known == reason)
}

/// A code of gRPC as it is written everywhere.
pub fn code(code: tonic::Code) -> &'static str {
    use tonic::Code::*;
    match code {
        Ok => "OK",
        Cancelled => "CANCELLED",
        Unknown => "UNKNOWN",
        InvalidArgument => "INVALID_ARGUMENT",
        DeadlineExceeded => "DEADLINE_EXCEEDED",
        NotFound => "NOT_FOUND",
        AlreadyExists => "ALREADY_EXISTS",
        PermissionDenied => "PERMISSION_DENIED",
        ResourceExhausted => "RESOURCE_EXHAUSTED",
        FailedPrecondition => "FAILED_PRECONDITION",
        Aborted => "ABORTED",
        OutOfRange => "OUT_OF_RANGE",
        Unimplemented => "UNIMPLEMENTED",
        Internal => "INTERNAL",
        Unavailable => "UNAVAILABLE",
        DataLoss => "DATA_LOSS",
        Unauthenticated => "UNAUTHENTICATED",
    }
}

/// The labels of a job that is over.
pub fn over(job: JobKind, end: JobState) -> Ended {
    Ended {
        kind: kind(job),
        state: state(end),
    }
}
