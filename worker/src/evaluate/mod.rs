//! Evaluation: scenes, lengths, settings and seeds are marked, every mark is read under every attack, and all of it is kept.
//!
//! [`plan`] says what an experiment needs, [`trial`] what is done to a mark before it is read, [`run`] does what is not in
//! the store yet, has claims made about marks and detectors judge them where that is asked for. What comes of it is told by [`guardsplat_evaluation::report`].
mod claims;
mod guessed;
mod mark;
mod plan;
mod read;
mod robustness;
mod run;
mod steganalysis;
mod trial;
mod trials;
mod variants;
mod view_readings;

pub use plan::{Trade, plan};
pub use robustness::{Robustness, attacks};
pub use run::{Options, Progress, run};
pub use variants::{Variant, variants};
