//! The tables: who may change them, what a newer version left, and that rows are found by their indexes.
use sqlx::Row;

use super::super::super::conformance::fixture::*;
use super::super::super::{Ledger, LedgerError, PostgresLedger};
use super::super::jobs::{GET, PAGE, PAGE_OF_STATE, QUEUE};
use super::super::leases::CLAIM;
use super::super::{commitments, registry};
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
        "INSERT INTO commitments VALUES (1, gen_random_uuid(), gen_random_uuid(), '\\x00', decode(repeat('00', 32), \
         'hex'), decode(repeat('00', 64), 'hex'))",
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
    refused!(ledger.head().await, LedgerError::BadCommitment { sequence: 1, .. });
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
    let page = "bigint, uuid, bigint, uuid, uuid";
    let by_index = [
        (CLAIM, "jobs_queue", "text, bytea, bigint, bigint, int"),
        (GET, "jobs_queue", "uuid"),
        (PAGE, "jobs_by_time", page),
        (PAGE_OF_STATE, "jobs_by_state", "bigint, uuid, bigint, int"),
        (QUEUE, "jobs_queue", ""),
        (registry::ASSETS, "assets_by_time", page),
        (registry::OF_OWNER, "assets_by_owner", page),
        (registry::OF_KEY, "assets_by_key", page),
        (
            registry::CANDIDATES,
            "assets_key_id_payload_key",
            "uuid, bigint, bigint",
        ),
        (registry::LAST_PAYLOAD, "assets_key_id_payload_key", "uuid"),
        (commitments::HEAD, "commitments_pkey", ""),
        (commitments::CHAIN, "commitments_pkey", "bigint, bigint"),
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
        let plan: String = plan.iter().map(|row| row.get::<String, _>(0) + "\n").collect();
        assert!(
            plan.contains(index) && !plan.contains("Sort") && !plan.contains("Seq Scan on"),
            "{statement}:\n{plan}"
        );
    }
}
