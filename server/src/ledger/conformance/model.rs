//! Random work against a ledger and a model of it that is simple enough to be seen right.
use std::collections::HashMap;
use std::sync::Arc;

use proptest::prelude::*;
use uuid::Uuid;

use super::super::queue::PATIENCE;
use super::super::{JobId, JobState, Ledger, NewJob, ResourceRequirements, Result, WorkerCapabilities, retry::backoff};
use super::fixture::*;

/// One thing that somebody does. Numbers choose among the jobs, requests and leases that there are.
#[derive(Clone, Debug)]
pub enum Step {
    /// Queues a job, perhaps under a request id of a few, with one of two bodies, in a lane; it takes so much memory.
    Create(Option<u8>, bool, Lane, Option<i64>),
    /// Takes the next job that takes no more memory.
    Claim(Option<i64>),
    /// Reports under any lease ever given out, with progress or without.
    Report(usize, Option<u8>),
    /// Completes under any lease, with one of two results.
    Complete(usize, u8),
    /// Fails under any lease; retryable, cancelled.
    Fail(usize, bool, bool),
    /// Hands back under any lease.
    Release(usize),
    /// Cancels any job.
    Cancel(usize),
    /// Lets seconds pass.
    Wait(u16),
    /// Ends leases that expired.
    Reap,
}

/// A project and a priority.
type Lane = (&'static str, i32);

const PROJECTS: [&str; 3] = [OURS, "other", "third"];

/// Any sequence of steps.
pub fn steps() -> impl Strategy<Value = Vec<Step>> {
    let lane = (proptest::sample::select(&PROJECTS[..]), -1..2_i32);
    let memory = || proptest::option::of(0..3_i64);
    let step = prop_oneof![
        6 => (proptest::option::weighted(0.3, 0..4_u8), any::<bool>(), lane, memory())
            .prop_map(|(request, body, lane, memory)| Step::Create(request, body, lane, memory)),
        6 => memory().prop_map(Step::Claim),
        2 => (any::<usize>(), proptest::option::of(0..3_u8)).prop_map(|(lease, news)| Step::Report(lease, news)),
        2 => (any::<usize>(), 0..2_u8).prop_map(|(lease, said)| Step::Complete(lease, said)),
        3 => (any::<usize>(), prop::bool::weighted(0.8), prop::bool::weighted(0.2))
            .prop_map(|(lease, retryable, cancelled)| Step::Fail(lease, retryable, cancelled)),
        1 => any::<usize>().prop_map(Step::Release),
        2 => any::<usize>().prop_map(Step::Cancel),
        4 => (0..40_u16).prop_map(Step::Wait),
        1 => (500..700_u16).prop_map(Step::Wait),
        3 => Just(Step::Reap),
    ];
    proptest::collection::vec(step, 1..80)
}

/// A job as the model sees it.
#[derive(Clone, Debug, PartialEq)]
struct Job {
    id: JobId,
    request: Option<(u8, bool, Lane)>,
    lane: Lane,
    memory: Option<i64>,
    state: JobState,
    cancel: bool,
    attempt: i32,
    progress: Option<u8>,
    run_after: Option<i64>,
    create_time: i64,
    start_time: Option<i64>,
    revision: i64,
    /// Which lease completed it, and with what.
    completed: Option<(usize, u8)>,
    /// Which lease has it, and until when.
    lease: Option<(usize, i64)>,
}

impl Job {
    fn place(&self) -> (i64, JobId) {
        (self.run_after.unwrap_or(self.create_time), self.id)
    }

    fn leave(&mut self, state: JobState, run_after: Option<i64>) {
        *self = Job {
            state,
            run_after,
            cancel: false,
            lease: None,
            revision: self.revision + 1,
            ..self.clone()
        };
    }

    fn attempt_failed(&mut self, now: i64) {
        match (self.cancel, self.attempt < 3) {
            (true, _) => self.leave(JobState::Cancelled, None),
            (false, true) => self.leave(JobState::Queued, Some(now + backoff(self.attempt))),
            (false, false) => self.leave(JobState::Failed, None),
        }
    }
}

/// The model, beside the ledger that it is compared with.
struct Pair {
    ledger: Arc<dyn Ledger>,
    jobs: Vec<Job>,
    /// Every lease ever given out: the job's place in `jobs`, and the token.
    leases: Vec<(usize, String)>,
    now: i64,
}

/// Does the steps on both, and compares after each.
pub async fn agrees(ledger: Arc<dyn Ledger>, steps: Vec<Step>) {
    let mut pair = Pair {
        ledger,
        jobs: Vec::new(),
        leases: Vec::new(),
        now: at(0),
    };
    for step in steps {
        pair.step(&step).await;
        pair.compare(&step).await;
    }
}

impl Pair {
    async fn step(&mut self, step: &Step) {
        let now = self.now;
        match *step {
            Step::Create(request, body, lane, memory) => self.create(request, body, lane, memory).await,
            Step::Claim(memory) => self.claim(memory).await,
            Step::Wait(seconds) => self.now += i64::from(seconds) * 1_000_000,
            Step::Reap => self.reap().await,
            Step::Cancel(choice) => self.cancel(choice).await,
            Step::Report(choice, news) => {
                let Some((lease, id, token)) = self.lease(choice) else {
                    return;
                };
                let done = self.ledger.report(id, &token, news.map(progress), LEASE, now).await;
                let cancel = done.as_ref().ok().copied();
                self.fenced(lease, &done, |job| {
                    assert_eq!(cancel, Some(job.cancel));
                    job.lease = Some((lease, now + LEASE.as_micros() as i64));
                    if news.is_some() && news != job.progress {
                        job.progress = news;
                        job.revision += 1;
                    }
                });
            }
            Step::Complete(choice, said) => {
                let Some((lease, id, token)) = self.lease(choice) else {
                    return;
                };
                let done = self.ledger.complete(id, &token, completion(said, &[]), now).await;
                let job = &self.jobs[self.leases[lease].0];
                if job.completed == Some((lease, said)) {
                    // The answer may have been lost.
                    assert_eq!(done.unwrap().state, JobState::Succeeded);
                    return;
                }
                self.fenced(lease, &done, |job| {
                    job.leave(JobState::Succeeded, None);
                    job.completed = Some((lease, said));
                });
            }
            Step::Fail(choice, retryable, cancelled) => {
                let Some((lease, id, token)) = self.lease(choice) else {
                    return;
                };
                let done = self
                    .ledger
                    .fail(id, &token, failure("x"), retryable, cancelled, now)
                    .await;
                let refused = matches!(done, Err(super::super::LedgerError::CancelNotRequested(_)));
                self.fenced(lease, &done, |job| match (cancelled, retryable) {
                    (true, _) if job.cancel => job.leave(JobState::Cancelled, None),
                    (true, _) => assert!(refused),
                    (false, true) => job.attempt_failed(now),
                    (false, false) => job.leave(JobState::Failed, None),
                });
            }
            Step::Release(choice) => {
                let Some((lease, id, token)) = self.lease(choice) else {
                    return;
                };
                let done = self.ledger.release(id, &token, now).await;
                self.fenced(lease, &done, |job| {
                    let cancelled = job.cancel;
                    job.leave(
                        if cancelled {
                            JobState::Cancelled
                        } else {
                            JobState::Queued
                        },
                        None,
                    );
                    job.attempt -= i32::from(!cancelled);
                });
            }
        }
    }

    fn lease(&self, choice: usize) -> Option<(usize, JobId, String)> {
        let lease = choice.checked_rem(self.leases.len())?;
        let (job, token) = &self.leases[lease];
        Some((lease, self.jobs[*job].id, token.clone()))
    }

    /// Applies `change` if the lease is current, and sees that otherwise the ledger refused it as lost.
    fn fenced<T>(&mut self, lease: usize, done: &Result<T>, change: impl FnOnce(&mut Job)) {
        let job = &mut self.jobs[self.leases[lease].0];
        let current = job.lease.is_some_and(|(holder, _)| holder == lease);
        assert_eq!(is_lost(done), !current);
        if current {
            change(job);
        }
    }

    async fn create(&mut self, request: Option<u8>, body: bool, lane: Lane, memory: Option<i64>) {
        let (project, priority) = lane;
        let request_id = request.map(|r| Uuid::from_u128(u128::from(r) + 1));
        let asked = request.map(|r| (r, body, lane));
        let new = NewJob {
            project: project.into(),
            priority,
            request_id,
            spec: spec(body.into()),
            fingerprint: [u8::from(body) + 2 * (priority + 1) as u8; 32],
            requirements: ResourceRequirements {
                memory,
                ..ResourceRequirements::default()
            },
            ..new_job()
        };
        let id = new.id;
        let made = self.ledger.create_job(new, self.now).await;
        let known = self
            .jobs
            .iter()
            .find(|job| job.request.is_some_and(|(r, ..)| Some(r) == request));
        match known {
            Some(job) if job.request == asked => assert_eq!(made.unwrap().id, job.id),
            Some(_) => assert!(made.is_err()),
            None => {
                assert_eq!(made.unwrap().id, id);
                self.jobs.push(Job {
                    id,
                    request: asked,
                    lane,
                    memory,
                    state: JobState::Queued,
                    cancel: false,
                    attempt: 0,
                    progress: None,
                    run_after: None,
                    create_time: self.now,
                    start_time: None,
                    revision: 1,
                    completed: None,
                    lease: None,
                });
            }
        }
    }

    async fn claim(&mut self, memory: Option<i64>) {
        let (now, holder) = (self.now, self.leases.len());
        let capabilities = WorkerCapabilities {
            memory,
            ..WorkerCapabilities::of_anything("worker-1")
        };
        let given = self.ledger.claim_for(&capabilities, LEASE, now).await.unwrap();
        let next = self.next(memory);
        assert_eq!(
            given.as_ref().map(|lease| lease.job.id),
            next.map(|place| self.jobs[place].id)
        );
        if let (Some(place), Some(lease)) = (next, given) {
            let job = &mut self.jobs[place];
            job.leave(JobState::Running, None);
            (job.attempt, job.progress, job.start_time) = (job.attempt + 1, None, Some(now));
            job.lease = Some((holder, now + LEASE.as_micros() as i64));
            self.leases.push((place, lease.token));
        }
    }

    /// The place of the job that is next for a worker with so much memory: of each lane the first that can be given, of
    /// the lanes those that are out of patience, then by priority, by what the project has running, by age.
    fn next(&self, memory: Option<i64>) -> Option<usize> {
        let late = self.now - PATIENCE.as_micros() as i64;
        let fits = |job: &Job| memory.is_none() || job.memory.is_none() || job.memory <= memory;
        let ready =
            |job: &Job| job.state == JobState::Queued && job.run_after.is_none_or(|t| t <= self.now) && fits(job);
        let mut heads: HashMap<Lane, usize> = HashMap::new();
        for (place, job) in self.jobs.iter().enumerate().filter(|(_, job)| ready(job)) {
            let head = heads.entry(job.lane).or_insert(place);
            if job.place() < self.jobs[*head].place() {
                *head = place;
            }
        }
        heads.into_values().min_by_key(|&head| {
            let job = &self.jobs[head];
            let served = |other: &Job| other.lane == job.lane && other.start_time.is_some_and(|t| t > late);
            let starved = job.place().0 <= late && !self.jobs.iter().any(served);
            let rank = (-job.lane.1, self.running(job.lane.0));
            (!starved, if starved { (0, 0) } else { rank }, job.place())
        })
    }

    fn running(&self, project: &str) -> usize {
        let running = |job: &&Job| job.state == JobState::Running && job.lane.0 == project;
        self.jobs.iter().filter(running).count()
    }

    /// The queue as it would be given out, were nothing to come back or to be added: one after the other by the rule.
    fn foreseen(&self) -> Vec<JobId> {
        let mut waiting: Vec<&Job> = self.jobs.iter().filter(|job| job.state == JobState::Queued).collect();
        let mut running: HashMap<_, _> = PROJECTS.map(|project| (project, self.running(project))).into();
        let mut order = Vec::new();
        while let Some((at, job)) = waiting
            .iter()
            .copied()
            .enumerate()
            .min_by_key(|(_, job)| (-job.lane.1, running[job.lane.0], job.place()))
        {
            *running.get_mut(job.lane.0).unwrap() += 1;
            order.push(job.id);
            waiting.remove(at);
        }
        order
    }

    async fn reap(&mut self) {
        let mut reaped = self.ledger.reap(self.now).await.unwrap();
        let mut expected = Vec::new();
        for job in &mut self.jobs {
            if job.lease.is_some_and(|(_, end)| end <= self.now) {
                expected.push(job.id);
                job.attempt_failed(self.now);
            }
        }
        reaped.sort();
        expected.sort();
        assert_eq!(reaped, expected);
    }

    async fn cancel(&mut self, choice: usize) {
        let Some(place) = choice.checked_rem(self.jobs.len()) else {
            return;
        };
        let job = &mut self.jobs[place];
        let done = self.ledger.cancel_job(job.id, self.now).await;
        assert_eq!(done.is_err(), job.state.is_over());
        match job.state {
            JobState::Queued => job.leave(JobState::Cancelled, None),
            JobState::Running if !job.cancel => (job.cancel, job.revision) = (true, job.revision + 1),
            _ => {}
        }
    }

    /// Everything that can be seen, in the model and in the ledger.
    async fn compare(&self, step: &Step) {
        let mut rows = Vec::new();
        for project in PROJECTS {
            rows.extend(self.ledger.list_jobs(project, &[], None, 1000).await.unwrap());
        }
        let queue = self.foreseen();
        assert_eq!(self.ledger.queue().await.unwrap(), queue, "after {step:?}");
        // One job alone is counted in another way.
        let middle = queue.len() / 2;
        if let Some(id) = queue.get(middle) {
            let alone = job(&*self.ledger, *id).await.queue_position;
            assert_eq!(alone, Some(middle as i64), "after {step:?}");
        }
        let mut jobs = self.jobs.clone();
        rows.sort_by_key(|row| row.id);
        jobs.sort_by_key(|job| job.id);
        assert_eq!(rows.len(), jobs.len(), "after {step:?}");
        for (row, job) in rows.iter().zip(&jobs) {
            assert_eq!(
                (
                    row.id,
                    row.state,
                    row.cancel_requested,
                    row.attempt,
                    row.progress,
                    row.run_after,
                    row.revision
                ),
                (
                    job.id,
                    job.state,
                    job.cancel,
                    job.attempt,
                    job.progress.map(progress),
                    job.run_after,
                    job.revision
                ),
                "after {step:?}"
            );
            assert_eq!((row.project.as_str(), row.priority), job.lane, "after {step:?}");
            assert_eq!(row.end_time.is_some(), job.state.is_over(), "after {step:?}");
        }
    }
}
