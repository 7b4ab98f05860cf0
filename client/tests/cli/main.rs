//! The client as a user runs it, against a server that does what each test says.
mod claims;
mod direct;
mod embed;
mod errors;
mod fake;
mod hook;
mod interrupt;
mod jobs;
mod keys;
mod proxy;
mod resume;
mod run;
mod services;
mod tokens;
mod verify;
