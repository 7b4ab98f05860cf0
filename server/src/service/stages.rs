//! How long each stage of an attempt takes, told by when its worker's reports change: from when the worker was given the
//! job until the attempt is over.
use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime};

use guardsplat_proto::v1::progress::Stage;

use crate::ledger::{JobId, JobKind};
use crate::metrics::Metrics;
use crate::traces::{self, Span, Traces};

/// More attempts than this are not followed at a time.
const MOST: usize = 4096;
/// One that was not heard of for so long has ended elsewhere.
const SILENT: Duration = Duration::from_secs(600);

struct Attempt {
    kind: JobKind,
    span: Option<Span>,
    stage: Stage,
    began: SystemTime,
    since: Instant,
    heard: Instant,
}

/// The attempts that this server gave out.
#[derive(Default)]
pub struct Stages(Mutex<HashMap<JobId, Attempt>>);

impl Stages {
    /// A worker was given a job; it begins with preparing.
    pub fn begin(&self, id: JobId, kind: JobKind, span: Option<Span>, now: Instant) {
        let mut all = self.lock();
        if all.len() >= MOST {
            all.retain(|_, attempt| now.saturating_duration_since(attempt.heard) < SILENT);
        }
        if all.len() >= MOST {
            return;
        }
        let attempt = Attempt {
            kind,
            span,
            stage: Stage::Preparing,
            began: SystemTime::now(),
            since: now,
            heard: now,
        };
        all.insert(id, attempt);
    }

    /// A worker is at a stage; the one before is over, if it is another.
    pub fn reached(&self, id: JobId, stage: Stage, now: Instant, metrics: &Metrics, traces: &Traces) {
        let mut all = self.lock();
        let Some(attempt) = all.get_mut(&id) else { return };
        attempt.heard = now;
        if attempt.stage != stage {
            attempt.stage_over(now, metrics, traces);
            (attempt.stage, attempt.since, attempt.began) = (stage, now, SystemTime::now());
        }
    }

    /// An attempt is over, and with it its last stage.
    pub fn end(&self, id: JobId, outcome: &'static str, now: Instant, metrics: &Metrics, traces: &Traces) {
        let ended = self.lock().remove(&id);
        if let Some(mut attempt) = ended {
            attempt.stage_over(now, metrics, traces);
            let failed = matches!(outcome, "failed" | "lost");
            traces::note(&mut attempt.span, "guardsplat.outcome", outcome, failed);
        }
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<JobId, Attempt>> {
        // Nobody panics while holding it, and what it holds is whole at every moment anyway.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Attempt {
    fn stage_over(&self, now: Instant, metrics: &Metrics, traces: &Traces) {
        metrics.stage(self.kind, self.stage, now.saturating_duration_since(self.since));
        if let Some(span) = &self.span {
            traces.stage(self.stage, traces::context(span), self.began);
        }
    }
}

#[cfg(test)]
mod tests {
    use uuid::Uuid;

    use super::*;

    #[test]
    fn stages_are_as_long_as_it_takes_until_the_next() {
        let (stages, metrics, traces) = (Stages::default(), Metrics::default(), Traces::default());
        let (id, start) = (Uuid::now_v7(), Instant::now());
        let at = |seconds| start + Duration::from_secs(seconds);
        let reached = |stage, seconds| stages.reached(id, stage, at(seconds), &metrics, &traces);
        stages.begin(id, JobKind::Verify, None, start);
        reached(Stage::Preparing, 2);
        reached(Stage::Reading, 3);
        reached(Stage::Reading, 9);
        stages.end(id, "succeeded", at(10), &metrics, &traces);
        stages.end(id, "succeeded", at(20), &metrics, &traces);
        // Of another server's attempt nothing is known here.
        reached(Stage::Storing, 30);
        let text = metrics.text().unwrap();
        for (stage, sum) in [("preparing", "3.0"), ("reading", "7.0"), ("storing", "0.0")] {
            let line = format!(r#"guardsplat_stage_seconds_sum{{kind="verify",stage="{stage}"}} {sum}"#);
            assert!(text.lines().any(|there| there == line), "{line} is not in\n{text}");
        }
    }

    #[test]
    fn those_that_ended_elsewhere_are_forgotten() {
        let (stages, start) = (Stages::default(), Instant::now());
        for _ in 0..MOST + 10 {
            stages.begin(Uuid::now_v7(), JobKind::Embed, None, start);
        }
        assert_eq!(stages.lock().len(), MOST);
        stages.begin(Uuid::now_v7(), JobKind::Embed, None, start + SILENT);
        assert_eq!(stages.lock().len(), 1);
    }
}
