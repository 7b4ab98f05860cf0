//! Checks that every setting is within its limits.
use std::path::Path;

use tracing_subscriber::EnvFilter;

use super::{Access, Settings, SettingsError};
use crate::artifacts::Place;
use crate::ledger::postgres;
use crate::ledger::queue::PRIORITIES;

const DAY: u64 = 24 * 60 * 60;
/// A hundred years.
const MOST_DAYS: u64 = 36_500;

impl Settings {
    /// Refuses values that could not work, and names the limits.
    pub fn check(&self) -> Result<(), SettingsError> {
        let numbers = [
            ("max_artifact_bytes", self.max_artifact_bytes, 1, 1 << 40),
            ("max_queued_jobs", self.max_queued_jobs, 1, 1_000_000),
            (
                "max_queued_jobs_per_project",
                self.max_queued_jobs_per_project,
                0,
                1_000_000,
            ),
            (
                "max_artifact_bytes_per_project",
                self.max_artifact_bytes_per_project,
                0,
                1 << 60,
            ),
            (
                "max_submissions_per_minute",
                self.max_submissions_per_minute.into(),
                0,
                1_000_000,
            ),
            ("max_claims_per_minute", self.max_claims_per_minute.into(), 0, 1_000_000),
            ("max_calls_per_minute", self.max_calls_per_minute.into(), 0, 1_000_000),
            ("max_job_memory_mebibytes", self.max_job_memory_mebibytes, 0, 1 << 24),
            ("max_job_gigapixels", self.max_job_gigapixels, 0, 1_000_000),
            ("lease_seconds", self.lease_seconds, 1, DAY),
            ("progress_stall_seconds", self.progress_stall_seconds, 1, 30 * DAY),
            ("max_attempts", self.max_attempts.into(), 1, 100),
            ("upload_timeout_seconds", self.upload_timeout_seconds, 1, DAY),
            ("watch_stall_seconds", self.watch_stall_seconds, 1, DAY),
            (
                "max_watches_per_caller",
                self.max_watches_per_caller.into(),
                0,
                1_000_000,
            ),
            ("download_stall_seconds", self.download_stall_seconds, 1, DAY),
            (
                "max_transfers_per_caller",
                self.max_transfers_per_caller.into(),
                0,
                1_000_000,
            ),
            ("transfer_memory_mebibytes", self.transfer_memory_mebibytes, 16, 1 << 20),
            ("max_connections", self.max_connections.into(), 16, 1_000_000),
            (
                "max_connections_per_address",
                self.max_connections_per_address.into(),
                1,
                1_000_000,
            ),
            ("connection_idle_seconds", self.connection_idle_seconds, 0, DAY),
            ("abandoned_after_seconds", self.abandoned_after_seconds, 1, 365 * DAY),
            ("hook_give_up_seconds", self.hook_give_up_seconds, 1, 365 * DAY),
            // A week is the longest that S3 signs for.
            ("signed_url_seconds", self.signed_url_seconds, 0, 7 * DAY),
            ("keep_uploads_days", self.keep_uploads_days, 0, MOST_DAYS),
            ("keep_outputs_days", self.keep_outputs_days, 0, MOST_DAYS),
            ("keep_jobs_days", self.keep_jobs_days, 0, MOST_DAYS),
            ("stop_seconds", self.stop_seconds, 1, 60 * 60),
        ];
        for (field, value, least, most) in numbers {
            if !(least..=most).contains(&value) {
                return Err(SettingsError::OutOfRange {
                    field,
                    value,
                    least,
                    most,
                });
            }
        }
        let [least, most] = [*PRIORITIES.start(), *PRIORITIES.end()];
        if !PRIORITIES.contains(&self.max_priority) {
            return Err(SettingsError::Invalid {
                field: "max_priority",
                reason: format!("{} is not between {least} and {most}", self.max_priority),
            });
        }
        // NaN is outside of every range.
        if !(1e-30..=0.1).contains(&self.false_positive_rate) {
            return Err(SettingsError::Invalid {
                field: "false_positive_rate",
                reason: format!("{:e} is not between 1e-30 and 0.1", self.false_positive_rate),
            });
        }
        self.check_reach()?;
        self.check_page()?;
        self.check_tls()?;
        not_empty("data_dir", &self.data_dir)?;
        for (field, path) in [
            ("tls_certificate", &self.tls_certificate),
            ("tls_key", &self.tls_key),
            ("tls_client_ca", &self.tls_client_ca),
            ("hook_ca", &self.hook_ca),
            ("worker_binary", &self.worker_binary),
            ("master_key_file", &self.master_key_file),
        ] {
            if let Some(path) = path {
                not_empty(field, path)?;
            }
        }
        if let Some(database) = &self.database {
            postgres::check_url(database.secret()).map_err(|reason| SettingsError::Invalid {
                field: "database",
                reason,
            })?;
        }
        self.place()?;
        self.log_filter()?;
        Ok(())
    }

    /// What is logged.
    pub fn log_filter(&self) -> Result<EnvFilter, SettingsError> {
        let invalid = |reason: String| SettingsError::Invalid {
            field: "log_filter",
            reason,
        };
        // Filters on fields of spans are regular expressions that the library compiles without limits: 70 bytes of one
        // took gigabytes.
        if self.log_filter.contains(['[', '{']) {
            let reason = "filters on spans and fields are not supported; name targets and levels";
            return Err(invalid(reason.into()));
        }
        // After a space before a target the library takes the wrong part of the text, and panics if that begins or ends
        // inside a character.
        let directives: Vec<&str> = self.log_filter.split(',').map(str::trim).collect();
        EnvFilter::try_new(directives.join(",")).map_err(|error| invalid(error.to_string()))
    }

    /// Where artifacts are, if not in the data folder.
    pub fn place(&self) -> Result<Option<Place>, SettingsError> {
        let place = self.artifacts.as_deref().map(Place::parse).transpose();
        place.map_err(|reason| SettingsError::Invalid {
            field: "artifacts",
            reason,
        })
    }

    /// Refuses to be open to a network by oversight.
    fn check_reach(&self) -> Result<(), SettingsError> {
        // Certificates of clients keep strangers out too.
        let anybody = self.access == Access::Open && self.tls_client_ca.is_none();
        let open = anybody && !self.listen.ip().is_loopback();
        if !open || self.allow_open_network {
            return Ok(());
        }
        Err(SettingsError::Invalid {
            field: "listen",
            reason: format!(
                "{} can be reached from other machines, and access = \"open\" lets anybody in; set access = \"tokens\", \
                 or allow_open_network = true where the network keeps strangers out",
                self.listen
            ),
        })
    }

    /// Refuses a page that asks for no token: browsers carry out what any web page has them do, also to addresses of the
    /// machine they run on.
    fn check_page(&self) -> Result<(), SettingsError> {
        match (self.page_listen, self.access) {
            (Some(_), Access::Open) => Err(SettingsError::Invalid {
                field: "page_listen",
                reason: "the page is for callers with tokens; set access = \"tokens\"".into(),
            }),
            _ => Ok(()),
        }
    }

    /// Refuses half of what TLS needs.
    fn check_tls(&self) -> Result<(), SettingsError> {
        let missing = |field: &'static str, with: &str| {
            Err(SettingsError::Invalid {
                field,
                reason: format!("is missing, and {with} is of no use without it"),
            })
        };
        match (&self.tls_certificate, &self.tls_key, &self.tls_client_ca) {
            (Some(_), None, _) => missing("tls_key", "tls_certificate"),
            (None, Some(_), _) => missing("tls_certificate", "tls_key"),
            (None, None, Some(_)) => missing("tls_certificate", "tls_client_ca"),
            (Some(_), Some(_), _) | (None, None, None) => Ok(()),
        }
    }
}

fn not_empty(field: &'static str, path: &Path) -> Result<(), SettingsError> {
    if path.as_os_str().is_empty() {
        return Err(SettingsError::Invalid {
            field,
            reason: "an empty path".into(),
        });
    }
    Ok(())
}
