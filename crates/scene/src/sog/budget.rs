//! How much memory a file may ask for: its pictures are small by nature of their compression, and so are bombs.

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
}

impl Budget {
    /// The allowance for a file of `size` bytes.
    pub fn new(size: u64) -> Budget {
        let limit = size.saturating_mul(MAX_RATIO).saturating_add(SLACK).min(MAX_BYTES);
        Budget { limit, left: limit }
    }

    /// Takes `bytes` from what is left, before they are allocated; `Err` says that there is not so much.
    pub fn spend(&mut self, bytes: u64) -> Result<(), String> {
        self.left = self.left.checked_sub(bytes).ok_or_else(|| {
            format!(
                "more than {} bytes unpacked, the limit for a file of this size",
                self.limit
            )
        })?;
        Ok(())
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
}
