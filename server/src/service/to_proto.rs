//! From rows of the ledger to messages of the API.
use guardsplat_proto::v1;
use guardsplat_proto::v1::job::{Result as JobResult, Spec};
use prost::Message;

use crate::error::{Error, Result};
use crate::ledger::{ArtifactRow, JobKind, JobRow, JobState, KeyRow, KeyState};
use crate::service::clock::timestamp;
use crate::service::names::Kind;

/// A job for the API.
pub fn job(row: JobRow) -> Result<v1::Job> {
    let queued = row.state == JobState::Queued;
    let spec = row.spec.as_slice();
    let result = row.result.as_deref();
    let (spec, result) = match row.kind {
        JobKind::Embed => (
            Spec::Embed(decode(spec)?),
            result.map(decode).transpose()?.map(JobResult::EmbedResult),
        ),
        JobKind::Verify => (
            Spec::Verify(decode(spec)?),
            result.map(decode).transpose()?.map(JobResult::VerifyResult),
        ),
        JobKind::CreateKey => (
            Spec::CreateKey(decode(spec)?),
            result.map(decode).transpose()?.map(JobResult::KeyResult),
        ),
    };
    Ok(v1::Job {
        name: Kind::Job.name(row.id),
        display_name: row.display_name,
        spec: Some(spec),
        state: state(row.state).into(),
        cancel_requested: row.cancel_requested,
        attempt: row.attempt,
        max_attempts: row.max_attempts,
        queue_position: row.queue_position.filter(|_| queued),
        progress: row.progress.as_deref().map(decode).transpose()?,
        result,
        failure: row.failure.map(|failure| v1::Failure {
            reason: failure.reason,
            message: failure.message,
        }),
        create_time: Some(timestamp(row.create_time)),
        update_time: Some(timestamp(row.update_time)),
        start_time: row.start_time.map(timestamp),
        end_time: row.end_time.map(timestamp),
        retry_time: row.run_after.filter(|_| queued).map(timestamp),
        priority: Some(row.priority),
        // Whoever knows the workers adds it.
        waiting_reason: String::new(),
    })
}

/// An artifact for the API.
pub fn artifact(row: ArtifactRow) -> v1::Artifact {
    v1::Artifact {
        name: Kind::Artifact.name(row.id),
        display_name: row.display_name,
        size_bytes: row.size,
        sha256: row.sha256,
        create_time: Some(timestamp(row.create_time)),
        job: row.job.map(|id| Kind::Job.name(id)).unwrap_or_default(),
    }
}

/// A key for the API.
pub fn key(row: KeyRow) -> v1::Key {
    v1::Key {
        name: Kind::Key.name(row.id),
        display_name: row.display_name,
        bits: row.bits,
        clip: row.clip,
        clip_sha256: row.clip_sha256,
        seeded: row.seeded,
        create_time: Some(timestamp(row.create_time)),
        job: Kind::Job.name(row.job),
        state: key_state(row.state).into(),
        state_reason: row.state_reason,
        state_time: row.state_time.map(timestamp),
    }
}

fn key_state(state: KeyState) -> v1::key::State {
    match state {
        KeyState::Active => v1::key::State::Active,
        KeyState::Retired => v1::key::State::Retired,
        KeyState::Revoked => v1::key::State::Revoked,
    }
}

/// A message that the ledger keeps encoded.
pub fn decode<M: Message + Default>(bytes: &[u8]) -> Result<M> {
    M::decode(bytes).map_err(|error| Error::internal("reading a message kept in the ledger", error))
}

fn state(state: JobState) -> v1::job::State {
    match state {
        JobState::Queued => v1::job::State::Queued,
        JobState::Running => v1::job::State::Running,
        JobState::Succeeded => v1::job::State::Succeeded,
        JobState::Failed => v1::job::State::Failed,
        JobState::Cancelled => v1::job::State::Cancelled,
    }
}

/// States that a list is asked for, each once and in order, so that equal queries are the same query.
pub fn states(given: &[i32]) -> Result<Vec<JobState>> {
    use v1::job::State;
    let mut wanted = Vec::new();
    for (i, &number) in given.iter().enumerate() {
        let state = match State::try_from(number) {
            Ok(State::Queued) => JobState::Queued,
            Ok(State::Running) => JobState::Running,
            Ok(State::Succeeded) => JobState::Succeeded,
            Ok(State::Failed) => JobState::Failed,
            Ok(State::Cancelled) => JobState::Cancelled,
            Ok(State::Unspecified) | Err(_) => {
                return Err(Error::invalid(
                    format!("states[{i}]"),
                    format!("{number} is no state of a job"),
                ));
            }
        };
        if !wanted.contains(&state) {
            wanted.push(state);
        }
    }
    wanted.sort_by_key(|&state| state as i32);
    Ok(wanted)
}
