//! Keys that jobs have made, and their states.
use super::Result;
use super::registry::KeyState;
use super::types::{KeyId, KeyRow};

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
}
