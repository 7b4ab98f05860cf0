//! How much memory a file may ask for: its pictures are small by nature of their compression, and so are bombs. And never
//! more than there is.

/// Most bytes that all pictures and all numbers in them may have: 33 million Gaussians with three bands.
const MAX_BYTES: u64 = 8 << 30;

/// Most bytes of pictures and numbers for each byte of the file. Scenes of PlayCanvas' tools have 9 to 17: 15 bytes a
/// Gaussian in the file, 24 in the pictures, and up to 236 in numbers.
const MAX_RATIO: u64 = 64;

/// What is allowed whatever the file's size: pictures of a few thousand equal Gaussians have next to no bytes.
const SLACK: u64 = 1 << 20;

/// What is left of the allowance.
pub(crate) struct Budget {
    limit: u64,
    left: u64,
    /// Whether the limit is the memory that there is, and not what a file of this size may ask for.
    of_memory: bool,
    overdrawn: bool,
}

impl Budget {
    /// The allowance for a file of `size` bytes.
    pub fn new(size: u64) -> Budget {
        let limit = size.saturating_mul(MAX_RATIO).saturating_add(SLACK).min(MAX_BYTES);
        Budget {
            limit,
            left: limit,
            of_memory: false,
            overdrawn: false,
        }
    }

    /// The allowance for a file of `size` bytes where there are `memory` bytes for it and all that is in it.
    pub fn within(size: u64, memory: u64) -> Budget {
        let budget = Budget::new(size);
        let rest = memory.saturating_sub(size);
        match rest < budget.limit {
            true => Budget {
                limit: rest,
                left: rest,
                of_memory: true,
                overdrawn: false,
            },
            false => budget,
        }
    }

    /// Whether more memory was asked for than there is.
    pub fn lacks_memory(&self) -> bool {
        self.of_memory && self.overdrawn
    }

    /// Takes `bytes` from what is left, before they are allocated; `Err` says that there is not so much.
    pub fn spend(&mut self, bytes: u64) -> Result<(), String> {
        match self.left.checked_sub(bytes) {
            Some(left) => {
                self.left = left;
                Ok(())
            }
            None => {
                self.overdrawn = true;
                Err(format!(
                    "more than {} bytes unpacked, the limit for a file of this size",
                    self.limit
                ))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_spent_is_gone() {
        let mut budget = Budget::new(10);
        budget.spend(640).unwrap();
        budget.spend(SLACK).unwrap();
        budget.spend(0).unwrap();
        let reason = budget.spend(1).unwrap_err();
        assert_eq!(
            reason,
            "more than 1049216 bytes unpacked, the limit for a file of this size"
        );
        assert!(Budget::new(u64::MAX).spend(MAX_BYTES).is_ok());
        assert!(Budget::new(u64::MAX).spend(MAX_BYTES + 1).is_err());
    }

    #[test]
    fn what_there_is_bounds_what_is_allowed() {
        let mut large = Budget::within(1000, 1000 + 64_000 + SLACK);
        assert!(large.spend(64_001 + SLACK).is_err() && !large.lacks_memory());
        let mut small = Budget::within(1000, 1500);
        small.spend(500).unwrap();
        assert!(!small.lacks_memory());
        assert!(small.spend(1).is_err() && small.lacks_memory());
        assert!(Budget::within(1000, 10).spend(1).is_err());
    }
}
