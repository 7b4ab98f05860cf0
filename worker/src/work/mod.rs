//! What the commands and the jobs of a server do alike, so that both give the same bytes and the same figures.
pub mod findings;
pub mod keys;
pub mod load;
pub mod settings;
pub mod sheet;
pub mod shown;
