//! Times the stages of a step: for who watches the embedding, and for profiling (`RUST_LOG=guardsplat_engine::embed=debug`).
use std::time::Instant;

use super::progress::StepTimes;

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
    /// Of the step so far.
    step: [f64; STAGES],
    /// Of all steps since the last report.
    ms: [f64; STAGES],
    steps: usize,
}

impl StepTimer {
    pub fn new() -> Self {
        Self {
            clock: Instant::now(),
            step: [0.0; STAGES],
            ms: [0.0; STAGES],
            steps: 0,
        }
    }

    /// Starts the clock of a step.
    pub fn start(&mut self) {
        self.clock = Instant::now();
        self.step = [0.0; STAGES];
    }

    /// Books the time since the last call on `stage`.
    pub fn lap(&mut self, stage: Stage) {
        self.step[stage as usize] += self.clock.elapsed().as_secs_f64() * 1e3;
        self.clock = Instant::now();
    }

    /// Returns how long the step took, and tells the means of every `every` steps.
    pub fn end_step(&mut self, step: usize, every: usize) -> StepTimes {
        self.ms.iter_mut().zip(self.step).for_each(|(sum, ms)| *sum += ms);
        self.steps += 1;
        let times = times(self.step);
        if self.steps >= every {
            let mean = times_of_mean(self.ms, self.steps);
            tracing::debug!(
                step,
                prepare = mean.prepare,
                colours = mean.colours,
                render = mean.render,
                loss = mean.loss,
                backward = mean.backward,
                sh_backward = mean.sh_backward,
                adam = mean.optimiser,
                check = mean.check,
                "mean ms a step"
            );
            *self = Self::new();
        }
        times
    }
}

/// To hundredths of a millisecond.
fn times_of_mean(ms: [f64; STAGES], steps: usize) -> StepTimes {
    times(ms.map(|ms| (ms / steps as f64 * 100.0).round() / 100.0))
}

fn times(ms: [f64; STAGES]) -> StepTimes {
    let [prepare, colours, render, loss, backward, sh_backward, optimiser, check] = ms;
    StepTimes {
        prepare,
        colours,
        render,
        loss,
        backward,
        sh_backward,
        optimiser,
        check,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_told_what_it_took_itself() {
        let mut timer = StepTimer::new();
        for step in 1..=3 {
            timer.start();
            std::thread::sleep(std::time::Duration::from_millis(2));
            timer.lap(Stage::Loss);
            let times = timer.end_step(step, 2);
            assert!(times.loss >= 2.0 && times.prepare == 0.0, "{times:?}");
        }
        assert_eq!(timer.steps, 1);
    }
}
