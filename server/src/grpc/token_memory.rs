//! What is remembered of tokens, in so much memory whoever calls: who was refused of late, and which tokens are good. So
//! whoever tries tokens out is counted before the ledger is asked, and whoever has a good one beside them is not.
use std::hash::{BuildHasher, RandomState};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use crate::service::rate_limit::Payer;

/// Places of each table. That two share one is rare, and costs little: a caller is counted that need not be, or a token is
/// looked up once more.
const PLACES: usize = 1 << 13;
/// Who was refused is counted first for so long.
const LATELY: Duration = Duration::from_secs(60);

/// What is remembered.
pub struct TokenMemory {
    began: Instant,
    keys: RandomState,
    /// Milliseconds since it began, and one, at which somebody was refused.
    refused: Box<[AtomicU64]>,
    /// A part of the hash of a token that was good when it was last shown.
    good: Box<[AtomicU64]>,
}

impl Default for TokenMemory {
    fn default() -> Self {
        let table = || (0..PLACES).map(|_| AtomicU64::new(0)).collect();
        Self {
            began: Instant::now(),
            keys: RandomState::new(),
            refused: table(),
            good: table(),
        }
    }
}

impl TokenMemory {
    /// Somebody was refused, with this token.
    pub fn refuse(&self, payer: &Payer, hash: &[u8; 32]) {
        self.refused_at(payer).store(self.now(), Ordering::Relaxed);
        let (place, part) = self.good_at(hash);
        let _ = place.compare_exchange(part, 0, Ordering::Relaxed, Ordering::Relaxed);
    }

    /// A token was found to be good.
    pub fn found(&self, hash: &[u8; 32]) {
        let (place, part) = self.good_at(hash);
        place.store(part, Ordering::Relaxed);
    }

    /// Whether the ledger is to be asked only when the caller has a call left: it was refused of late, and the token is
    /// none that was good.
    pub fn doubts(&self, payer: &Payer, hash: &[u8; 32]) -> bool {
        let refused = self.refused_at(payer).load(Ordering::Relaxed);
        let lately = refused > 0 && self.now() - refused.min(self.now()) < LATELY.as_millis() as u64;
        let (place, part) = self.good_at(hash);
        lately && place.load(Ordering::Relaxed) != part
    }

    fn now(&self) -> u64 {
        self.began.elapsed().as_millis() as u64 + 1 // for longer than anything runs
    }

    fn refused_at(&self, payer: &Payer) -> &AtomicU64 {
        &self.refused[self.keys.hash_one(payer) as usize % PLACES]
    }

    fn good_at(&self, hash: &[u8; 32]) -> (&AtomicU64, u64) {
        // Nobody can have a token whose hash is as they want it, and which is good.
        let [place, part] = [0, 8].map(|at| u64::from_le_bytes(std::array::from_fn(|i| hash[at + i])));
        (&self.good[place as usize % PLACES], part.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access;

    #[test]
    fn only_strangers_who_were_refused_are_doubted() {
        let memory = TokenMemory::default();
        let [here, there] = ["192.0.2.1", "192.0.2.2"].map(|text| Payer::at(Some(text.parse().unwrap())));
        let [ours, guess] = ["ours", "guess"].map(access::hash);
        assert!(!memory.doubts(&here, &guess));
        memory.found(&ours);
        memory.refuse(&here, &guess);
        assert!(memory.doubts(&here, &guess) && !memory.doubts(&here, &ours));
        assert!(!memory.doubts(&there, &guess));
        // Revoked since.
        memory.refuse(&there, &ours);
        assert!(memory.doubts(&here, &ours));
    }
}
