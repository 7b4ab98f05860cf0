//! The ledger in a PostgreSQL database, which several servers may share.
//!
//! Every change is one transaction, which locks the rows that it decides by: the job whose lease it checks, the inputs
//! of a new job, the chain of commitments. What a server changes the others hear of from the database.
mod access;
mod artifacts;
mod commitments;
mod database;
mod hooks;
mod jobs;
mod keys;
mod leases;
mod notices;
mod open;
mod operations;
mod presence;
mod queue;
mod registry;
mod retention;
mod rows;
#[cfg(test)]
pub(crate) mod tests;
mod transition;
mod trouble;

use std::sync::Arc;
use std::time::Duration;

use guardsplat_commitment::{Signed, SigningKey};
use secrecy::SecretString;
use sqlx::postgres::PgConnectOptions;
use tokio::sync::broadcast;
use uuid::Uuid;

use super::registry::{
    AssetFilter, AssetId, AssetRow, Candidate, CommitmentId, KeyState, NewAsset, NewOwner, OwnerId, OwnerRow,
    SealedSigningKey,
};
use super::types::{
    ArtifactId, ArtifactRow, Completion, Failure, JobId, JobRow, JobState, KeyId, KeyRow, NewArtifact, NewJob,
};
use super::{Elsewhere, Ledger, Result, token};
use database::Database;
use notices::Notices;

/// A ledger in a PostgreSQL database.
pub struct PostgresLedger {
    database: Database,
    notices: Notices,
}

impl PostgresLedger {
    /// Opens the ledger in the database at `url`, making or updating its tables as needed. A database that is not there
    /// yet is waited for, half a minute at most.
    ///
    /// # Errors
    /// `Unavailable` when the database can't be reached, `Database` when it refuses, `Migrate` when a newer version
    /// wrote it.
    pub async fn open(url: &SecretString) -> Result<Self> {
        Self::open_with(open::options(url)?).await
    }

    async fn open_with(options: PgConnectOptions) -> Result<Self> {
        open::migrated(&options).await?;
        // What this server is called among those that share the database, until it ends.
        let server = Uuid::now_v7();
        Ok(Self {
            database: Database::new(open::pool(options.clone(), server)),
            notices: Notices::start(options, server),
        })
    }
}

/// Whether something is the URL of a database that a ledger may be in; if not, why. The answer names no part of it but
/// parameters, as it may hold a password.
///
/// # Errors
/// A text that says what is wrong with it.
pub fn check_url(url: &SecretString) -> std::result::Result<(), String> {
    open::check_url(url)
}

/// What a call does with a connection, with values of its own each time that it is tried.
macro_rules! with {
    ([$($value:ident),*] $db:ident => $call:expr) => {
        move |$db| {
            $(let $value = $value.clone();)*
            Box::pin(async move { $call.await })
        }
    };
}

use with;

#[tonic::async_trait]
impl Ledger for PostgresLedger {
    async fn create_job(&self, new: NewJob, now: i64) -> Result<JobRow> {
        let made = self.database.change(with!([new] db => jobs::create(db, &new, now)));
        let job = made.await?;
        // The position is counted afterwards: the rows are locked no longer than need be.
        Ok(self.get_job(job.id).await?.unwrap_or(job))
    }

    async fn find_request(&self, request: Uuid) -> Result<Option<JobRow>> {
        self.database
            .read(with!([] db => jobs::find_request(db, request)))
            .await
    }

    async fn get_job(&self, id: JobId) -> Result<Option<JobRow>> {
        self.database.read(with!([] db => jobs::get(db, id))).await
    }

    async fn list_jobs(
        &self,
        project: &str,
        states: &[JobState],
        before: Option<(i64, JobId)>,
        limit: u32,
    ) -> Result<Vec<JobRow>> {
        let (project, states) = (project.to_owned(), states.to_vec());
        self.database
            .read(with!([project, states] db => jobs::list(db, &project, &states, before, limit)))
            .await
    }

    async fn cancel_job(&self, id: JobId, now: i64) -> Result<JobRow> {
        self.database.change(with!([] db => jobs::cancel(db, id, now))).await
    }

    async fn leased_job(&self, id: JobId, token: &str) -> Result<JobRow> {
        let token = token::hash(token);
        self.database
            .read(with!([token] db => leases::leased(db, id, &token)))
            .await
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
        self.database
            .change(with!([token, progress] db => leases::report(db, id, &token, progress.as_deref(), lease, now)))
            .await
    }

    async fn complete(&self, id: JobId, token: &str, completion: Completion, now: i64) -> Result<JobRow> {
        let token = token::hash(token);
        self.database
            .change(with!([token, completion] db => leases::complete(db, id, &token, &completion, now)))
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
        self.database
            .change(with!([token, failure] db => leases::fail(db, id, &token, failure, retryable, cancelled, now)))
            .await
    }

    async fn release(&self, id: JobId, token: &str, now: i64) -> Result<JobRow> {
        let token = token::hash(token);
        self.database
            .change(with!([token] db => leases::release(db, id, &token, now)))
            .await
    }

    async fn renew_leases(&self, lease: Duration, now: i64) -> Result<()> {
        self.database
            .change(with!([] db => presence::renew(db, lease, now)))
            .await
    }

    async fn reap(&self, now: i64) -> Result<Vec<JobId>> {
        self.database.change(with!([] db => presence::reap(db, now))).await
    }

    async fn create_artifact(&self, new: NewArtifact, now: i64) -> Result<ArtifactRow> {
        self.database
            .change(with!([new] db => artifacts::create(db, &new, now)))
            .await
    }

    async fn artifact_ready(&self, id: ArtifactId, token: Option<&str>, now: i64) -> Result<ArtifactRow> {
        let token = token.map(token::hash);
        self.database
            .change(with!([token] db => artifacts::ready(db, id, token.as_deref(), now)))
            .await
    }

    async fn get_artifact(&self, id: ArtifactId) -> Result<Option<ArtifactRow>> {
        self.database.read(with!([] db => artifacts::get_visible(db, id))).await
    }

    async fn get_any_artifact(&self, id: ArtifactId) -> Result<Option<ArtifactRow>> {
        self.database.read(with!([] db => artifacts::get(db, id))).await
    }

    async fn delete_artifact(&self, id: ArtifactId, now: i64) -> Result<()> {
        self.database
            .change(with!([] db => artifacts::delete(db, id, now)))
            .await
    }

    async fn abandoned_artifacts(&self, older_than: i64, limit: u32) -> Result<Vec<ArtifactRow>> {
        self.database
            .change(with!([] db => artifacts::abandoned(db, older_than, limit)))
            .await
    }

    async fn forget_artifact(&self, id: ArtifactId) -> Result<()> {
        self.database.change(with!([] db => artifacts::forget(db, id))).await
    }

    async fn get_key(&self, id: KeyId) -> Result<Option<KeyRow>> {
        self.database.read(with!([] db => keys::get(db, id))).await
    }

    async fn list_keys(&self, project: &str, before: Option<(i64, KeyId)>, limit: u32) -> Result<Vec<KeyRow>> {
        let project = project.to_owned();
        self.database
            .read(with!([project] db => keys::list(db, &project, before, limit)))
            .await
    }

    async fn update_key_state(&self, id: KeyId, next: KeyState, reason: &str, now: i64) -> Result<KeyRow> {
        let reason = reason.to_owned();
        self.database
            .change(with!([reason] db => keys::update_state(db, id, next, &reason, now)))
            .await
    }

    async fn signing_key(&self) -> Result<Option<SealedSigningKey>> {
        self.database.read(with!([] db => commitments::signing_key(db))).await
    }

    async fn keep_signing_key(&self, new: SealedSigningKey, now: i64) -> Result<SealedSigningKey> {
        self.database
            .change(with!([new] db => commitments::keep_signing_key(db, &new, now)))
            .await
    }

    async fn create_owner(&self, new: NewOwner, now: i64) -> Result<OwnerRow> {
        self.database
            .change(with!([new] db => registry::create_owner(db, &new, now)))
            .await
    }

    async fn get_owner(&self, id: OwnerId) -> Result<Option<OwnerRow>> {
        self.database.read(with!([] db => registry::get_owner(db, id))).await
    }

    async fn list_owners(&self, project: &str, before: Option<(i64, OwnerId)>, limit: u32) -> Result<Vec<OwnerRow>> {
        let project = project.to_owned();
        self.database
            .read(with!([project] db => registry::list_owners(db, &project, before, limit)))
            .await
    }

    async fn create_asset(&self, new: NewAsset, signer: Arc<SigningKey>, now: i64) -> Result<AssetRow> {
        self.database
            .change(with!([new, signer] db => registry::create_asset(db, &new, &signer, now)))
            .await
    }

    async fn find_asset_request(&self, request: Uuid) -> Result<Option<AssetRow>> {
        self.database
            .read(with!([] db => registry::find_asset_request(db, request)))
            .await
    }

    async fn get_asset(&self, id: AssetId) -> Result<Option<AssetRow>> {
        self.database.read(with!([] db => registry::get_asset(db, id))).await
    }

    async fn list_assets(
        &self,
        project: &str,
        filter: AssetFilter,
        before: Option<(i64, AssetId)>,
        limit: u32,
    ) -> Result<Vec<AssetRow>> {
        let project = project.to_owned();
        self.database
            .read(with!([project] db => registry::list_assets(db, &project, filter, before, limit)))
            .await
    }

    async fn candidates(&self, key: KeyId, after: i64, limit: u32) -> Result<Vec<Candidate>> {
        self.database
            .read(with!([] db => registry::candidates(db, key, after, limit)))
            .await
    }

    async fn candidate(&self, asset: AssetId) -> Result<Option<Candidate>> {
        self.database.read(with!([] db => registry::candidate(db, asset))).await
    }

    async fn get_commitment(&self, id: CommitmentId) -> Result<Option<Signed>> {
        self.database.read(with!([] db => commitments::get(db, id))).await
    }

    async fn list_commitments(&self, project: &str, after: i64, limit: u32) -> Result<Vec<Signed>> {
        let project = project.to_owned();
        self.database
            .read(with!([project] db => commitments::list(db, &project, after, limit)))
            .await
    }

    async fn head(&self, project: &str) -> Result<Option<Signed>> {
        let project = project.to_owned();
        self.database
            .read(with!([project] db => commitments::head_of(db, &project)))
            .await
    }

    async fn queue_depth(&self) -> Result<i64> {
        self.database.read(with!([] db => jobs::queue_depth(db))).await
    }

    async fn check(&self) -> Result<()> {
        self.database.read(with!([] db => presence::check(db))).await
    }

    fn is_shared(&self) -> bool {
        true
    }

    fn elsewhere(&self) -> Option<broadcast::Receiver<Elsewhere>> {
        Some(self.notices.subscribe())
    }

    async fn close(&self) {
        self.notices.stop();
        self.database.close().await;
    }
}
