//! The server's one error type: what happened, told so that the caller can do something about it.
//! What it becomes on the wire is decided in one place, `grpc::status`.
use std::error::Error as StdError;
use std::time::Duration;

use uuid::Uuid;

use crate::ledger::KeyState;

/// A result of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A field of a request that is not what it must be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// Path of the field in the request, such as `job.embed.message`.
    pub field: String,
    /// What is wrong with it, and the limit.
    pub description: String,
}

/// What went wrong.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A request that can't be carried out as it is, whoever sends it and whenever.
    #[error("{}", list(.0))]
    Invalid(Vec<Violation>),
    /// A resource that is not there.
    #[error("{name} does not exist")]
    NotFound {
        /// Its kind, such as `job`.
        kind: &'static str,
        /// Its full name.
        name: String,
    },
    /// A request id that stands for another request.
    #[error("request_id {request_id} was used before, for a request that was not the same as this one")]
    RequestIdReused {
        /// The id.
        request_id: Uuid,
    },
    /// A job that is over, and so stays as it is.
    #[error("{name} is finished")]
    Finished {
        /// The job's full name.
        name: String,
    },
    /// A job that has not failed, for something that only failed ones are for.
    #[error("{name} has not failed, so it is not queued once more")]
    NotFailed {
        /// The job's full name.
        name: String,
    },
    /// A job that nobody asked to end, reported as cancelled.
    #[error("nobody asked for {name} to be cancelled")]
    NotCancelled {
        /// The job's full name.
        name: String,
    },
    /// An artifact that a waiting or running job needs.
    #[error("{name} is needed by {job}, which is not finished")]
    InUse {
        /// The artifact's full name.
        name: String,
        /// The job's full name.
        job: String,
    },
    /// A key that is retired, for something that only active ones are for.
    #[error("{name} is retired: it verifies, but it marks no more, and takes no more assets")]
    KeyNotActive {
        /// The key's full name.
        name: String,
    },
    /// A key that is revoked.
    #[error("{name} is revoked, and is used for nothing any more")]
    KeyRevoked {
        /// The key's full name.
        name: String,
    },
    /// A key that can't go back to another state.
    #[error("{name} is {state}, and can't become {wanted}")]
    KeyStateFinal {
        /// The key's full name.
        name: String,
        /// What it is.
        state: &'static str,
        /// What it was to become.
        wanted: &'static str,
    },
    /// A key whose messages can hold no more payload numbers.
    #[error("{name} has given out all {limit} payload numbers that its messages can hold; make another key")]
    PayloadsUsedUp {
        /// The key's full name.
        name: String,
        /// How many it had.
        limit: i64,
    },
    /// A lease token that is not, or no longer, the job's.
    #[error("the lease of {name} is lost: its token is not the one that the job was given out with last")]
    LeaseLost {
        /// The job's full name.
        name: String,
    },
    /// A call without a token, where one is asked for.
    #[error(
        "a token is needed, as `authorization: Bearer` and the token in the metadata; guardsplat-server token create \
         makes one"
    )]
    TokenMissing,
    /// A token that nobody made.
    #[error("the token is not known")]
    TokenUnknown,
    /// A token that was good for a time.
    #[error("the token has expired")]
    TokenExpired,
    /// A token that was taken back.
    #[error("the token is revoked")]
    TokenRevoked,
    /// A token that is good for the call, and not for what it asks for.
    #[error("the token lacks the scope {needed}: {what}")]
    ScopeNeeded {
        /// Why it takes that.
        what: &'static str,
        /// What it lacks.
        needed: &'static str,
    },
    /// A token that is not good for what was asked.
    #[error("the token lacks the scope {}", .needed.join(" or "))]
    ScopeMissing {
        /// Scopes of which one would do.
        needed: Vec<&'static str>,
    },
    /// A call that there is not, or that nobody said who may make.
    #[error("there is no such call; reflection tells which there are")]
    NoSuchCall,
    /// Too many jobs wait already.
    #[error("{limit} jobs are waiting, and no more are taken")]
    QueueFull {
        /// Most jobs that may wait.
        limit: u64,
        /// When to try again.
        retry_after: Duration,
    },
    /// Too many calls of a class in too short a time.
    #[error("{per_minute} {what} a minute are taken from one caller; try again in {} s", .retry_after.as_secs_f64().ceil())]
    TooManyCalls {
        /// The class.
        what: &'static str,
        /// Most of it in a minute.
        per_minute: u32,
        /// When there is room for one more.
        retry_after: Duration,
    },
    /// A caller that has as many watches open as it may have.
    #[error("{limit} watches are open, and a caller may have no more at once")]
    TooManyWatches {
        /// Most that it may have.
        limit: u32,
    },
    /// A caller that has as many uploads and downloads under way as it may have.
    #[error("{limit} uploads and downloads are under way, and a caller may have no more at once")]
    TooManyTransfers {
        /// Most that it may have.
        limit: u32,
    },
    /// A project that has as much as it may have.
    #[error("project {project} has used up its {limit} {what}")]
    QuotaUsedUp {
        /// Of what.
        what: &'static str,
        /// The project.
        project: String,
        /// How much it may have.
        limit: u64,
    },
    /// A scene that takes more memory than a job may.
    #[error("{}", does_not_fit(.name, *.gaussians, *.degree, [*.needed, *.likely, *.limit]))]
    SceneDoesNotFit {
        /// The artifact's full name.
        name: String,
        /// Its Gaussians.
        gaussians: u64,
        /// Degree of spherical harmonics that it has room for.
        degree: u64,
        /// Bytes that it takes at least.
        needed: u64,
        /// Bytes that it probably takes.
        likely: u64,
        /// Bytes that a job may take.
        limit: u64,
    },
    /// The server is going down.
    #[error("the server is stopping")]
    Stopping,
    /// An upload whose sender fell silent.
    #[error("nothing of the upload arrived for {} s", .0.as_secs())]
    UploadStalled(Duration),
    /// An upload that took longer than bytes are kept that nobody finished.
    #[error("the upload was not finished after {} s", .0.as_secs())]
    UploadTooSlow(Duration),
    /// A watch whose reader did not read.
    #[error("nothing of the watch was read for {} s; it goes on from the last cursor", .0.as_secs())]
    WatchStalled(Duration),
    /// A download whose reader did not read.
    #[error("nothing of the download was read for {} s; it goes on from an offset", .0.as_secs())]
    DownloadStalled(Duration),
    /// The deadline that the caller set has passed.
    #[error("the deadline has passed")]
    DeadlineExceeded,
    /// There is no room to store something.
    #[error("no space is left to store artifacts")]
    NoSpace,
    /// The ledger or the store can't be reached now.
    #[error("{what} is not available")]
    Unavailable {
        /// What is not.
        what: &'static str,
        /// Why, for the log.
        #[source]
        source: Box<dyn StdError + Send + Sync>,
    },
    /// Something that no caller can help.
    #[error("{what} failed")]
    Internal {
        /// What was tried.
        what: &'static str,
        /// Why, for the log.
        #[source]
        source: Box<dyn StdError + Send + Sync>,
    },
    /// The server can't start or go on: a setting, a folder, an address.
    #[error("{0}")]
    Startup(String),
}

impl Error {
    /// One field is wrong.
    pub fn invalid(field: impl Into<String>, description: impl Into<String>) -> Self {
        Self::Invalid(vec![Violation {
            field: field.into(),
            description: description.into(),
        }])
    }

    /// A key can't be used for what only active ones are for.
    pub fn key_not_active(name: String, state: KeyState) -> Self {
        match state {
            KeyState::Revoked => Self::KeyRevoked { name },
            KeyState::Active | KeyState::Retired => Self::KeyNotActive { name },
        }
    }

    /// Something failed that no caller can help.
    pub fn internal(what: &'static str, source: impl Into<Box<dyn StdError + Send + Sync>>) -> Self {
        Self::Internal {
            what,
            source: source.into(),
        }
    }
}

fn does_not_fit(name: &str, gaussians: u64, degree: u64, bytes: [u64; 3]) -> String {
    // Limits are set in whole mebibytes; what is needed is rounded up, so that it is seen to be more.
    let [needed, likely, limit] = bytes.map(|bytes| bytes.div_ceil(1 << 20));
    let more = if likely > needed {
        format!(", and probably {likely} MiB or more")
    } else {
        String::new()
    };
    format!(
        "{name} does not fit: {gaussians} Gaussians with spherical harmonics of degree {degree} take {needed} MiB of \
         memory at least{more}; a job may take {limit} MiB (max_job_memory_mebibytes)"
    )
}

fn list(violations: &[Violation]) -> String {
    let each: Vec<_> = violations
        .iter()
        .map(|v| format!("{}: {}", v.field, v.description))
        .collect();
    each.join("; ")
}

/// An error and what caused it in one line, for the log.
pub fn chain(error: &(dyn std::error::Error + 'static)) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text.push_str(": ");
        text.push_str(&error.to_string());
        cause = error.source();
    }
    text
}
