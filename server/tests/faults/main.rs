//! Faults, on both ledgers: what dies, stops, comes twice or comes late, and that nothing is lost for it.
//!
//! Each runs in a short version. With `GUARDSPLAT_FAULTS=full` in the environment it has the numbers of
//! docs/reliability.md, and prints the figures that stand there (`-- --nocapture --test-threads=1`). Times are printed
//! and hardly ever held against a bar: other machines are faster or slower, and busy.
mod away;
mod caller;
mod cancelling;
mod duplicates;
mod hoarders;
mod laggards;
mod load;
mod place;
mod server_kills;
mod stopping;
mod stub;
#[allow(dead_code)] // the other tests use the rest
#[path = "../support/mod.rs"]
mod support;
mod worker_kills;
mod zombies;

/// Makes a test of each fault for each ledger; skips PostgreSQL where it is not installed.
macro_rules! faults {
    ($($fault:path as $name:ident),* $(,)?) => {
        mod on_sqlite {$(
            #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
            async fn $name() {
                $fault(crate::place::Place::on_sqlite()).await;
            }
        )*}
        mod on_postgres {$(
            #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
            async fn $name() {
                if let Some(place) = crate::place::Place::on_postgres() {
                    $fault(place).await;
                }
            }
        )*}
    };
}

faults!(
    crate::worker_kills::at_every_point as workers_are_killed_at_every_point,
    crate::server_kills::amid_submissions as the_server_is_killed_amid_submissions,
    crate::zombies::are_refused as stopped_workers_that_come_back_are_refused,
    crate::duplicates::publish_once as duplicates_publish_once,
    crate::load::a_thousand_jobs as a_thousand_jobs_are_done_in_their_order,
    crate::load::more_workers as more_workers_do_more,
    crate::laggards::do_not_hold_up_others as laggards_do_not_hold_up_others,
    crate::hoarders::of_a_folder as hoarders_do_not_use_up_a_server_with_a_folder,
    crate::hoarders::of_a_bucket as hoarders_do_not_use_up_a_server_with_a_bucket,
    crate::hoarders::of_memory as hoarders_do_not_use_up_the_memory,
    crate::stopping::hands_back as a_server_that_stops_hands_back,
    crate::cancelling::ends_soon as cancelled_jobs_end_soon_and_stay_as_they_are,
    crate::away::the_database as the_database_goes_away_and_comes_back,
);

/// Not a test: the program that the tests start as a worker, which dies where its jobs say.
#[test]
#[ignore = "started by the other tests"]
fn stub_worker() {
    stub::process();
}
