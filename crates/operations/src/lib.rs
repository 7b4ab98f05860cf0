//! What programs do with the engine, from what users choose to what they are told: shared by the offline commands, the
//! jobs of a server and the Python package, so that all give the same bytes and figures. No command line, no gRPC.
pub mod comparison;
pub mod comparison_sheet;
pub mod create_key;
pub mod embed_levels;
pub mod embed_report;
pub mod embed_settings;
pub mod error_text;
pub mod forecast;
pub mod inspect;
pub mod load;
pub mod registered;
pub mod render;
pub mod sample;
pub mod search;
pub mod suspect;
pub mod thumbnails;
pub mod verification;
pub mod verification_report;
