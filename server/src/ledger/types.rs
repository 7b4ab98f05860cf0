//! What the ledger keeps: jobs, artifacts and keys, as rows. What a job does and what came of it are messages of the
//! API, decoded and of the job's kind ([`JobSpec`], [`JobResult`]); all else is without any wire format.
use std::fmt;

use uuid::Uuid;

use super::credentials::NewCredentials;
use super::registry::KeyState;
use super::work::{JobResult, JobSpec, Progress};
use super::workers::ResourceRequirements;

/// Name of a job; a version 7 UUID.
pub type JobId = Uuid;
/// Name of an artifact.
pub type ArtifactId = Uuid;
/// Name of a key.
pub type KeyId = Uuid;

/// Why a job or an attempt failed, for programs. Numbers are kept in the database, and are those of
/// `guardsplat.v1.Failure.Reason`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum FailureReason {
    /// Nobody said, or it is not known to this version.
    #[default]
    Unspecified = 0,
    /// The input is not what it must be.
    InvalidInput = 1,
    /// The mark can't be read well enough, or is seen too well.
    TargetMissed = 2,
    /// The worker was lost, or lost its device.
    WorkerLost = 3,
    /// Something else went wrong inside the worker.
    Internal = 4,
    /// Every attempt failed.
    AttemptsExhausted = 5,
}

impl FailureReason {
    /// The reason of a number; `Unspecified` for one that this version does not know.
    pub fn from_number(number: i32) -> Self {
        [
            Self::InvalidInput,
            Self::TargetMissed,
            Self::WorkerLost,
            Self::Internal,
            Self::AttemptsExhausted,
        ]
        .into_iter()
        .find(|&reason| reason as i32 == number)
        .unwrap_or_default()
    }
}

/// What a job does. Numbers are kept in the database.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum JobKind {
    /// Marks a scene.
    Embed = 1,
    /// Reads a suspect.
    Verify = 2,
    /// Makes a key.
    CreateKey = 3,
}

/// What became of a job. Numbers are kept in the database, and are those of `guardsplat.v1.Job.State`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum JobState {
    /// Waits for a worker.
    Queued = 1,
    /// A worker has it.
    Running = 2,
    /// Done.
    Succeeded = 3,
    /// Given up.
    Failed = 4,
    /// Ended because somebody asked.
    Cancelled = 5,
}

impl JobState {
    /// Whether nothing of the job changes any more, but that a failed one may be queued once more.
    pub fn is_over(self) -> bool {
        matches!(self, Self::Succeeded | Self::Failed | Self::Cancelled)
    }
}

/// Why a job or an attempt failed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// For programs.
    pub reason: FailureReason,
    /// For people.
    pub message: String,
}

/// A job as it stands.
#[derive(Clone, Debug, PartialEq)]
pub struct JobRow {
    /// Its name.
    pub id: JobId,
    /// Whose it is.
    pub project: String,
    /// What people call it.
    pub display_name: String,
    /// What it does.
    pub spec: JobSpec,
    /// How urgent it is.
    pub priority: i32,
    /// What its worker must have.
    pub requirements: ResourceRequirements,
    /// What became of it.
    pub state: JobState,
    /// Somebody asked for the end of it while it was running.
    pub cancel_requested: bool,
    /// Attempts counted so far.
    pub attempt: i32,
    /// How many there may be.
    pub max_attempts: i32,
    /// How far the last attempt was.
    pub progress: Option<Progress>,
    /// What came out of it.
    pub result: Option<JobResult>,
    /// Why it failed, or why its last attempt did.
    pub failure: Option<Failure>,
    /// When it was accepted.
    pub create_time: i64,
    /// When anything of it changed last.
    pub update_time: i64,
    /// When a worker was last given it.
    pub start_time: Option<i64>,
    /// When it was over.
    pub end_time: Option<i64>,
    /// Not given to a worker before.
    pub run_after: Option<i64>,
    /// One more with every change.
    pub revision: i64,
    /// What it is a part of, as W3C Trace Context has it; none where nobody traces.
    pub trace_parent: Option<String>,
    /// Queued jobs ahead of it as things stand; set while it is queued, by `create_job`, `get_job` and `list_jobs`.
    pub queue_position: Option<i64>,
}

impl JobRow {
    /// Which kind of job it is.
    pub fn kind(&self) -> JobKind {
        self.spec.kind()
    }
}

/// A job to queue.
#[derive(Clone, Debug)]
pub struct NewJob {
    /// Its name.
    pub id: JobId,
    /// Whose it is; so must be the artifacts and the key that it names.
    pub project: String,
    /// What people call it.
    pub display_name: String,
    /// What it does.
    pub spec: JobSpec,
    /// Artifacts it reads; kept while it is queued or running.
    pub inputs: Vec<ArtifactId>,
    /// The key it requirements.
    pub key: Option<KeyId>,
    /// Names the request, so that it can be repeated.
    pub request_id: Option<Uuid>,
    /// What the caller called the request, whose name in `request_id` is that of all projects.
    pub asked_id: Option<Uuid>,
    /// SHA-256 of the request, with what its artifacts hold in place of their names.
    pub fingerprint: [u8; 32],
    /// How many attempts there may be.
    pub max_attempts: i32,
    /// How urgent it is: one of [`PRIORITIES`](super::queue::PRIORITIES).
    pub priority: i32,
    /// What its worker must have.
    pub requirements: ResourceRequirements,
    /// What the request is a part of, as W3C Trace Context has it.
    pub trace_parent: Option<String>,
}

/// The right to one attempt of a job.
#[derive(Clone)]
pub struct Lease {
    /// The job.
    pub job: JobRow,
    /// The secret that goes with every write of the attempt. Only its hash is kept.
    pub token: String,
}

impl fmt::Debug for Lease {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Lease").field("job", &self.job).finish_non_exhaustive()
    }
}

/// Where an artifact comes from.
#[derive(Clone)]
pub enum Origin {
    /// A client sends it.
    Upload {
        /// Whose it is.
        project: String,
    },
    /// An attempt of a job made it, whose project's it is.
    Output {
        /// The job.
        job: JobId,
        /// The lease of the attempt.
        token: String,
    },
}

impl fmt::Debug for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Upload { project } => f.debug_struct("Upload").field("project", project).finish(),
            Self::Output { job, .. } => f.debug_struct("Output").field("job", job).finish_non_exhaustive(),
        }
    }
}

/// An artifact whose bytes are about to be stored.
#[derive(Clone, Debug)]
pub struct NewArtifact {
    /// Its name.
    pub id: ArtifactId,
    /// What people call it.
    pub display_name: String,
    /// Length in bytes.
    pub size: i64,
    /// SHA-256 of the bytes, lower-case hexadecimal.
    pub sha256: String,
    /// Where it comes from.
    pub origin: Origin,
    /// A key file: never visible.
    pub secret: bool,
    /// A signed report: it stays, and so does its job, however long things are kept.
    pub evidence: bool,
    /// Where the store has the bytes.
    pub path: String,
}

/// How far an artifact is. Numbers are kept in the database.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ArtifactState {
    /// Its bytes are on the way.
    Pending = 1,
    /// An output, all there, that no job has published.
    Stored = 2,
    /// There for good; visible unless it is secret.
    Ready = 3,
    /// Gone for everybody; its bytes may still be there.
    Deleted = 4,
}

/// What is known of an artifact; the bytes live in the store.
#[derive(Clone, Debug, PartialEq)]
pub struct ArtifactRow {
    /// Its name.
    pub id: ArtifactId,
    /// Whose it is.
    pub project: String,
    /// What people call it.
    pub display_name: String,
    /// Length in bytes.
    pub size: i64,
    /// SHA-256 of the bytes, lower-case hexadecimal.
    pub sha256: String,
    /// The job that made it; none for uploads.
    pub job: Option<JobId>,
    /// A key file: never visible.
    pub secret: bool,
    /// A signed report.
    pub evidence: bool,
    /// Where the store has the bytes.
    pub path: String,
    /// How far it is.
    pub state: ArtifactState,
    /// When it was announced.
    pub create_time: i64,
}

/// A key that a job made.
#[derive(Clone, Debug)]
pub struct NewKey {
    /// Its name.
    pub id: KeyId,
    /// What people call it.
    pub display_name: String,
    /// Bits of its messages.
    pub bits: u32,
    /// The CLIP it belongs to.
    pub clip: String,
    /// SHA-256 of that CLIP's weights, hexadecimal.
    pub clip_sha256: String,
    /// Whether it was made from a seed.
    pub seeded: bool,
    /// The secret output that holds the key file.
    pub artifact: ArtifactId,
}

/// What an attempt says came out of its job.
#[derive(Clone, Debug)]
pub struct Completion {
    /// What came out, of the job's kind.
    pub result: JobResult,
    /// Outputs that become visible.
    pub outputs: Vec<ArtifactId>,
    /// The key that was made.
    pub key: Option<NewKey>,
    /// The content credentials that were made, of one of the outputs.
    pub credentials: Option<NewCredentials>,
    /// SHA-256 of what the worker said, by which it is known when it is said again.
    pub fingerprint: [u8; 32],
}

/// What is known of a key.
#[derive(Clone, Debug, PartialEq)]
pub struct KeyRow {
    /// Its name.
    pub id: KeyId,
    /// Whose it is: the project of the job that made it.
    pub project: String,
    /// What people call it.
    pub display_name: String,
    /// Bits of its messages.
    pub bits: u32,
    /// The CLIP it belongs to.
    pub clip: String,
    /// SHA-256 of that CLIP's weights, hexadecimal.
    pub clip_sha256: String,
    /// Whether it was made from a seed.
    pub seeded: bool,
    /// When it was made.
    pub create_time: i64,
    /// The job that made it.
    pub job: JobId,
    /// The secret artifact that holds the key file.
    pub artifact: ArtifactId,
    /// What it may be used for.
    pub state: KeyState,
    /// Why it is retired or revoked.
    pub state_reason: String,
    /// Since when it is; none while it is active.
    pub state_time: Option<i64>,
}
