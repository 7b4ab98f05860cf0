//! The file: what is in it, and what becomes of it when things go wrong.
use guardsplat_proto::v1::EmbedSpec;
use guardsplat_proto::v1::failure::Reason;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{Connection, Row, SqliteConnection};

use super::super::super::conformance::fixture::*;
use super::super::super::{
    CommitmentLog, FailureReason, JobQueue, JobSpec, JobState, JobStore, KeyState, Ledger, LedgerError, SqliteLedger,
};
use super::super::open;
use super::Folder;

pub(super) async fn raw(folder: &Folder) -> SqliteConnection {
    let options = SqliteConnectOptions::new().filename(folder.path());
    SqliteConnection::connect_with(&options).await.unwrap()
}

#[tokio::test]
async fn killed_without_warning_nothing_acknowledged_is_lost() {
    let folder = Folder::new();
    let ledger = folder.ledger().await;
    let mut ids = Vec::new();
    for i in 0..20 {
        ids.push(queue(&*ledger, at(i)).await);
    }
    // What the disk has at this moment, while nothing is closed or tidied up.
    let copy = Folder::new();
    for suffix in ["", "-wal"] {
        let name = |folder: &Folder| format!("{}{suffix}", folder.path().display());
        std::fs::copy(name(&folder), name(&copy)).unwrap();
    }
    let after = copy.ledger().await;
    for id in ids {
        assert_eq!(job(&*after, id).await, job(&*ledger, id).await);
    }
}

#[tokio::test]
async fn durability_is_switched_on() {
    let folder = Folder::new();
    let mut db = open::migrated(&open::options(&folder.path())).await.unwrap();
    for (pragma, expected) in [
        ("PRAGMA synchronous", "2"),
        ("PRAGMA foreign_keys", "1"),
        ("PRAGMA busy_timeout", "10000"),
    ] {
        let value: i64 = sqlx::query(pragma).fetch_one(&mut db).await.unwrap().get(0);
        assert_eq!(value.to_string(), expected, "{pragma}");
    }
    let mode: String = sqlx::query("PRAGMA journal_mode")
        .fetch_one(&mut db)
        .await
        .unwrap()
        .get(0);
    assert_eq!(mode, "wal");
}

#[tokio::test]
async fn a_full_disk_loses_nothing_and_is_told() {
    let folder = Folder::new();
    folder.ledger().await.close().await;
    let options = open::options(&folder.path()).pragma("max_page_count", "120");
    let ledger = SqliteLedger::open_with(options).await.unwrap();
    let mut kept = Vec::new();
    let error = loop {
        let new = crate::ledger::NewJob {
            spec: JobSpec::Embed(EmbedSpec {
                message: "5".repeat(5000),
                ..EmbedSpec::default()
            }),
            ..new_job()
        };
        match ledger.create_job(new, at(0)).await {
            Ok(job) => kept.push(job.id),
            Err(error) => break error,
        }
        assert!(kept.len() < 1000, "the disk never got full");
    };
    assert!(matches!(error, LedgerError::Database(_)), "{error:?}");
    assert!(!kept.is_empty());
    assert_eq!(ledger.queue_depth().await.unwrap(), kept.len() as i64);
    // Room again: the ledger goes on without a restart.
    ledger.close().await;
    let ledger = folder.ledger().await;
    queue(&*ledger, at(1)).await;
    assert_eq!(ledger.queue_depth().await.unwrap(), kept.len() as i64 + 1);
}

#[tokio::test]
async fn tokens_are_kept_as_hashes_only() {
    let folder = Folder::new();
    let ledger = folder.ledger().await;
    queue(&*ledger, at(0)).await;
    let lease = claim(&*ledger, at(1)).await.unwrap();
    output(&*ledger, &lease, true, at(2)).await;
    for file in std::fs::read_dir(folder.path().parent().unwrap()).unwrap() {
        let bytes = std::fs::read(file.unwrap().path()).unwrap();
        assert!(!bytes.windows(lease.token.len()).any(|w| w == lease.token.as_bytes()));
    }
}

#[tokio::test]
async fn files_of_others_are_refused() {
    let folder = Folder::new();
    std::fs::write(
        folder.path(),
        "no database, but long enough to be read as the header of one".repeat(10),
    )
    .unwrap();
    assert!(matches!(
        SqliteLedger::open(&folder.path()).await.err(),
        Some(LedgerError::Database(_))
    ));

    let folder = Folder::new();
    folder.ledger().await.close().await;
    let mut db = raw(&folder).await;
    let newer = "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time) \
                 VALUES (99, 'of a newer version', 1, x'00', 0)";
    sqlx::query(newer).execute(&mut db).await.unwrap();
    db.close().await.unwrap();
    assert!(matches!(
        SqliteLedger::open(&folder.path()).await.err(),
        Some(LedgerError::Migrate(_))
    ));
}

#[tokio::test]
async fn a_file_of_the_first_version_is_taken_along() {
    let folder = Folder::new();
    let ledger = folder.ledger().await;
    let id = queue(&*ledger, at(0)).await;
    let lease = claim_of(&*ledger, id, at(1)).await;
    ledger.close().await;
    let mut db = raw(&folder).await;
    for statement in [
        "ALTER TABLE jobs DROP COLUMN completed_token",
        "ALTER TABLE jobs DROP COLUMN completed_fingerprint",
        "DROP INDEX jobs_queue",
        "DROP INDEX jobs_by_start",
        "ALTER TABLE jobs DROP COLUMN priority",
        "ALTER TABLE jobs DROP COLUMN memory",
        "ALTER TABLE jobs DROP COLUMN likely_memory",
        "ALTER TABLE jobs DROP COLUMN clip",
        "CREATE INDEX jobs_queue ON jobs (queue_time, id) WHERE state = 1",
        "DROP TABLE seen_workers",
        "DROP INDEX jobs_by_time",
        "DROP INDEX jobs_by_state",
        "DROP INDEX keys_by_time",
        "DROP INDEX artifacts_by_project",
        "ALTER TABLE jobs DROP COLUMN project",
        "ALTER TABLE artifacts DROP COLUMN project",
        "ALTER TABLE artifacts DROP COLUMN evidence",
        "DROP INDEX jobs_by_end",
        "ALTER TABLE keys DROP COLUMN project",
        "CREATE INDEX jobs_by_time ON jobs (create_time, id)",
        "CREATE INDEX jobs_by_state ON jobs (state, create_time, id)",
        "CREATE INDEX keys_by_time ON keys (create_time, id)",
        "DROP TRIGGER job_attempts_begin",
        "DROP TRIGGER job_attempts_end",
        "DROP TABLE job_attempts",
        "DROP INDEX jobs_failed",
        "ALTER TABLE jobs DROP COLUMN trace_parent",
        "DROP TABLE tokens",
        "DROP TABLE content_credentials",
        "DROP TABLE read_files",
        "DROP TABLE readings",
        "DROP TABLE seen_files",
        "DROP TABLE commitments",
        "DROP TABLE assets",
        "DROP TABLE owners",
        "DROP TABLE signing_keys",
        "DROP TABLE deliveries",
        "DROP TABLE store_generation",
        "DROP TABLE hooks",
        "DROP TABLE upload_reservations",
        "ALTER TABLE jobs DROP COLUMN asked_id",
        "ALTER TABLE keys DROP COLUMN state",
        "ALTER TABLE keys DROP COLUMN state_reason",
        "ALTER TABLE keys DROP COLUMN state_time",
        "DELETE FROM _sqlx_migrations WHERE version > 1",
    ] {
        sqlx::query(statement).execute(&mut db).await.unwrap();
    }
    db.close().await.unwrap();

    let ledger = folder.ledger().await;
    assert_eq!(job(&*ledger, id).await, lease.job);
    let done = complete(&*ledger, &lease, &[], at(2)).await;
    assert_eq!(complete(&*ledger, &lease, &[], at(3)).await, done);
}

#[tokio::test]
async fn commitments_are_not_changed_by_accident() {
    let folder = Folder::new();
    folder.ledger().await.close().await;
    let mut db = raw(&folder).await;
    for statement in [
        "PRAGMA foreign_keys = OFF",
        "INSERT INTO assets (id, owner_id, display_name, sha256, key_id, payload, sealed_nonce, create_time) \
         VALUES (zeroblob(16), zeroblob(16), '', zeroblob(32), zeroblob(16), 1, x'00', 0)",
        "INSERT INTO commitments VALUES (1, zeroblob(16), zeroblob(16), x'00', zeroblob(32), zeroblob(64))",
    ] {
        sqlx::query(statement).execute(&mut db).await.unwrap();
    }
    for statement in [
        "UPDATE commitments SET signature = zeroblob(64)",
        "DELETE FROM commitments",
    ] {
        let error = sqlx::query(statement).execute(&mut db).await.unwrap_err();
        assert!(error.to_string().contains("commitments never"), "{error}");
    }
    // And bytes that are no commitment are an error, and no panic.
    let ledger = folder.ledger().await;
    refused!(
        ledger.head("default").await,
        LedgerError::BadCommitment { sequence: 1, .. }
    );
}

#[tokio::test]
async fn what_a_newer_version_wrote_into_a_row_is_an_error_and_no_panic() {
    let folder = Folder::new();
    let ledger = folder.ledger().await;
    let id = queue(&*ledger, at(0)).await;
    sqlx::query("UPDATE jobs SET kind = 77")
        .execute(&mut raw(&folder).await)
        .await
        .unwrap();
    refused!(
        ledger.get_job(id).await,
        LedgerError::Corrupt {
            what: "kind of job",
            value: 77
        }
    );
}

#[tokio::test]
async fn a_closed_ledger_says_so() {
    let ledger = Folder::new().ledger().await;
    ledger.close().await;
    refused!(ledger.cancel_job(uuid::Uuid::nil(), 0).await, LedgerError::Closed);
    assert!(ledger.check().await.is_err());
    ledger.close().await;
}

#[test]
fn numbers_are_those_of_the_api() {
    for (ours, theirs) in [
        (FailureReason::Unspecified, Reason::Unspecified),
        (FailureReason::InvalidInput, Reason::InvalidInput),
        (FailureReason::TargetMissed, Reason::TargetMissed),
        (FailureReason::WorkerLost, Reason::WorkerLost),
        (FailureReason::Internal, Reason::Internal),
        (FailureReason::AttemptsExhausted, Reason::AttemptsExhausted),
    ] {
        assert_eq!(ours as i32, theirs as i32);
        assert_eq!(FailureReason::from_number(theirs as i32), ours);
    }
    assert_eq!(FailureReason::from_number(99), FailureReason::Unspecified);
    use guardsplat_proto::v1::job::State;
    for (ours, theirs) in [
        (JobState::Queued, State::Queued),
        (JobState::Running, State::Running),
        (JobState::Succeeded, State::Succeeded),
        (JobState::Failed, State::Failed),
        (JobState::Cancelled, State::Cancelled),
    ] {
        assert_eq!(ours as i32, theirs as i32);
    }
    use guardsplat_proto::v1::key;
    for (ours, theirs) in [
        (KeyState::Active, key::State::Active),
        (KeyState::Retired, key::State::Retired),
        (KeyState::Revoked, key::State::Revoked),
    ] {
        assert_eq!(ours as i32, theirs as i32);
    }
}
