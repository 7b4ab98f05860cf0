//! What calls of others by HTTP need: a small server, signatures, notifications of stores, and programs that are run for
//! them.
pub mod fetch;
pub mod http;
pub mod notification;
pub mod program;
pub mod signature;
