//! From rows of the ledger to messages of the API.
use guardsplat_proto::v1;
use guardsplat_proto::v1::job::Spec;

use crate::error::{Error, Result};
use crate::ledger::{ArtifactRow, Failure, JobResult, JobRow, JobSpec, JobState, KeyRow, KeyState};
use crate::service::clock::timestamp;
use crate::service::names::ResourceKind;

/// A job for the API, all that is known of it; but for seeds, which are told to nobody.
pub fn job(row: JobRow) -> v1::Job {
    let queued = row.state == JobState::Queued;
    v1::Job {
        name: ResourceKind::Job.name(row.id),
        display_name: row.display_name,
        spec: Some(spec(row.spec)),
        state: state(row.state).into(),
        cancel_requested: row.cancel_requested,
        attempt: row.attempt,
        max_attempts: row.max_attempts,
        queue_position: row.queue_position.filter(|_| queued),
        progress: row.progress,
        result: row.result.map(result),
        failure: row.failure.map(failure),
        create_time: Some(timestamp(row.create_time)),
        update_time: Some(timestamp(row.update_time)),
        start_time: row.start_time.map(timestamp),
        end_time: row.end_time.map(timestamp),
        retry_time: row.run_after.filter(|_| queued).map(timestamp),
        priority: Some(row.priority),
        // Whoever knows the workers adds it.
        waiting_reason: String::new(),
    }
}

fn spec(spec: JobSpec) -> Spec {
    match spec {
        JobSpec::Embed(spec) => Spec::Embed(spec),
        JobSpec::Verify(spec) => Spec::Verify(spec),
        JobSpec::CreateKey(order) => Spec::CreateKey(v1::KeySpec {
            bits: order.bits,
            seed: None,
            seeded: order.seed.is_some(),
        }),
    }
}

fn result(result: JobResult) -> v1::job::Result {
    match result {
        JobResult::Embed(result) => v1::job::Result::EmbedResult(result),
        JobResult::Verify(result) => v1::job::Result::VerifyResult(result),
        JobResult::CreateKey(result) => v1::job::Result::KeyResult(result),
    }
}

/// Why a job or an attempt failed, for the API. Numbers are the same.
pub fn failure(failure: Failure) -> v1::Failure {
    v1::Failure {
        reason: failure.reason as i32,
        message: failure.message,
    }
}

/// An artifact for the API.
pub fn artifact(row: ArtifactRow) -> v1::Artifact {
    v1::Artifact {
        name: ResourceKind::Artifact.name(row.id),
        display_name: row.display_name,
        size_bytes: row.size,
        sha256: row.sha256,
        create_time: Some(timestamp(row.create_time)),
        job: row.job.map(|id| ResourceKind::Job.name(id)).unwrap_or_default(),
    }
}

/// A key for the API.
pub fn key(row: KeyRow) -> v1::Key {
    v1::Key {
        name: ResourceKind::Key.name(row.id),
        display_name: row.display_name,
        bits: row.bits,
        clip: row.clip,
        clip_sha256: row.clip_sha256,
        seeded: row.seeded,
        create_time: Some(timestamp(row.create_time)),
        job: ResourceKind::Job.name(row.job),
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
