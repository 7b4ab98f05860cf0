//! The progress of a job, for people.
use guardsplat_proto::v1::job::{Spec, State};
use guardsplat_proto::v1::progress::Stage;
use guardsplat_proto::v1::{Job, Progress};

use crate::console::{Console, Unit};
use crate::output::printable;

/// What was said of a job so far.
#[derive(Default)]
pub struct ProgressView {
    failed_attempt: i32,
    running: bool,
    ending: bool,
    waiting_reason: String,
}

impl ProgressView {
    /// Shows a job as it stands.
    pub fn job(&mut self, console: &Console, job: &Job) {
        if let Some(line) = self.failed_attempt(job) {
            console.say(&line);
        }
        if self.handed_back(job) {
            console.say("its worker left and handed it back; it waits for another");
        }
        if job.cancel_requested && !self.ending {
            self.ending = true;
            console.say("its end was asked for");
        }
        if let Some(line) = self.nobody_for_it(job) {
            console.say(&line);
        }
        match job.state() {
            State::Queued => console.show("queued", Unit::Waiting, 0, 0, &queue(job)),
            State::Running => {
                let progress = job.progress.unwrap_or_default();
                let (title, unit) = stage(job, &progress);
                let count = |n: i64| u64::try_from(n).unwrap_or_default();
                console.show(
                    title,
                    unit,
                    count(progress.done),
                    count(progress.total),
                    &figures(&progress),
                );
            }
            _ => console.clear(),
        }
    }

    /// Whether a worker gave it up that did not fail.
    fn handed_back(&mut self, job: &Job) -> bool {
        let was_running = std::mem::replace(&mut self.running, job.state() == State::Running);
        was_running && job.state() == State::Queued && job.failure.is_none()
    }

    /// That no worker could be given it, once for each reason.
    fn nobody_for_it(&mut self, job: &Job) -> Option<String> {
        if job.waiting_reason == self.waiting_reason {
            return None;
        }
        self.waiting_reason.clone_from(&job.waiting_reason);
        let reason = printable(&job.waiting_reason);
        (!job.waiting_reason.is_empty()).then(|| format!("it waits: {reason}"))
    }

    /// That an attempt failed, once.
    fn failed_attempt(&mut self, job: &Job) -> Option<String> {
        let failure = job.failure.as_ref()?;
        if job.state() != State::Queued || job.attempt <= self.failed_attempt {
            return None;
        }
        self.failed_attempt = job.attempt;
        let message = printable(&failure.message);
        Some(format!(
            "attempt {} of {} failed: {message}; there will be another",
            job.attempt, job.max_attempts
        ))
    }
}

fn queue(job: &Job) -> String {
    match job.queue_position {
        None => String::new(),
        Some(0) => "next".into(),
        Some(1) => "1 job before it".into(),
        Some(n) => format!("{n} jobs before it"),
    }
}

fn stage(job: &Job, progress: &Progress) -> (&'static str, Unit) {
    let title = match (progress.stage(), &job.spec) {
        (Stage::Unspecified | Stage::Preparing, _) => "preparing",
        (Stage::Optimising, Some(Spec::CreateKey(_))) => "training",
        (Stage::Optimising, _) => "marking",
        (Stage::Reading, _) => "reading",
        (Stage::Storing, _) => "storing",
    };
    let unit = if progress.total > 0 { Unit::Steps } else { Unit::Waiting };
    (title, unit)
}

fn figures(progress: &Progress) -> String {
    let bits = progress.bit_accuracy.map(|a| format!("bits {:.1} %", 100.0 * a));
    let psnr = progress.psnr_db.map(|db| format!("PSNR {db:.1} dB"));
    [bits, psnr].into_iter().flatten().collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use guardsplat_proto::v1::Failure;

    #[test]
    fn figures_are_shown_as_far_as_they_are_known() {
        let mut progress = Progress::default();
        assert_eq!(figures(&progress), "");
        progress.bit_accuracy = Some(0.875);
        assert_eq!(figures(&progress), "bits 87.5 %");
        progress.psnr_db = Some(35.25);
        assert_eq!(figures(&progress), "bits 87.5 %, PSNR 35.2 dB");
    }

    #[test]
    fn a_failed_attempt_is_told_once() {
        let mut show = ProgressView::default();
        let mut job = Job {
            attempt: 1,
            max_attempts: 3,
            failure: Some(Failure {
                reason: 3,
                message: "the worker was lost".into(),
            }),
            ..Job::default()
        };
        job.set_state(State::Queued);
        let line = show.failed_attempt(&job).unwrap();
        assert!(line.starts_with("attempt 1 of 3 failed: the worker was lost"), "{line}");
        assert_eq!(show.failed_attempt(&job), None);
        job.attempt = 2;
        assert!(show.failed_attempt(&job).is_some());
    }

    #[test]
    fn a_job_that_was_handed_back_says_so() {
        let mut show = ProgressView::default();
        let mut told = |state, failure: Option<Failure>| {
            let mut job = Job {
                failure,
                ..Job::default()
            };
            job.set_state(state);
            show.handed_back(&job)
        };
        assert!(!told(State::Queued, None));
        assert!(!told(State::Running, None));
        assert!(told(State::Queued, None));
        assert!(!told(State::Queued, None));
        assert!(!told(State::Running, None));
        // That an attempt failed is told already.
        assert!(!told(State::Queued, Some(Failure::default())));
        assert!(!told(State::Running, None) && !told(State::Succeeded, None));
    }

    #[test]
    fn keys_are_trained_and_scenes_marked() {
        let mut progress = Progress {
            total: 5,
            ..Progress::default()
        };
        progress.set_stage(Stage::Optimising);
        let mut job = Job::default();
        assert_eq!(stage(&job, &progress), ("marking", Unit::Steps));
        job.spec = Some(Spec::CreateKey(Default::default()));
        assert_eq!(stage(&job, &progress).0, "training");
        progress.total = 0;
        assert_eq!(stage(&job, &progress).1, Unit::Waiting);
    }
}
