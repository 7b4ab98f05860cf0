//! What commands print as JSON: names and meanings as in the engine's own, where they mean the same.
mod artifact;
mod attempt;
mod credentials;
mod embed;
mod hook;
mod job;
mod key;
mod registry;
mod text;
mod token;
mod verify;
mod worker;

pub use artifact::ArtifactReport;
pub use attempt::{AttemptReport, outcome_word};
pub use embed::EmbedReport;
pub use hook::{DeliveryReport, HookReport};
pub use job::{FailureReport, JobReport, kind, preset};
pub use key::{KeyReport, KeyResultReport};
pub use registry::{AssetReport, OwnerReport};
pub use text::{time, word};
pub use token::TokenReport;
pub use verify::VerifyReport;
pub use worker::WorkerReport;
