//! What the numbers in the tables stand for, whichever database they are in.
use super::registry::KeyState;
use super::types::{ArtifactState, JobKind, JobState};
use super::{LedgerError, Result};

pub(super) fn job_kind(value: i64) -> Result<JobKind> {
    match value {
        1 => Ok(JobKind::Embed),
        2 => Ok(JobKind::Verify),
        3 => Ok(JobKind::CreateKey),
        _ => Err(unknown("kind of job", value)),
    }
}

pub(super) fn job_state(value: i64) -> Result<JobState> {
    match value {
        1 => Ok(JobState::Queued),
        2 => Ok(JobState::Running),
        3 => Ok(JobState::Succeeded),
        4 => Ok(JobState::Failed),
        5 => Ok(JobState::Cancelled),
        _ => Err(unknown("state of a job", value)),
    }
}

pub(super) fn artifact_state(value: i64) -> Result<ArtifactState> {
    match value {
        1 => Ok(ArtifactState::Pending),
        2 => Ok(ArtifactState::Stored),
        3 => Ok(ArtifactState::Ready),
        4 => Ok(ArtifactState::Deleted),
        _ => Err(unknown("state of an artifact", value)),
    }
}

pub(super) fn key_state(value: i64) -> Result<KeyState> {
    match value {
        1 => Ok(KeyState::Active),
        2 => Ok(KeyState::Retired),
        3 => Ok(KeyState::Revoked),
        _ => Err(unknown("state of a key", value)),
    }
}

fn unknown(what: &'static str, value: i64) -> LedgerError {
    LedgerError::Corrupt { what, value }
}
