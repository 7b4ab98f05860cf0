//! The GuardSplat server: API, job ledger, keys and claims. Empty so far: the engine in `worker` comes first.
