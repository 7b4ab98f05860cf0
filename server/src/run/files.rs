//! How many files the process may have open, connections among them.
use nix::sys::resource::{Resource, getrlimit, setrlimit};

use crate::grpc::listener::ConnectionLimits;
use crate::settings::Settings;

/// As many are enough for everything; where there is no limit there need be none.
const ENOUGH: u64 = 65_536;
/// What is there where the system does not say.
const USUAL: u64 = 1_024;

/// Raises the limit of open files as far as that goes without asking anybody, and says what it is.
pub(super) fn raise() -> u64 {
    let Ok((soft, hard)) = getrlimit(Resource::RLIMIT_NOFILE) else {
        return USUAL;
    };
    let wanted = hard.min(ENOUGH).max(soft);
    match setrlimit(Resource::RLIMIT_NOFILE, wanted, hard) {
        Ok(()) => wanted,
        Err(_) => soft,
    }
}

/// How many connections there may be: the other half of the files is for artifacts, the ledger, stores and metrics.
pub(super) fn connections(settings: &Settings, files: u64) -> ConnectionLimits {
    let half = usize::try_from(files / 2).unwrap_or(usize::MAX).max(2);
    let wanted = |number: u32| usize::try_from(number).unwrap_or(usize::MAX);
    let total = wanted(settings.max_connections).min(half);
    ConnectionLimits {
        total,
        of_one_address: wanted(settings.max_connections_per_address).min(total / 2),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn connections_leave_files_for_everything_else() {
        let settings = Settings::default();
        let limits = |files| {
            let ConnectionLimits { total, of_one_address } = connections(&settings, files);
            (total, of_one_address)
        };
        assert_eq!(limits(1024), (512, 256));
        assert_eq!(limits(ENOUGH), (4096, 1024));
        assert_eq!(limits(0), (2, 1));
    }

    #[test]
    fn the_limit_is_raised_to_what_it_may_be() {
        let files = raise();
        let (soft, hard) = getrlimit(Resource::RLIMIT_NOFILE).unwrap();
        assert_eq!((files, files), (soft, hard.min(ENOUGH).max(soft)));
    }
}
