//! The GuardSplat command-line client. Empty so far: the engine in `worker` comes first.
