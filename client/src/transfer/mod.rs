//! Bytes on their way: to the server in chunks, and back into files that are whole or not there.
mod destination;
mod download;
mod signed_address;
mod signed_download;
mod signed_upload;
mod source;
mod upload;

pub use destination::Destination;
pub use download::download;
pub use source::Source;
pub use upload::{discard, upload};
