//! A request to stop: whoever waits for the engine makes it, and the engine looks at it between small pieces of work.
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Error, Result};

/// Shared by who may ask for an end and who is to heed it; nobody has asked at first.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Asks for an end. It can't be taken back; other work needs another [`Stop`].
    pub fn request(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether an end was asked for.
    pub fn is_requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// For `?` between two pieces of work.
    ///
    /// # Errors
    /// [`Error::Stopped`] once an end was asked for.
    pub fn check(&self) -> Result<()> {
        if self.is_requested() {
            Err(Error::Stopped)
        } else {
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_clones_hear_it() {
        let stop = Stop::default();
        let other = stop.clone();
        other.check().unwrap();
        stop.request();
        assert!(matches!(other.check(), Err(Error::Stopped)));
        Stop::default().check().unwrap();
    }
}
