//! The ledger in a SQLite file: one writer that commits in groups, readers beside it (WAL).
mod access;
mod artifacts;
mod commitments;
pub mod copy;
mod hooks;
mod jobs;
mod keys;
mod leases;
mod open;
mod operations;
mod queue;
mod registry;
mod retention;
mod rows;
#[cfg(test)]
mod tests;
mod transition;
mod writer;

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use guardsplat_commitment::{Signed, SigningKey};
use sqlx::SqlitePool;
use tokio::sync::broadcast;
use uuid::Uuid;

use super::registry::{
    AssetFilter, AssetId, AssetRow, Candidate, CommitmentId, KeyState, NewAsset, NewOwner, OwnerId, OwnerRow,
    SealedSigningKey,
};
use super::types::{
    ArtifactId, ArtifactRow, Completion, Failure, JobId, JobRow, JobState, KeyId, KeyRow, NewArtifact, NewJob,
};
use super::{Elsewhere, Ledger, LedgerError, Result, token};
use writer::Writer;

/// A ledger in one SQLite file.
pub struct SqliteLedger {
    readers: SqlitePool,
    writer: Writer,
}

impl SqliteLedger {
    /// Opens the ledger in `path`, making or updating it as needed.
    ///
    /// # Errors
    /// `Database` when the file can't be opened or is no database, `Migrate` when a newer version wrote it.
    pub async fn open(path: &Path) -> Result<Self> {
        Self::open_with(open::options(path)).await
    }

    async fn open_with(options: sqlx::sqlite::SqliteConnectOptions) -> Result<Self> {
        let first = open::migrated(&options).await?;
        let readers = open::readers(&options);
        Ok(Self {
            readers,
            writer: Writer::start(options, first),
        })
    }
}

#[tonic::async_trait]
impl Ledger for SqliteLedger {
    async fn create_job(&self, new: NewJob, now: i64) -> Result<JobRow> {
        let job = self.writer.run(move |db| Box::pin(jobs::create(db, new, now))).await?;
        // The position is counted by a reader: counting a long queue would hold up the writer.
        Ok(self.get_job(job.id).await?.unwrap_or(job))
    }

    async fn find_request(&self, request: Uuid) -> Result<Option<JobRow>> {
        jobs::find_request(&mut *self.readers.acquire().await?, request).await
    }

    async fn get_job(&self, id: JobId) -> Result<Option<JobRow>> {
        jobs::get(&mut *self.readers.acquire().await?, id).await
    }

    async fn list_jobs(
        &self,
        project: &str,
        states: &[JobState],
        before: Option<(i64, JobId)>,
        limit: u32,
    ) -> Result<Vec<JobRow>> {
        let mut snapshot = self.readers.begin().await?;
        jobs::list(&mut snapshot, project, states, before, limit).await
    }

    async fn cancel_job(&self, id: JobId, now: i64) -> Result<JobRow> {
        self.writer.run(move |db| Box::pin(jobs::cancel(db, id, now))).await
    }

    async fn leased_job(&self, id: JobId, token: &str) -> Result<JobRow> {
        leases::leased(&mut *self.readers.acquire().await?, id, &token::hash(token)).await
    }

    async fn report(
        &self,
        id: JobId,
        token: &str,
        progress: Option<Vec<u8>>,
        lease: Duration,
        now: i64,
    ) -> Result<bool> {
        let token = token::hash(token);
        self.writer
            .run(move |db| Box::pin(leases::report(db, id, token, progress, lease, now)))
            .await
    }

    async fn complete(&self, id: JobId, token: &str, completion: Completion, now: i64) -> Result<JobRow> {
        let token = token::hash(token);
        self.writer
            .run(move |db| Box::pin(leases::complete(db, id, token, completion, now)))
            .await
    }

    async fn fail(
        &self,
        id: JobId,
        token: &str,
        failure: Option<Failure>,
        retryable: bool,
        cancelled: bool,
        now: i64,
    ) -> Result<JobRow> {
        let token = token::hash(token);
        self.writer
            .run(move |db| Box::pin(leases::fail(db, id, token, failure, retryable, cancelled, now)))
            .await
    }

    async fn release(&self, id: JobId, token: &str, now: i64) -> Result<JobRow> {
        let token = token::hash(token);
        self.writer
            .run(move |db| Box::pin(leases::release(db, id, token, now)))
            .await
    }

    async fn renew_leases(&self, lease: Duration, now: i64) -> Result<()> {
        self.writer.run(move |db| Box::pin(leases::renew(db, lease, now))).await
    }

    async fn reap(&self, now: i64) -> Result<Vec<JobId>> {
        self.writer.run(move |db| Box::pin(leases::reap(db, now))).await
    }

    async fn create_artifact(&self, new: NewArtifact, now: i64) -> Result<ArtifactRow> {
        self.writer
            .run(move |db| Box::pin(artifacts::create(db, new, now)))
            .await
    }

    async fn artifact_ready(&self, id: ArtifactId, token: Option<&str>, now: i64) -> Result<ArtifactRow> {
        let token = token.map(token::hash);
        self.writer
            .run(move |db| Box::pin(artifacts::ready(db, id, token, now)))
            .await
    }

    async fn get_artifact(&self, id: ArtifactId) -> Result<Option<ArtifactRow>> {
        artifacts::get_visible(&mut *self.readers.acquire().await?, id).await
    }

    async fn get_any_artifact(&self, id: ArtifactId) -> Result<Option<ArtifactRow>> {
        artifacts::get(&mut *self.readers.acquire().await?, id).await
    }

    async fn delete_artifact(&self, id: ArtifactId, now: i64) -> Result<()> {
        self.writer
            .run(move |db| Box::pin(artifacts::delete(db, id, now)))
            .await
    }

    async fn abandoned_artifacts(&self, older_than: i64, limit: u32) -> Result<Vec<ArtifactRow>> {
        self.writer
            .run(move |db| Box::pin(artifacts::abandoned(db, older_than, limit)))
            .await
    }

    async fn forget_artifact(&self, id: ArtifactId) -> Result<()> {
        self.writer.run(move |db| Box::pin(artifacts::forget(db, id))).await
    }

    async fn get_key(&self, id: KeyId) -> Result<Option<KeyRow>> {
        keys::get(&mut *self.readers.acquire().await?, id).await
    }

    async fn list_keys(&self, project: &str, before: Option<(i64, KeyId)>, limit: u32) -> Result<Vec<KeyRow>> {
        keys::list(&mut *self.readers.acquire().await?, project, before, limit).await
    }

    async fn update_key_state(&self, id: KeyId, next: KeyState, reason: &str, now: i64) -> Result<KeyRow> {
        let reason = reason.to_owned();
        self.writer
            .run(move |db| Box::pin(keys::update_state(db, id, next, reason, now)))
            .await
    }

    async fn signing_key(&self) -> Result<Option<SealedSigningKey>> {
        commitments::signing_key(&mut *self.readers.acquire().await?).await
    }

    async fn keep_signing_key(&self, new: SealedSigningKey, now: i64) -> Result<SealedSigningKey> {
        self.writer
            .run(move |db| Box::pin(commitments::keep_signing_key(db, new, now)))
            .await
    }

    async fn create_owner(&self, new: NewOwner, now: i64) -> Result<OwnerRow> {
        self.writer
            .run(move |db| Box::pin(registry::create_owner(db, new, now)))
            .await
    }

    async fn get_owner(&self, id: OwnerId) -> Result<Option<OwnerRow>> {
        registry::get_owner(&mut *self.readers.acquire().await?, id).await
    }

    async fn list_owners(&self, project: &str, before: Option<(i64, OwnerId)>, limit: u32) -> Result<Vec<OwnerRow>> {
        registry::list_owners(&mut *self.readers.acquire().await?, project, before, limit).await
    }

    async fn create_asset(&self, new: NewAsset, signer: Arc<SigningKey>, now: i64) -> Result<AssetRow> {
        self.writer
            .run(move |db| Box::pin(async move { registry::create_asset(db, new, &signer, now).await }))
            .await
    }

    async fn find_asset_request(&self, request: Uuid) -> Result<Option<AssetRow>> {
        registry::find_asset_request(&mut *self.readers.acquire().await?, request).await
    }

    async fn get_asset(&self, id: AssetId) -> Result<Option<AssetRow>> {
        registry::get_asset(&mut *self.readers.acquire().await?, id).await
    }

    async fn list_assets(
        &self,
        project: &str,
        filter: AssetFilter,
        before: Option<(i64, AssetId)>,
        limit: u32,
    ) -> Result<Vec<AssetRow>> {
        registry::list_assets(&mut *self.readers.acquire().await?, project, filter, before, limit).await
    }

    async fn candidates(&self, key: KeyId, after: i64, limit: u32) -> Result<Vec<Candidate>> {
        registry::candidates(&mut *self.readers.acquire().await?, key, after, limit).await
    }

    async fn candidate(&self, asset: AssetId) -> Result<Option<Candidate>> {
        registry::candidate(&mut *self.readers.acquire().await?, asset).await
    }

    async fn get_commitment(&self, id: CommitmentId) -> Result<Option<Signed>> {
        commitments::get(&mut *self.readers.acquire().await?, id).await
    }

    async fn list_commitments(&self, project: &str, after: i64, limit: u32) -> Result<Vec<Signed>> {
        commitments::list(&mut *self.readers.acquire().await?, project, after, limit).await
    }

    async fn head(&self, project: &str) -> Result<Option<Signed>> {
        commitments::head_of(&mut *self.readers.acquire().await?, project).await
    }

    async fn queue_depth(&self) -> Result<i64> {
        jobs::queue_depth(&mut *self.readers.acquire().await?).await
    }

    async fn check(&self) -> Result<()> {
        self.queue_depth().await?;
        // An empty transaction of the writer takes the write lock, and writes nothing.
        self.writer.run(|_| Box::pin(async { Ok::<_, LedgerError>(()) })).await
    }

    fn is_shared(&self) -> bool {
        false
    }

    fn elsewhere(&self) -> Option<broadcast::Receiver<Elsewhere>> {
        None
    }

    async fn close(&self) {
        self.writer.close().await;
        self.readers.close().await;
    }
}
