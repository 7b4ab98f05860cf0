//! What calls of others by HTTP need: a small server, signatures, notifications of stores, and programs that are run for
//! them.
pub mod notification;
pub mod object;
pub mod program;
pub mod server;
pub mod signature;
