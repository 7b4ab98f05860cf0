//! Rows of the tables, read into the ledger's types.
use sqlx::Row;
use uuid::Uuid;

use super::super::types::{ArtifactRow, Failure, FailureReason, JobRow, KeyRow};
use super::super::workers::{LeasedJob, ResourceRequirements, SeenWorker, WorkerRow};
use super::super::{Result, codec, discriminants};
use super::DbRow;

pub(super) fn job(row: &DbRow) -> Result<JobRow> {
    let kind = discriminants::job_kind(number(row, "kind")?)?;
    let progress: Option<Vec<u8>> = row.try_get("progress")?;
    let result: Option<Vec<u8>> = row.try_get("result")?;
    Ok(JobRow {
        id: row.try_get("id")?,
        project: row.try_get("project")?,
        display_name: row.try_get("display_name")?,
        spec: codec::decode_spec(kind, row.try_get("spec")?)?,
        priority: row.try_get("priority")?,
        requirements: ResourceRequirements {
            memory: row.try_get("memory")?,
            likely_memory: row.try_get("likely_memory")?,
            clip: row.try_get("clip")?,
        },
        state: discriminants::job_state(number(row, "state")?)?,
        cancel_requested: row.try_get("cancel_requested")?,
        attempt: row.try_get("attempt")?,
        max_attempts: row.try_get("max_attempts")?,
        progress: progress.as_deref().map(codec::decode_progress).transpose()?,
        result: result.map(|bytes| codec::decode_result(kind, &bytes)).transpose()?,
        failure: failure(row)?,
        create_time: row.try_get("create_time")?,
        update_time: row.try_get("update_time")?,
        start_time: row.try_get("start_time")?,
        end_time: row.try_get("end_time")?,
        run_after: row.try_get("run_after")?,
        revision: row.try_get("revision")?,
        trace_parent: row.try_get("trace_parent")?,
        queue_position: None,
    })
}

/// Why a job or an attempt failed.
pub(super) fn failure(row: &DbRow) -> Result<Option<Failure>> {
    let reason: Option<i32> = row.try_get("failure_reason")?;
    let message: Option<String> = row.try_get("failure_message")?;
    Ok(reason.zip(message).map(|(reason, message)| Failure {
        reason: FailureReason::from_number(reason),
        message,
    }))
}

pub(super) fn worker(row: &DbRow) -> Result<SeenWorker> {
    let clips: String = row.try_get("clips")?;
    Ok(SeenWorker {
        name: row.try_get("name")?,
        device: row.try_get("device")?,
        version: row.try_get("version")?,
        memory: row.try_get("memory")?,
        clips: clips.split_ascii_whitespace().map(ToOwned::to_owned).collect(),
    })
}

pub(super) fn worker_with_job(row: &DbRow) -> Result<WorkerRow> {
    let id: Option<Uuid> = row.try_get("id")?;
    let has = id.map(|id| {
        Ok::<_, sqlx::Error>(LeasedJob {
            id,
            project: row.try_get("project")?,
            attempt: row.try_get("attempt")?,
            start_time: row.try_get("start_time")?,
            lease_expires: row.try_get("lease_expires")?,
        })
    });
    Ok(WorkerRow {
        seen: worker(row)?,
        time: row.try_get("time")?,
        has: has.transpose()?,
    })
}

pub(super) fn artifact(row: &DbRow) -> Result<ArtifactRow> {
    Ok(ArtifactRow {
        id: row.try_get("id")?,
        project: row.try_get("project")?,
        display_name: row.try_get("display_name")?,
        size: row.try_get("size")?,
        sha256: row.try_get("sha256")?,
        job: row.try_get("job_id")?,
        secret: row.try_get("secret")?,
        evidence: row.try_get("evidence")?,
        path: row.try_get("path")?,
        state: discriminants::artifact_state(number(row, "state")?)?,
        create_time: row.try_get("create_time")?,
    })
}

pub(super) fn key(row: &DbRow) -> Result<KeyRow> {
    let bits = number(row, "bits")?;
    Ok(KeyRow {
        id: row.try_get("id")?,
        project: row.try_get("project")?,
        display_name: row.try_get("display_name")?,
        bits: u32::try_from(bits).map_err(|_| super::super::LedgerError::Corrupt {
            what: "number of bits",
            value: bits,
        })?,
        clip: row.try_get("clip")?,
        clip_sha256: row.try_get("clip_sha256")?,
        seeded: row.try_get("seeded")?,
        create_time: row.try_get("create_time")?,
        job: row.try_get("job_id")?,
        artifact: row.try_get("artifact_id")?,
        state: discriminants::key_state(number(row, "state")?)?,
        state_reason: row.try_get("state_reason")?,
        state_time: row.try_get("state_time")?,
    })
}

pub(super) fn number(row: &DbRow, column: &str) -> Result<i64> {
    Ok(i64::from(row.try_get::<i32, _>(column)?))
}

/// A value that always has so many bytes.
pub(super) fn bytes<const N: usize>(row: &DbRow, column: &str) -> Result<[u8; N]> {
    let bytes: Vec<u8> = row.try_get(column)?;
    <[u8; N]>::try_from(bytes).map_err(|bytes| {
        sqlx::Error::ColumnDecode {
            index: column.to_owned(),
            source: format!("has {} bytes, not {N}", bytes.len()).into(),
        }
        .into()
    })
}
