//! Limits that errors name.

/// Most bits that a message can have: what the token tables of keys have room for.
pub const MAX_BITS: u32 = 150;

/// The version of the rules by which payloads are packed.
pub const VERSION: u8 = 1;
