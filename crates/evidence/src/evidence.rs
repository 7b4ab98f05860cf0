//! One report: who asked what of which files, with which model and key, and what came out.
use crate::embedding::Embedding;
use crate::hash::Sha256;
use crate::picture::View;
use crate::verification::Verification;
use jiff::Timestamp;
use serde::{Deserialize, Serialize};

/// What every report says of itself.
pub const SCHEMA: &str = "guardsplat.evidence";
/// The version of the fields below, which new reports have. Those of version 1 are read as well; they name neither the
/// worker nor what was tried before; those of version 2 share the rate alike among readings; those of version 3 count bits
/// alike, however clearly they were read; those of version 4 have no suspect compared with the original. Any other is
/// refused, never guessed at.
pub const VERSION: u32 = 5;
/// The oldest version that is read.
pub(crate) const FIRST_VERSION: u32 = 1;
/// The last version in which all readings had the same part of the rate.
pub(crate) const ALIKE_VERSION: u32 = 2;
/// The last version in which matches were counted, without ranks.
pub(crate) const COUNTED_VERSION: u32 = 3;
/// The last version in which no suspect was compared with the original.
pub(crate) const BLIND_VERSION: u32 = 4;

/// Everything that a report says. The order of fields is the order of the JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Evidence {
    /// [`SCHEMA`].
    pub schema: String,
    /// [`VERSION`], or an earlier one.
    pub version: u32,
    /// Who may read it.
    pub audience: Audience,
    /// What was done.
    pub kind: EvidenceKind,
    /// The job, as the service names it.
    pub job: String,
    /// When the work began, in UTC.
    pub started: Timestamp,
    /// When it was done.
    pub finished: Timestamp,
    /// Name and version of the engine.
    pub engine: String,
    /// What it was computed on.
    pub device: String,
    /// Who computed it; absent in reports of version 1, and where it is not told.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub worker: Option<Worker>,
    /// The CLIP that pictures were read with.
    pub model: Model,
    /// The key.
    pub key: Key,
    /// The files that the job was given, and made.
    pub inputs: Vec<Input>,
    /// What was read; required for `verify`. For `embed` it is the mark read back from held-out views.
    pub verification: Option<Verification>,
    /// What the marking cost; for `embed` only, and then required.
    pub embedding: Option<Embedding>,
    /// Pictures, of some views.
    pub views: Vec<View>,
}

/// Who may read a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Audience {
    /// Whoever owns the key.
    Owner,
    /// Anybody: see [`Evidence::for_stranger`].
    Stranger,
}

/// What was done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EvidenceKind {
    /// A scene was marked.
    Embed,
    /// A suspect was read.
    Verify,
}

/// Who carried out the job, as the service knows it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Worker {
    /// What the worker calls itself.
    pub name: String,
    /// Which time it was that a worker was given the job, from 1.
    pub attempt: u32,
}

/// The CLIP that reads pictures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// Its name.
    pub name: String,
    /// The hash of its weights.
    pub sha256: Sha256,
}

/// The key that was used; its identifier, and nothing of its secret.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Key {
    /// As the service names it.
    pub id: String,
}

/// A file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Input {
    /// What it is for.
    pub role: Role,
    /// What it was called by whoever sent it; absent where that is nobody's business.
    pub name: Option<String>,
    /// Its size in bytes.
    pub bytes: u64,
    /// Its hash.
    pub sha256: Sha256,
}

/// What a file is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// What was asked about.
    Suspect,
    /// The scene before it was marked: what was marked, or what a suspect was compared with.
    Original,
    /// The scene after it was marked.
    Marked,
    /// Where the scene's viewers are: cameras that it was marked for, or read at.
    Cameras,
}
