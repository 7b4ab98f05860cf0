//! Operations that the offline commands and the jobs of a server share, so that both give the same bytes and figures.
pub mod comparison_sheet;
pub mod create_key;
pub mod embed_settings;
pub mod load;
pub mod machine;
pub mod thumbnails;
pub mod verification;
