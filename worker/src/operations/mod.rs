//! What the commands and the jobs of a server do alike, so that both give the same bytes and the same figures.
pub mod comparison_sheet;
pub mod create_key;
pub mod embed_settings;
pub mod load;
pub mod thumbnails;
pub mod verification;
