//! Helpers of the end-to-end tests: where the binaries and the real scenes are.
