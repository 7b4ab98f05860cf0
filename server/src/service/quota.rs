//! What a project may take: queued jobs, and bytes of artifacts. What arrives at the same moment may go over by itself.
use crate::error::{Error, Result};
use crate::ledger::{JobKind, UploadReservation};
use crate::service::Service;

impl Service {
    /// Refuses a job of a project that has as many queued as it may, or that would leave a file where there is no room.
    pub(crate) async fn room_for_job(&self, project: &str, kind: JobKind) -> Result<()> {
        let limits = self.limits();
        if let Some(limit) = limits.max_queued_of_project
            && self.ledger().usage(project).await?.queued_jobs >= limit
        {
            return Err(used_up("queued jobs", project, limit));
        }
        match kind {
            JobKind::Embed => self.room_for_bytes(project, 1).await,
            JobKind::Verify | JobKind::CreateKey => Ok(()),
        }
    }

    /// Refuses a job of a project that has more of the queue than the `left` that is free for everybody, so that one
    /// project can't fill the queue alone: thresholds of Choudhury and Hahne (1998), "Dynamic queue length thresholds for
    /// shared-memory packet switches", with a factor of 1.
    pub(crate) async fn room_beside_others(&self, project: &str, left: u64) -> Result<()> {
        let own = self.ledger().usage(project).await?.queued_jobs;
        match own >= left {
            true => Err(used_up("queued jobs, a fair share of the queue", project, own)),
            false => Ok(()),
        }
    }

    /// Refuses bytes that would take a project over what it may have.
    pub(crate) async fn room_for_bytes(&self, project: &str, bytes: u64) -> Result<()> {
        let Some(limit) = self.limits().max_bytes_of_project else {
            return Ok(());
        };
        let used = self.ledger().usage(project).await?.bytes();
        if used.saturating_add(bytes) > limit {
            return Err(used_up("bytes of artifacts", project, limit));
        }
        Ok(())
    }

    /// Reserves bytes for an upload that goes to the store by itself, where there is a limit.
    pub(crate) async fn reserve_bytes(&self, new: UploadReservation) -> Result<()> {
        let Some(limit) = self.limits().max_bytes_of_project else {
            return Ok(());
        };
        let project = new.project.clone();
        match self.ledger().reserve_upload(new, limit).await? {
            true => Ok(()),
            false => Err(used_up("bytes of artifacts", &project, limit)),
        }
    }
}

fn used_up(what: &'static str, project: &str, limit: u64) -> Error {
    Error::QuotaUsedUp {
        what,
        project: project.to_owned(),
        limit,
    }
}
