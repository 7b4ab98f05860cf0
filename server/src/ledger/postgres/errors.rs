//! What an error of the database means: that it is away, that others were in the way, or that something is wrong.
use std::io;
use std::sync::Arc;
use std::time::Duration;

use super::super::LedgerError;

/// What can be done about an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ErrorClass {
    /// The connection is broken or can't be made: another may do.
    Broken,
    /// Other transactions were in the way, and this one was undone.
    Conflict,
    /// It took too long, or the database takes no writes at the moment; not worth trying again at once.
    Late,
    /// None of these.
    Other,
}

/// What an error means.
pub(super) fn classify(error: &sqlx::Error) -> ErrorClass {
    match error {
        sqlx::Error::Io(_) | sqlx::Error::Protocol(_) | sqlx::Error::BeginFailed => ErrorClass::Broken,
        sqlx::Error::PoolTimedOut => ErrorClass::Late,
        sqlx::Error::Database(error) => classify_code(error.code().as_deref().unwrap_or_default()),
        _ => ErrorClass::Other,
    }
}

/// The codes are in appendix A of PostgreSQL's manual.
fn classify_code(code: &str) -> ErrorClass {
    match code {
        // Connections that break, backends that are ended, and servers that start, stop, or have no place left.
        "57P01" | "57P02" | "57P03" | "57P05" | "25P03" | "53300" | "55000" => ErrorClass::Broken,
        "40001" | "40P01" => ErrorClass::Conflict,
        // Time is up for a statement or a lock; and a standby, which a failover may be about to make the primary.
        "57014" | "55P03" | "25006" => ErrorClass::Late,
        _ if code.starts_with("08") => ErrorClass::Broken,
        _ => ErrorClass::Other,
    }
}

/// The error as the ledger tells it.
pub(super) fn to_ledger_error(error: LedgerError) -> LedgerError {
    match error {
        LedgerError::Database(cause) => match (classify(&cause), &*cause) {
            (_, sqlx::Error::PoolClosed) => LedgerError::Closed,
            (ErrorClass::Other, _) => LedgerError::Database(cause),
            _ => LedgerError::Unavailable(cause),
        },
        error => error,
    }
}

/// That nothing came for so long.
pub(super) fn no_answer(after: Duration) -> LedgerError {
    let error = io::Error::new(io::ErrorKind::TimedOut, format!("no answer within {after:?}"));
    LedgerError::Unavailable(Arc::new(sqlx::Error::Io(error)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_passes_is_told_from_what_does_not() {
        let converted = |error: sqlx::Error| to_ledger_error(error.into());
        assert!(matches!(
            converted(sqlx::Error::PoolTimedOut),
            LedgerError::Unavailable(_)
        ));
        assert!(matches!(converted(sqlx::Error::PoolClosed), LedgerError::Closed));
        assert!(matches!(converted(sqlx::Error::RowNotFound), LedgerError::Database(_)));
        let refused = io::Error::from(io::ErrorKind::ConnectionRefused);
        assert!(matches!(converted(refused.into()), LedgerError::Unavailable(_)));
        for (code, class) in [
            ("08006", ErrorClass::Broken),
            ("57P01", ErrorClass::Broken),
            ("40P01", ErrorClass::Conflict),
            ("57014", ErrorClass::Late),
            ("23505", ErrorClass::Other),
            ("53100", ErrorClass::Other),
            ("", ErrorClass::Other),
        ] {
            assert_eq!(classify_code(code), class, "{code}");
        }
    }
}
