//! What was measured, kept on disk as it comes in, and told as JSON, CSV and HTML with plots.
mod interval;
pub mod named;
pub mod names;
pub mod output;
pub mod paper;
pub mod plot;
pub mod record;
pub mod selection;
pub mod store;
pub mod summary;
pub mod table;
pub mod targets;
#[cfg(test)]
mod testing;
