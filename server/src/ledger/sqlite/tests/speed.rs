//! How fast it is, and that the queue is found by its index.
use std::time::Instant;

use sqlx::Row;

use super::super::super::conformance::fixture::*;
use super::super::super::{JobStore, Ledger as _, NewJob};
use super::super::jobs::{PAGE, PAGE_OF_STATE};
use super::super::queue::{CLAIM, POSITION, QUEUE};
use super::super::{commitments, credentials, deliveries, hooks, keys, registry, statistics, tokens};
use super::Folder;
use super::file::raw;

/// How SQLite would go about a statement.
async fn plan(folder: &Folder, statement: &str) -> String {
    let explain = sqlx::AssertSqlSafe(format!("EXPLAIN QUERY PLAN {statement}"));
    let plan = sqlx::query(explain).fetch_all(&mut raw(folder).await).await.unwrap();
    plan.iter().map(|row| row.get::<String, _>("detail") + "; ").collect()
}

#[tokio::test]
async fn rows_are_found_by_their_indexes_and_never_sorted() {
    let folder = Folder::new();
    folder.ledger().await.close().await;
    let by_index = [
        (PAGE, "INDEX jobs_by_time (project=? AND (create_time,id)<"),
        (
            PAGE_OF_STATE,
            "INDEX jobs_by_state (project=? AND state=? AND (create_time,id)<",
        ),
        (keys::PAGE, "INDEX keys_by_time (project=? AND (create_time,id)<"),
        (
            registry::OWNERS,
            "INDEX owners_by_time (project=? AND (create_time,id)<",
        ),
        (
            registry::ASSETS,
            "INDEX assets_by_time (project=? AND (create_time,id)<",
        ),
        (
            registry::OF_OWNER,
            "INDEX assets_by_owner (owner_id=? AND (create_time,id)<",
        ),
        (registry::OF_KEY, "INDEX assets_by_key (key_id=? AND (create_time,id)<"),
        (registry::OF_BOTH, "=? AND (create_time,id)<"),
        (registry::CANDIDATES, "(key_id=? AND payload>?)"),
        (registry::LAST_PAYLOAD, "(key_id=?)"),
        (tokens::OF_HASH, "(hash=?)"),
        (
            tokens::OF_PROJECT,
            "INDEX tokens_by_project (project=? AND (create_time,id)<",
        ),
        (
            statistics::USAGE,
            "COVERING INDEX artifacts_by_project (project=? AND state=?)",
        ),
        (hooks::HOOKS, "INDEX hooks_by_project (project=? AND (create_time,id)<"),
        (deliveries::DUE, "INDEX deliveries_due (next_time<?)"),
        (
            hooks::OF_PROJECT,
            "INDEX deliveries_by_project (project=? AND (create_time,id)<",
        ),
        (
            hooks::OF_HOOK,
            "INDEX deliveries_by_hook (hook_id=? AND (create_time,id)<",
        ),
        (credentials::BY_ASSET, "INDEX content_credentials_by_asset (asset_id=?)"),
        (
            credentials::BY_MESSAGE,
            "INDEX content_credentials_by_message (key_id=? AND message=?)",
        ),
        (
            credentials::BY_BINDING,
            "INDEX content_credentials_by_binding (project=? AND soft_binding=?)",
        ),
        (
            credentials::BY_MANIFEST,
            "INDEX content_credentials_by_manifest (project=? AND manifest=?)",
        ),
        (commitments::CHAIN, "INTEGER PRIMARY KEY (rowid>?)"),
    ];
    for (statement, index) in by_index {
        let plan = plan(&folder, statement).await;
        assert!(
            plan.contains(index) && !plan.contains("TEMP B-TREE"),
            "{statement}: {plan}"
        );
    }
}

/// The queue has its order from lanes, which are few, and only these are sorted when a job is given out.
#[tokio::test]
async fn the_queue_is_found_lane_by_lane() {
    let folder = Folder::new();
    folder.ledger().await.close().await;
    let claim = plan(&folder, CLAIM).await;
    for step in [
        "COVERING INDEX jobs_queue (project=? AND priority>?)",
        "COVERING INDEX jobs_queue (project>?)",
        "COVERING INDEX jobs_queue (project=? AND priority=?)",
        "INDEX jobs_by_start (project=? AND priority=?",
        "INDEX jobs_leases",
    ] {
        assert!(claim.contains(step), "{step}: {claim}");
    }
    // The first lane is where the index begins; no table is read from end to end.
    assert!(!claim.contains("SCAN jobs;") && !claim.contains("SCAN j;"), "{claim}");
    let position = plan(&folder, POSITION).await;
    assert!(
        position.contains("SCAN jobs USING COVERING INDEX jobs_queue"),
        "{position}"
    );
    let queue = plan(&folder, QUEUE).await;
    assert!(queue.contains("SCAN q USING COVERING INDEX jobs_queue"), "{queue}");
}

/// Median, 99th percentile and worst of so many milliseconds.
fn quantiles(mut ms: Vec<f64>) -> [f64; 3] {
    ms.sort_by(f64::total_cmp);
    [ms[ms.len() / 2], ms[ms.len() * 99 / 100], ms[ms.len() - 1]]
}

/// Run with `-- --ignored --nocapture`; the figures depend on the disk.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "a measurement"]
async fn a_thousand_submissions() {
    for clients in [1, 8, 50] {
        let folder = Folder::new();
        let ledger = folder.ledger().await;
        let start = Instant::now();
        let tasks: Vec<_> = (0..clients)
            .map(|_| {
                let ledger = ledger.clone();
                tokio::spawn(async move {
                    let mut ms = Vec::new();
                    for i in 0..1000 / clients {
                        let start = Instant::now();
                        ledger
                            .create_job(
                                NewJob {
                                    spec: spec(7),
                                    ..new_job()
                                },
                                at(i),
                            )
                            .await
                            .unwrap();
                        ms.push(start.elapsed().as_secs_f64() * 1e3);
                    }
                    ms
                })
            })
            .collect();
        let mut ms = Vec::new();
        for task in tasks {
            ms.extend(task.await.unwrap());
        }
        let total = start.elapsed().as_secs_f64();
        let [p50, p99, worst] = quantiles(ms);
        println!(
            "create, {clients} at once: p50 {p50:.1} ms, p99 {p99:.1} ms, worst {worst:.1} ms, {total:.1} s in all"
        );
        assert!(p99 < 50.0, "99 of 100 submissions take {p99} ms");

        let mut ms = Vec::new();
        for _ in 0..200 {
            let start = Instant::now();
            claim(&*ledger, at(5000)).await.unwrap();
            ms.push(start.elapsed().as_secs_f64() * 1e3);
        }
        let [p50, p99, worst] = quantiles(ms);
        println!("claim, 1000 queued: p50 {p50:.1} ms, p99 {p99:.1} ms, worst {worst:.1} ms");
    }
}

/// As above.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
#[ignore = "a measurement"]
async fn claims_of_a_long_queue() {
    use crate::ledger::conformance::speed::{PROJECTS, claims_of_a_long_queue};
    for projects in PROJECTS {
        claims_of_a_long_queue("sqlite", &Folder::new(), projects).await;
    }
}
