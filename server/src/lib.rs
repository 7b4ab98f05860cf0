//! The GuardSplat server: API, job ledger, keys and claims. No GPU code.
pub mod access;
pub mod api;
pub mod artifacts;
pub mod backup;
pub mod embedded;
pub mod error;
pub mod hooks;
pub mod ledger;
pub mod marks;
pub mod metrics;
pub mod notary;
pub mod offline;
pub mod run;
pub mod secrets;
pub mod settings;
pub mod tls;
pub mod traces;
