//! Keys that jobs have made, and their states.
use super::Result;
use super::registry::KeyState;
use super::types::{JobId, KeyId, KeyRow};
use super::work::KeyOrder;

/// The keys of all projects; the key files are secret artifacts.
#[async_trait::async_trait]
pub trait KeyLedger: Send + Sync + 'static {
    /// One key.
    async fn get_key(&self, id: KeyId) -> Result<Option<KeyRow>>;

    /// Keys of a project, newest first; those after `before`, as with `list_jobs`.
    async fn list_keys(&self, project: &str, before: Option<(i64, KeyId)>, limit: u32) -> Result<Vec<KeyRow>>;

    /// Retires or revokes a key, for a reason. One that is in that state stays as it is.
    ///
    /// # Errors
    /// `NotFound`; `KeyStateFinal` when nothing leads from the state it has to this one.
    async fn update_key_state(&self, id: KeyId, next: KeyState, reason: &str, now: i64) -> Result<KeyRow>;

    /// Jobs that make or made a key from a seed which is kept as it was told, as versions of before did.
    async fn open_seeds(&self) -> Result<Vec<(JobId, KeyOrder)>>;

    /// Keeps the order of a key with its seed sealed, and another fingerprint of the request in place of one that the
    /// seed could be guessed by.
    async fn seal_seed(&self, job: JobId, order: KeyOrder, fingerprint: [u8; 32]) -> Result<()>;
}
