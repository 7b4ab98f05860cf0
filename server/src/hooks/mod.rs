//! Hooks: what is sent to registered URLs when jobs are over, how it is signed, and where it may be sent to. What is kept
//! of it is in [`crate::ledger::hooks`]; who sends it when, in `tasks::deliveries`.
pub mod address;
pub mod event;
mod pace;
mod post;
pub mod signature;
mod target;
#[cfg(test)]
pub(crate) mod tests;

use std::time::Duration;

pub use pace::next_attempt;
pub use post::{PostError, Poster};
pub use target::check_url;

/// What URLs may be, and how long they are tried.
#[derive(Clone, Debug, PartialEq)]
pub struct Rules {
    /// Whether a URL may be one of http, without encryption.
    pub allow_http: bool,
    /// Whether messages may go to addresses that are not public.
    pub allow_private: bool,
    /// A message that is not acknowledged for so long is given up.
    pub give_up_after: Duration,
}

impl Default for Rules {
    fn default() -> Self {
        Self {
            allow_http: false,
            allow_private: false,
            give_up_after: Duration::from_secs(3 * 24 * 60 * 60),
        }
    }
}

/// What a hook's secret is sealed for.
pub(crate) fn secret_context(id: crate::ledger::HookId) -> String {
    format!("hooks/{id}")
}
