//! The API over a real socket, with a real ledger and a real folder, called through generated clients.
mod admission;
mod artifacts;
mod claims;
mod harness;
mod housekeeping;
mod jobs;
mod key_states;
mod keys;
mod lists;
mod registry;
mod search_speed;
mod several;
mod submissions;
mod transport;
mod watch;
mod worker;
mod zombie;
