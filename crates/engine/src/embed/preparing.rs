//! Views of the next steps, prepared while a step is computed: what they show does not depend on it.
use std::collections::VecDeque;
use std::panic::resume_unwind;
use std::sync::Arc;
use std::thread::{Scope, ScopedJoinHandle};

use super::view_pool::{Ahead, Upcoming};
use crate::error::Result;
use crate::extract::Engine;
use crate::splat::Geometry;

/// Steps that are prepared at a time. One is not enough where there are many cores: parts of a view's preparation follow
/// one another.
const STEPS: usize = 2;
/// The same where a card computes the steps: it needs views faster, and the cores have nothing else to do.
const STEPS_FOR_A_CARD: usize = 4;
/// Gaussians up to which more steps are prepared for a card: views of large scenes take much memory.
const SMALL: usize = 1 << 18;

/// Steps of a scene of so many Gaussians whose views are prepared while one before is computed.
pub(super) fn steps_ahead(on_cpu: bool, gaussians: usize) -> usize {
    match on_cpu || gaussians > SMALL {
        true => STEPS,
        false => STEPS_FOR_A_CARD,
    }
}

/// Threads that prepare views, of the nearest step first.
pub(super) struct Preparing<'scope, 'env> {
    scope: &'scope Scope<'scope, 'env>,
    running: VecDeque<ScopedJoinHandle<'scope, Result<Ahead>>>,
}

impl<'scope, 'env: 'scope> Preparing<'scope, 'env> {
    /// Nothing is prepared yet.
    pub fn new(scope: &'scope Scope<'scope, 'env>) -> Self {
        Self {
            scope,
            running: VecDeque::with_capacity(STEPS),
        }
    }

    /// Begins with what is next: views of `steps` to come at most, as `upcoming` tells of the one after so many.
    pub fn begin(
        &mut self,
        engine: &'env Engine,
        geometry: &Arc<Geometry<'env>>,
        steps: usize,
        upcoming: impl Fn(usize) -> Upcoming,
    ) {
        let at_once = steps_ahead(engine.on_cpu(), geometry.len());
        while self.running.len() < steps.min(at_once) {
            let (upcoming, geometry) = (upcoming(self.running.len()), geometry.clone());
            let running = self.scope.spawn(move || upcoming.prepare(engine, &geometry));
            self.running.push_back(running);
        }
    }

    /// Waits for the views of the next step, if any are prepared.
    ///
    /// # Errors
    /// Those of [`Upcoming::prepare`].
    pub fn next(&mut self) -> Result<Option<Ahead>> {
        let Some(running) = self.running.pop_front() else {
            return Ok(None);
        };
        running.join().unwrap_or_else(|panic| resume_unwind(panic)).map(Some)
    }
}
