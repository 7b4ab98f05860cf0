//! The API over a real socket, with a real ledger and a real folder, called through generated clients.
mod access;
mod admission;
mod artifacts;
mod calls;
mod claims;
mod harness;
mod housekeeping;
mod jobs;
mod key_states;
mod keys;
mod lists;
mod registry;
mod submissions;
mod transport;
mod watch;
mod worker;
mod zombie;
