//! What every implementation of the ledger must do, as tests that run against a real one.
//!
//! `conformance_suite!(factory)` makes a test of each; a function here that the macro doesn't name is dead code, which
//! the compiler reports.
mod artifacts;
mod attempts;
mod cancelling;
mod credentials;
mod fencing;
pub(crate) mod fixture;
mod generation;
mod history;
mod hooks;
pub mod model;
mod operations;
mod outputs;
mod queue;
mod registry;
mod reservations;
mod retention;
pub mod speed;
mod submission;
mod tokens;

use std::sync::Arc;

use super::Ledger;

pub(crate) use artifacts::*;
pub(crate) use attempts::*;
pub(crate) use cancelling::*;
pub(crate) use credentials::*;
pub(crate) use fencing::*;
pub(crate) use generation::*;
pub(crate) use history::*;
pub(crate) use hooks::*;
pub(crate) use operations::*;
pub(crate) use outputs::*;
pub(crate) use queue::*;
pub(crate) use registry::*;
pub(crate) use reservations::*;
pub(crate) use retention::*;
pub(crate) use submission::*;
pub(crate) use tokens::*;

/// A place for one ledger, empty at first.
#[async_trait::async_trait]
pub trait Factory: Send + Sync {
    /// Opens it; again after the one opened before is gone.
    async fn open(&self) -> Arc<dyn Ledger>;

    /// Opens it for several servers at once, each as another machine would; the same one for all where it can't be
    /// shared.
    async fn open_several(&self, count: usize) -> Vec<Arc<dyn Ledger>> {
        vec![self.open().await; count]
    }
}

/// Makes a test of every function of the suite; each gets a factory of its own from `$factory`, or is skipped where that
/// is `None`.
macro_rules! conformance_suite {
    ($factory:expr) => {
        $crate::ledger::conformance::conformance_suite!(@tests $factory;
            a_job_is_kept_as_it_was_given
            the_same_request_is_the_same_job
            a_request_is_the_same_if_its_artifacts_hold_the_same
            one_request_sent_many_times_at_once_is_one_job
            what_a_job_needs_must_be_there
            acknowledged_work_survives
            pages_have_no_gaps_or_repeats_while_jobs_are_added
            states_select_jobs
            first_in_first_out
            positions_count_the_jobs_ahead
            the_most_urgent_job_goes_first
            projects_take_turns
            nobody_waits_for_ever
            positions_foresee_the_order
            a_repeated_job_keeps_its_priority
            a_job_goes_to_a_worker_that_can_hold_it
            workers_are_seen_for_a_while
            many_claims_never_share_a_job
            the_fourth_claim_gets_nothing
            a_job_without_attempts_is_never_given_out
            a_failed_attempt_waits_before_the_next
            a_final_failure_is_not_repeated
            a_failure_may_be_told_in_any_words
            a_released_job_is_not_charged_and_keeps_its_place
            reports_extend_the_lease_and_carry_progress
            leases_outlast_the_absence_of_the_server
            a_lost_worker_is_noticed
            expired_leases_are_ended_once
            tokens_differ_and_are_the_only_key
            a_reaped_zombie_can_write_nothing
            a_zombie_can_not_disturb_its_successor
            a_completion_may_be_said_again
            a_finished_job_takes_nothing_more
            unknown_things_are_not_found
            cancelling_a_queued_job_ends_it
            cancelling_a_running_job_asks_for_its_end
            a_cancelled_job_is_not_tried_again
            a_job_may_finish_although_it_was_cancelled
            only_a_cancelled_job_ends_as_cancelled
            uploads_are_seen_when_they_are_complete
            what_a_job_needs_is_not_deleted
            abandoned_uploads_are_collected
            outputs_of_attempts_that_are_over_are_collected
            outputs_are_published_by_completion_only
            completion_publishes_all_or_nothing
            credentials_are_found_by_their_mark
            credentials_come_with_their_job_and_go_with_their_sidecar
            keys_are_published_and_their_files_never
            keys_come_in_pages
            keys_are_retired_and_revoked_for_good
            an_asset_is_kept_and_committed_to
            the_same_request_registers_once
            one_registration_sent_many_times_at_once_is_one_asset
            what_an_asset_needs_must_be_there
            registrations_at_once_make_one_chain_without_gaps
            a_chain_goes_on_after_a_restart
            payload_numbers_run_out
            owners_and_assets_come_in_pages
            a_search_sees_every_asset_of_its_key_once
            every_reading_of_a_file_is_known
            an_upload_is_seen_for_good
            assets_are_counted_and_opened_once
            seeds_are_sealed_where_they_lay_open
            a_token_is_kept_and_found_by_its_hash
            a_revoked_token_stays_revoked
            the_use_of_a_token_is_noted
            tokens_come_in_pages_of_their_project
            lists_are_of_a_project
            a_job_names_what_is_of_its_project
            what_a_job_makes_is_of_its_project
            an_asset_names_what_is_of_its_project
            a_request_is_of_a_project
            what_a_running_job_reads_is_known
            what_a_project_takes_is_counted
            every_attempt_is_kept_with_its_end
            the_newest_twenty_attempts_are_kept
            a_failed_job_is_queued_once_more
            what_is_queued_once_more_needs_its_inputs
            jobs_are_counted_by_kind_state_and_reason
            a_job_keeps_the_trace_it_is_a_part_of
            a_generation_follows_another
            a_hook_is_kept_listed_and_deleted
            every_end_of_a_job_makes_one_delivery
            a_hook_is_told_of_what_it_wants_only
            a_delivery_is_sent_until_it_is_acknowledged
            a_delivery_is_given_up_and_sent_again
            a_delivery_that_was_lost_is_given_to_another
            servers_never_share_a_delivery
            deliveries_come_in_pages_and_are_forgotten
            a_hook_may_go_while_its_jobs_end
            a_project_has_so_many_deliveries_waiting_and_no_more
            bytes_are_reserved_until_the_artifact_is_there
            reservations_end
            reservations_at_once_stay_within_the_limit
            nothing_goes_by_itself
            uploads_go_when_they_were_not_used_for_long
            jobs_go_with_what_they_made
            paths_are_known_while_there_are_rows
            nothing_referenced_goes_by_age
        );
    };
    (@tests $factory:expr; $($test:ident)*) => {$(
        #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
        async fn $test() {
            if let Some(factory) = $factory {
                $crate::ledger::conformance::$test(&factory).await;
            }
        }
    )*};
}
pub(crate) use conformance_suite;
