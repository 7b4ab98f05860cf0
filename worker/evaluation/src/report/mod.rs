//! What was measured, kept on disk as it comes in, and told as JSON, CSV and HTML with plots.
pub mod names;
pub mod record;
#[cfg(test)]
mod testing;
