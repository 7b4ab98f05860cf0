//! What the ledger's errors mean to a caller.
use crate::error::Error;
use crate::ledger::LedgerError;
use crate::service::names::ResourceKind;

/// SQLite's results for a database that somebody else holds for the moment, and for a full disk.
const SQLITE_BUSY: &str = "5";
const SQLITE_FULL: &str = "13";
/// PostgreSQL's for a full disk.
const POSTGRES_FULL: &str = "53100";

impl From<LedgerError> for Error {
    fn from(error: LedgerError) -> Self {
        match error {
            LedgerError::NotFound { kind, id } => {
                let kind = ResourceKind::ALL
                    .into_iter()
                    .find(|k| k.singular() == kind)
                    .unwrap_or(ResourceKind::Job);
                kind.not_found(id)
            }
            LedgerError::RequestIdReused(request_id) => Self::RequestIdReused { request_id },
            LedgerError::Finished { job, .. } => Self::Finished {
                name: ResourceKind::Job.name(job),
            },
            LedgerError::NotFailed(job) => Self::NotFailed {
                name: ResourceKind::Job.name(job),
            },
            LedgerError::LeaseLost(job) => Self::LeaseLost {
                name: ResourceKind::Job.name(job),
            },
            LedgerError::InUse { artifact, job } => Self::InUse {
                name: ResourceKind::Artifact.name(artifact),
                job: ResourceKind::Job.name(job),
            },
            LedgerError::NotAnOutput(artifact) => {
                let name = ResourceKind::Artifact.name(artifact);
                Self::invalid(
                    "result",
                    format!("{name} is no finished output of this attempt that may be named here"),
                )
            }
            LedgerError::CancelNotRequested(job) => Self::NotCancelled {
                name: ResourceKind::Job.name(job),
            },
            LedgerError::KeyNotActive { key, state } => Self::key_not_active(ResourceKind::Key.name(key), state),
            LedgerError::KeyStateFinal { key, state, wanted } => Self::KeyStateFinal {
                name: ResourceKind::Key.name(key),
                state: state.word(),
                wanted: wanted.word(),
            },
            LedgerError::PayloadsUsedUp { key, limit } => Self::PayloadsUsedUp {
                name: ResourceKind::Key.name(key),
                limit,
            },
            LedgerError::Database(ref cause) => match transient(cause) {
                Trouble::Full => Self::NoSpace,
                Trouble::Busy => Self::Unavailable {
                    what: "the ledger",
                    source: Box::new(error),
                },
                Trouble::Other => Self::internal("the ledger", error),
            },
            LedgerError::Closed | LedgerError::Unavailable(_) => Self::Unavailable {
                what: "the ledger",
                source: Box::new(error),
            },
            LedgerError::Migrate(_)
            | LedgerError::Corrupt { .. }
            | LedgerError::Undecodable { .. }
            | LedgerError::ResultOfAnotherKind(_)
            | LedgerError::BadCommitment { .. } => Self::internal("the ledger", error),
        }
    }
}

enum Trouble {
    Busy,
    Full,
    Other,
}

/// Whether the same call may succeed a little later.
fn transient(error: &sqlx::Error) -> Trouble {
    match error {
        sqlx::Error::PoolTimedOut | sqlx::Error::PoolClosed => Trouble::Busy,
        sqlx::Error::Database(error) => match error.code().as_deref() {
            Some(SQLITE_BUSY) => Trouble::Busy,
            Some(SQLITE_FULL | POSTGRES_FULL) => Trouble::Full,
            _ => Trouble::Other,
        },
        _ => Trouble::Other,
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use uuid::Uuid;

    use super::*;

    #[test]
    fn names_are_those_of_the_api() {
        let id = Uuid::now_v7();
        let of = |error: LedgerError| Error::from(error).to_string();
        assert_eq!(
            of(LedgerError::NotFound { kind: "key", id }),
            format!("keys/{id} does not exist")
        );
        assert!(of(LedgerError::LeaseLost(id)).contains(&format!("jobs/{id}")));
        assert!(of(LedgerError::NotAnOutput(id)).contains(&format!("artifacts/{id}")));
    }

    #[test]
    fn a_busy_ledger_is_tried_again() {
        let of = |error| Error::from(LedgerError::Database(Arc::new(error)));
        assert!(matches!(of(sqlx::Error::PoolTimedOut), Error::Unavailable { .. }));
        assert!(matches!(of(sqlx::Error::RowNotFound), Error::Internal { .. }));
    }
}
