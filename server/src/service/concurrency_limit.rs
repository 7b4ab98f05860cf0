//! How many watches or transfers a caller may have at once: so many, by project where tokens are asked for, by address
//! where not.
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::service::rate_limit::Payer;

/// Counts what callers have open. What is kept is bounded by what is open.
#[derive(Default)]
pub struct ConcurrencyLimit(Mutex<HashMap<Payer, u32>>);

/// Of one stream, for as long as it is there: also of one that was shed, since it still takes room.
pub struct Permit {
    limit: Arc<ConcurrencyLimit>,
    payer: Payer,
}

impl ConcurrencyLimit {
    /// A permit for one more, if the caller has fewer than `most`; 0 is no limit.
    pub fn take(self: &Arc<Self>, payer: Payer, most: u32) -> Option<Permit> {
        let mut open = self.lock();
        let count = open.get(&payer).copied().unwrap_or(0);
        if most > 0 && count >= most {
            return None;
        }
        open.insert(payer.clone(), count.saturating_add(1));
        drop(open);
        Some(Permit {
            limit: self.clone(),
            payer,
        })
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<Payer, u32>> {
        // What it holds is whole at every moment.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Permit {
    fn drop(&mut self) {
        let mut open = self.limit.lock();
        match open.get_mut(&self.payer) {
            Some(count) if *count > 1 => *count -= 1,
            _ => drop(open.remove(&self.payer)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_caller_has_so_many_at_once_and_others_have_theirs() {
        let limit = Arc::new(ConcurrencyLimit::default());
        let take = |name: &str, most| limit.take(Payer::Project(name.into()), most);
        let (first, _second) = (take("one", 2).unwrap(), take("one", 2).unwrap());
        assert!(take("one", 2).is_none());
        let other = take("other", 2).unwrap();
        drop(first);
        let third = take("one", 2).unwrap();
        assert!(take("one", 2).is_none());
        drop((third, other));
        assert_eq!(limit.lock().len(), 1);
        let many: Vec<_> = (0..100).map(|_| take("one", 0).unwrap()).collect();
        drop(many);
        take("one", 2).unwrap();
    }
}
