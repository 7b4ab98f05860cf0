//! The tables: who may change them, what a newer version left, and that rows are found by their indexes.
use sqlx::Row;
use sqlx::migrate::Migrator;

use super::super::super::conformance::fixture::*;
use super::super::super::{
    CommitmentLog, JobStore, LedgerError, PostgresLedger, Registry, Statistics, TokenLedger, Usage,
};
use super::super::jobs::{PAGE, PAGE_OF_STATE};
use super::super::queue::{CLAIM, GET, QUEUE};
use super::super::{commitments, credentials, deliveries, hooks, keys, open, registry, statistics, tokens};
use super::Place;

#[tokio::test]
async fn tables_of_a_newer_version_are_refused() {
    let Some(place) = Place::fresh().await else { return };
    let newer = "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time) \
                 VALUES (99, 'of a newer version', true, '\\x00', 0)";
    sqlx::query(newer).execute(&mut place.raw().await).await.unwrap();
    let opened = PostgresLedger::open(&place.url()).await;
    assert!(matches!(opened.err(), Some(LedgerError::Migrate(_))));
}

/// What was made before there were projects is the default one's.
#[tokio::test]
async fn tables_of_the_first_version_are_taken_along() {
    let Some(place) = Place::empty().await else { return };
    let mut db = place.raw().await;
    let first = open::steps().into_iter().take(1).collect();
    let made = Migrator::with_migrations(first).run_direct(None, &mut db, false).await;
    made.unwrap();
    for statement in [
        "INSERT INTO jobs (id, display_name, kind, spec, fingerprint, state, max_attempts, create_time, update_time, \
         queue_time) VALUES (gen_random_uuid(), 'a scene', 1, '', '', 1, 3, 1, 1, 1)",
        "INSERT INTO artifacts (id, display_name, size, sha256, secret, path, state, create_time, update_time) \
         VALUES (gen_random_uuid(), 'a.ply', 7, '', false, '', 3, 1, 1)",
        "INSERT INTO owners (id, display_name, create_time) VALUES (gen_random_uuid(), 'studio', 1)",
    ] {
        sqlx::query(statement).execute(&mut db).await.unwrap();
    }
    let ledger = place.ledger().await;
    let jobs = ledger.list_jobs(OURS, &[], None, 5).await.unwrap();
    assert_eq!((jobs.len(), jobs[0].project.as_str()), (1, OURS));
    assert_eq!(ledger.list_owners(OURS, None, 5).await.unwrap().len(), 1);
    let usage = Usage {
        queued_jobs: 1,
        artifact_bytes: 7,
        reserved_bytes: 0,
    };
    assert_eq!(ledger.usage(OURS).await.unwrap(), usage);
    assert_eq!(ledger.list_tokens(None, None, 5).await.unwrap(), []);
}

#[tokio::test]
async fn what_a_newer_version_wrote_into_a_row_is_an_error_and_no_panic() {
    let Some(place) = Place::fresh().await else { return };
    let ledger = place.ledger().await;
    let id = queue(&*ledger, at(0)).await;
    sqlx::query("UPDATE jobs SET kind = 77")
        .execute(&mut place.raw().await)
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
async fn commitments_are_not_changed_by_accident() {
    let Some(place) = Place::fresh().await else { return };
    let mut db = place.raw().await;
    for statement in [
        "SET session_replication_role = replica",
        "WITH asset AS (INSERT INTO assets (id, owner_id, display_name, sha256, key_id, payload, sealed_nonce, \
         create_time) VALUES (gen_random_uuid(), gen_random_uuid(), '', decode(repeat('00', 32), 'hex'), \
         gen_random_uuid(), 1, '\\x00', 0) RETURNING id) \
         INSERT INTO commitments SELECT 1, gen_random_uuid(), id, '\\x00'::bytea, decode(repeat('00', 32), \
         'hex'), decode(repeat('00', 64), 'hex') FROM asset",
        "SET session_replication_role = origin",
    ] {
        sqlx::query(statement).execute(&mut db).await.unwrap();
    }
    for statement in [
        "UPDATE commitments SET signature = signature",
        "DELETE FROM commitments",
        "TRUNCATE commitments",
    ] {
        let error = sqlx::query(statement).execute(&mut db).await.unwrap_err();
        assert!(error.to_string().contains("commitments never"), "{error}");
    }
    // And bytes that are no commitment are an error, and no panic.
    let ledger = place.ledger().await;
    refused!(
        ledger.head("default").await,
        LedgerError::BadCommitment { sequence: 1, .. }
    );
}

/// With few rows the planner reads all of them; told not to, it says whether there is another way.
#[tokio::test]
async fn rows_are_found_by_their_indexes_and_never_sorted() {
    let Some(place) = Place::fresh().await else { return };
    let mut db = place.raw().await;
    for setting in ["enable_seqscan", "enable_bitmapscan", "enable_sort", "enable_hashjoin"] {
        let off = sqlx::AssertSqlSafe(format!("SET {setting} = off"));
        sqlx::query(off).execute(&mut db).await.unwrap();
    }
    let (page, assets) = ("bigint, uuid, bigint, text", "bigint, uuid, bigint, uuid, uuid, text");
    let by_index = [
        (
            CLAIM,
            "jobs_queue",
            "text, bytea, bigint, bigint, int, bigint, bigint, bigint, text[]",
        ),
        (GET, "jobs_queue", "uuid"),
        (PAGE, "jobs_by_time", page),
        (PAGE_OF_STATE, "jobs_by_state", "bigint, uuid, bigint, text, int"),
        (keys::PAGE, "keys_by_time", page),
        (registry::OWNERS, "owners_by_time", page),
        (tokens::OF_HASH, "tokens_hash_key", "bytea"),
        (tokens::OF_PROJECT, "tokens_by_project", page),
        (statistics::USAGE, "artifacts_by_project", "text"),
        (statistics::USAGE, "upload_reservations_by_project", "text"),
        (QUEUE, "jobs_queue", ""),
        (hooks::HOOKS, "hooks_by_project", page),
        (
            deliveries::CLAIM,
            "deliveries_due",
            "bigint, uuid[], bytea, bigint, text[]",
        ),
        (
            hooks::OF_PROJECT,
            "deliveries_by_project",
            "bigint, uuid, bigint, text, int",
        ),
        (hooks::OF_HOOK, "deliveries_by_hook", "bigint, uuid, bigint, uuid, int"),
        (registry::ASSETS, "assets_by_time", assets),
        (registry::OF_OWNER, "assets_by_owner", assets),
        (registry::OF_KEY, "assets_by_key", assets),
        (
            registry::CANDIDATES,
            "assets_key_id_payload_key",
            "uuid, bigint, bigint",
        ),
        (registry::LAST_PAYLOAD, "assets_key_id_payload_key", "uuid"),
        (
            credentials::BY_ASSET,
            "content_credentials_by_asset",
            "text, uuid, uuid, bigint",
        ),
        (
            credentials::BY_MESSAGE,
            "content_credentials_by_message",
            "text, text, uuid, bigint",
        ),
        (
            credentials::BY_BINDING,
            "content_credentials_by_binding",
            "text, text, bigint",
        ),
        (
            credentials::BY_MANIFEST,
            "content_credentials_by_manifest",
            "text, text, bigint",
        ),
        (commitments::HEAD, "commitments_pkey", ""),
        (commitments::CHAIN, "commitments_pkey", "bigint, bigint, text"),
    ];
    sqlx::query("SET plan_cache_mode = force_generic_plan")
        .execute(&mut db)
        .await
        .unwrap();
    for (i, (statement, index, types)) in by_index.into_iter().enumerate() {
        // A plan for any values, as a prepared statement gets in the end.
        let in_brackets = |list: String| if list.is_empty() { list } else { format!("({list})") };
        let types: Vec<_> = types.split(", ").filter(|word| !word.is_empty()).collect();
        let values = in_brackets(vec!["NULL"; types.len()].join(", "));
        let prepare = format!("PREPARE s{i}{} AS {statement}", in_brackets(types.join(", ")));
        sqlx::raw_sql(sqlx::AssertSqlSafe(prepare))
            .execute(&mut db)
            .await
            .unwrap();
        let explain = sqlx::AssertSqlSafe(format!("EXPLAIN EXECUTE s{i}{values}"));
        let plan = sqlx::raw_sql(explain).fetch_all(&mut db).await.unwrap();
        // Lanes, which are few; and the whole queue, of which there is no index.
        let sorts = [CLAIM, QUEUE].contains(&statement);
        let plan: String = plan.iter().map(|row| row.get::<String, _>(0) + "\n").collect();
        assert!(
            plan.contains(index) && (!plan.contains("Sort") || sorts) && !plan.contains("Seq Scan on"),
            "{statement}:\n{plan}"
        );
    }
}
