//! Owners, their assets, and what was signed about them.
mod assets;
pub(crate) mod commitments;
mod owners;
