//! `WatchJob`: a job as it stands, then again whenever it changes, until it is over.
use std::time::{Duration, Instant};

use futures::stream::{self, BoxStream};
use guardsplat_proto::v1::WatchJobResponse;
use tonic::Status;

use crate::access::Caller;
use crate::error::{Error, Result};
use crate::grpc::slow_consumer::patient;
use crate::ledger::{JobId, JobRow, JobState};
use crate::metrics::Watching;
use crate::service::changes::{For, Heard, Listener};
use crate::service::claims::Disclosure;
use crate::service::names::ResourceKind;
use crate::service::{Service, opaque_token, queue_positions};

/// How late a change is heard of that was not announced here.
const LOOK_AGAIN: Duration = Duration::from_secs(2);
/// A queue that moves fast is told of so often at most.
const POSITION_EVERY: Duration = queue_positions::FRESH;

/// What of a job a watcher has seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Seen {
    revision: i64,
    /// Changes without the job itself changing.
    position: Option<i64>,
}

impl Seen {
    fn of(row: &JobRow) -> Self {
        let position = row.queue_position.filter(|_| row.state == JobState::Queued);
        Self {
            revision: row.revision,
            position,
        }
    }

    /// The cursor that resumes behind this, good for this job only.
    fn cursor(self, id: JobId) -> String {
        let mut payload = [0; 16];
        payload[..8].copy_from_slice(&self.revision.to_be_bytes());
        payload[8..].copy_from_slice(&self.position.unwrap_or(-1).to_be_bytes());
        opaque_token::seal(&[b"watch", id.as_bytes()], &payload)
    }

    fn parse(id: JobId, cursor: &str) -> Result<Option<Self>> {
        if cursor.is_empty() {
            return Ok(None);
        }
        let payload: [u8; 16] = opaque_token::open(&[b"watch", id.as_bytes()], cursor)
            .ok_or_else(|| Error::invalid("cursor", "is not a cursor of this job"))?;
        let number = |at: usize| i64::from_be_bytes(std::array::from_fn(|i| payload[at + i]));
        Ok(Some(Self {
            revision: number(0),
            position: Some(number(8)).filter(|&p| p >= 0),
        }))
    }
}

/// Begins to watch. The ledger is read when what was told before has been taken: one who reads slowly skips what happened
/// in between, and holds up nobody. One who does not read at all is let go after a while.
pub async fn watch(
    api: Service,
    caller: &Caller,
    name: &str,
    cursor: &str,
) -> Result<BoxStream<'static, Result<WatchJobResponse, Status>>> {
    let id = ResourceKind::Job.parse("name", name)?;
    let seen = Seen::parse(id, cursor)?;
    // From before the first look, so that no change falls in between.
    let listener = api.changes().listen();
    let known = api.owned_job(&caller.project, id).await?;
    let disclosure = api.disclosure(caller);
    let (metrics, stall) = (api.metrics(), api.limits().watch_stall);
    let watcher = Watcher {
        _watching: metrics.watching(),
        api,
        project: caller.project.clone(),
        disclosure,
        listener,
        id,
        seen,
        waits: None,
        // A job that is not there is told at once, not from within the stream.
        known: Some(known),
        read: Instant::now(),
        over: false,
    };
    let telling = stream::unfold(Some(watcher), |watcher| async {
        let mut watcher = watcher?;
        match watcher.next().await {
            Ok(Some(message)) => Some((Ok(message), Some(watcher))),
            Ok(None) => None,
            Err(error) => Some((Err(error.into()), None)),
        }
    });
    let shed = move || {
        metrics.watch_shed();
        tracing::info!(job = %id, "a watch is shed: its reader takes nothing");
        Error::WatchStalled(stall).into()
    };
    Ok(patient(telling, stall, shed))
}

struct Watcher {
    /// For as long as it is looked after.
    _watching: Watching,
    api: Service,
    project: String,
    /// What whoever watches is told.
    disclosure: Disclosure,
    listener: Listener,
    id: JobId,
    seen: Option<Seen>,
    /// Whether nobody could have it, as was last told.
    waits: Option<bool>,
    /// The job, if it needs no other look.
    known: Option<JobRow>,
    /// When it was last looked at.
    read: Instant,
    over: bool,
}

impl Watcher {
    async fn row(&mut self) -> Result<JobRow> {
        if let Some(known) = self.known.take() {
            return Ok(known);
        }
        let read = Instant::now();
        let row = self.api.ledger().peek_job(self.id).await?;
        let mut row = row
            .filter(|row| row.project == self.project)
            .ok_or_else(|| ResourceKind::Job.not_found(self.id))?;
        if row.state == JobState::Queued {
            row = match self.api.positions().await?.get(&self.id) {
                Some(&position) => JobRow {
                    queue_position: Some(position),
                    ..row
                },
                // It came, or came back, after they were counted.
                None => self.api.owned_job(&self.project, self.id).await?,
            };
        }
        self.read = read;
        Ok(row)
    }

    async fn next(&mut self) -> Result<Option<WatchJobResponse>> {
        loop {
            if self.over {
                return Ok(None);
            }
            let row = self.row().await?;
            let (seen, state) = (Seen::of(&row), row.state);
            let before = self.seen.replace(seen);
            self.over = state.is_over();
            let job = self.api.describe_job(row.clone(), self.disclosure).await?;
            // No part of the cursor: whoever comes back is told of it once more.
            let waits = self.waits.replace(!job.waiting_reason.is_empty());
            if before != Some(seen) || waits.is_some_and(|waits| waits == job.waiting_reason.is_empty()) {
                let cursor = seen.cursor(self.id);
                return Ok(Some(WatchJobResponse { job: Some(job), cursor }));
            }
            if !self.over {
                self.wait(row).await?;
            }
        }
    }

    async fn wait(&mut self, row: JobRow) -> Result<()> {
        if row.state != JobState::Queued {
            self.listener.wait(For::Job(self.id), LOOK_AGAIN).await?;
            return Ok(());
        }
        let heard = self.listener.wait(For::QueuedJob(self.id), LOOK_AGAIN).await?;
        if heard == Heard::Moved {
            // Others may leave the queue one upon the other; they are told of together.
            let heard = self.listener.wait(For::Job(self.id), POSITION_EVERY).await?;
            if heard == Heard::Nothing && self.read.elapsed() < LOOK_AGAIN {
                // Of the job itself nothing is new, unless it has left the queue.
                let position = self.api.positions().await?.get(&self.id).copied();
                self.known = position.map(|_| JobRow {
                    queue_position: position,
                    ..row
                });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use uuid::Uuid;

    use super::*;

    #[test]
    fn cursors_belong_to_one_job() {
        let (a, b) = (Uuid::now_v7(), Uuid::now_v7());
        for position in [None, Some(0), Some(7)] {
            let seen = Seen { revision: 3, position };
            assert_eq!(Seen::parse(a, &seen.cursor(a)).unwrap(), Some(seen));
            assert!(
                Seen::parse(b, &seen.cursor(a))
                    .unwrap_err()
                    .to_string()
                    .starts_with("cursor:")
            );
        }
        assert_eq!(Seen::parse(a, "").unwrap(), None);
    }
}
