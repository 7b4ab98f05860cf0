//! Jobs of this command line: created, followed until they are over, and shown meanwhile.
pub mod create;
pub mod progress;
pub mod watch;
