//! Times the stages of a step, for profiling (`RUST_LOG=guardsplat_engine::embed=debug`).
use std::time::Instant;

/// Parts of a step, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    Prepare,
    Colours,
    Render,
    Loss,
    Backward,
    ShBackward,
    Adam,
    Check,
}

const STAGES: usize = Stage::Check as usize + 1;

/// Milliseconds by stage.
pub(super) struct StepTimer {
    clock: Instant,
    ms: [f64; STAGES],
    steps: usize,
}

impl StepTimer {
    pub fn new() -> Self {
        Self {
            clock: Instant::now(),
            ms: [0.0; STAGES],
            steps: 0,
        }
    }

    /// Starts the clock of a step.
    pub fn start(&mut self) {
        self.clock = Instant::now();
    }

    /// Books the time since the last call on `stage`.
    pub fn lap(&mut self, stage: Stage) {
        self.ms[stage as usize] += self.clock.elapsed().as_secs_f64() * 1e3;
        self.clock = Instant::now();
    }

    /// Tells the means of every `every` steps, then starts anew.
    pub fn end_step(&mut self, step: usize, every: usize) {
        self.steps += 1;
        if self.steps < every {
            return;
        }
        let [prepare, colours, render, loss, backward, sh_backward, adam, check] =
            self.ms.map(|ms| (ms / self.steps as f64 * 100.0).round() / 100.0);
        tracing::debug!(
            step,
            prepare,
            colours,
            render,
            loss,
            backward,
            sh_backward,
            adam,
            check,
            "mean ms a step"
        );
        *self = Self::new();
    }
}
