//! What was measured, kept on disk as it comes in, and told as JSON, CSV and HTML with plots.
mod interval;
pub mod names;
pub mod record;
pub mod store;
#[cfg(test)]
mod testing;
mod whole;
