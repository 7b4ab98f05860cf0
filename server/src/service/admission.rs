//! Whether there is room for a job: in the queue, and for its scene in the memory that a job may take.
use std::time::Duration;

use guardsplat_scene::Summary;

use crate::error::{Error, Result};
use crate::ledger::{ArtifactId, JobKind, JobSpec, ResourceRequirements};
use crate::service::names::ResourceKind;
use crate::service::submission::Submission;
use crate::service::{Service, ownership};

/// When a submitter tries again while the queue is full.
const QUEUE_RETRY: Duration = Duration::from_secs(10);

impl Service {
    /// Refuses a job for which there is no room. One that its request made before is there already, and takes no more.
    /// Says what the worker of one that there is room for must have, as far as its scene tells.
    pub(crate) async fn admit(&self, project: &str, submission: &Submission) -> Result<ResourceRequirements> {
        let limits = self.limits();
        let limit = limits.max_queued;
        let depth = u64::try_from(self.ledger().queue_depth().await?).unwrap_or(0);
        let full = depth >= limit;
        // With a queue that is not half full nobody can have more than is left.
        let shared = limits.fair_shares && depth.saturating_mul(2) > limit;
        let quotas = [limits.max_queued_of_project, limits.max_bytes_of_project];
        let unlimited = !full && !shared && limits.max_job_memory.is_none() && quotas == [None, None];
        if !unlimited {
            if self.is_known(project, submission).await? {
                return Ok(ResourceRequirements::default());
            }
            self.room_for_job(project, submission.spec.kind()).await?;
            if shared && !full {
                self.room_beside_others(project, limit - depth).await?;
            }
        }
        if full {
            return Err(Error::QueueFull {
                limit,
                retry_after: QUEUE_RETRY,
            });
        }
        let Some(scene) = scene_of(submission) else {
            return Ok(ResourceRequirements::default());
        };
        let summary = match (self.summary(project, scene).await, limits.max_job_memory) {
            // A job that nothing is held against does not hang on it either.
            (Err(error), None) => {
                tracing::warn!(%error, scene = %scene, "what a scene takes is not known");
                None
            }
            (summary, _) => summary?,
        };
        let Some(summary) = summary else {
            return Ok(ResourceRequirements::default());
        };
        if let Some(limit) = limits.max_job_memory {
            check(
                &ResourceKind::Artifact.name(scene),
                submission.spec.kind(),
                &summary,
                limit,
            )?;
        }
        let (least, likely) = taken(submission.spec.kind(), &summary);
        let bytes = |number: u64| Some(i64::try_from(number).unwrap_or(i64::MAX));
        Ok(ResourceRequirements {
            memory: bytes(least),
            likely_memory: bytes(likely),
            clip: None,
        })
    }

    /// Refuses a job that would be one too many.
    pub(crate) async fn room_in_queue(&self) -> Result<()> {
        let limit = self.limits().max_queued;
        if u64::try_from(self.ledger().queue_depth().await?).unwrap_or(0) < limit {
            return Ok(());
        }
        Err(Error::QueueFull {
            limit,
            retry_after: QUEUE_RETRY,
        })
    }

    /// Whether a request made a job before.
    pub(crate) async fn is_known(&self, project: &str, submission: &Submission) -> Result<bool> {
        match submission.request_id {
            Some(request) => {
                let job = self.ledger().find_request(ownership::request(project, request)).await?;
                Ok(job.is_some_and(|job| job.project == project))
            }
            None => Ok(false),
        }
    }
}

/// The artifact that is a scene, or may be one: a worker takes several suspects for pictures.
fn scene_of(submission: &Submission) -> Option<ArtifactId> {
    let scenes = match &submission.spec {
        JobSpec::Embed(_) => 1,
        JobSpec::Verify(spec) => spec.suspects.len(),
        JobSpec::CreateKey(_) => 0,
    };
    // Cameras come after it.
    submission.inputs.first().copied().filter(|_| scenes == 1)
}

/// Bytes that a scene takes at least, and probably.
fn taken(kind: JobKind, summary: &Summary) -> (u64, u64) {
    match kind {
        JobKind::Embed => (summary.least_to_mark(), summary.likely_to_mark()),
        JobKind::Verify | JobKind::CreateKey => (summary.least_to_read(), summary.likely_to_read()),
    }
}

/// Refuses a scene that takes more than `limit` bytes, whatever else its job asks for.
fn check(name: &str, kind: JobKind, summary: &Summary, limit: u64) -> Result<()> {
    let (needed, likely) = taken(kind, summary);
    if needed <= limit {
        return Ok(());
    }
    Err(Error::SceneDoesNotFit {
        name: name.to_owned(),
        gaussians: summary.gaussians,
        degree: summary.degree,
        needed,
        likely,
        limit,
    })
}
