//! What is done without anybody asking: leases that expire, deletions, deliveries to hooks, news from other servers.
pub mod deliveries;
pub mod housekeeping;
pub mod orphans;
pub mod remote_changes;
