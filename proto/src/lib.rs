//! The GuardSplat API: protocol buffers and generated code. Empty so far: the engine in `worker` comes first.
