//! Tokens of those who may call.
use uuid::Uuid;

use super::Result;
use crate::access::Scopes;

/// Name of a token.
pub type TokenId = Uuid;

/// A token to keep. Its text is kept nowhere.
#[derive(Clone, Debug)]
pub struct NewToken {
    /// Its name.
    pub id: TokenId,
    /// SHA-256 of its text.
    pub hash: [u8; 32],
    /// What people call it.
    pub display_name: String,
    /// Whose it is.
    pub project: String,
    /// What it is good for.
    pub scopes: Scopes,
    /// From when on it is good for nothing; none for never.
    pub expire_time: Option<i64>,
}

/// What is known of a token.
#[derive(Clone, Debug, PartialEq)]
pub struct TokenRow {
    /// Its name.
    pub id: TokenId,
    /// What people call it.
    pub display_name: String,
    /// Whose it is.
    pub project: String,
    /// What it is good for.
    pub scopes: Scopes,
    /// When it was made.
    pub create_time: i64,
    /// From when on it is good for nothing.
    pub expire_time: Option<i64>,
    /// When it was last used, to the minute.
    pub last_use_time: Option<i64>,
    /// Since when it is revoked.
    pub revoke_time: Option<i64>,
}

/// The tokens of those who may call.
#[async_trait::async_trait]
pub trait TokenLedger: Send + Sync + 'static {
    /// Keeps a token.
    async fn create_token(&self, new: NewToken, now: i64) -> Result<TokenRow>;

    /// The token with this hash, be it expired or revoked.
    async fn find_token(&self, hash: &[u8; 32]) -> Result<Option<TokenRow>>;

    /// One token.
    async fn get_token(&self, id: TokenId) -> Result<Option<TokenRow>>;

    /// Tokens of a project (of all, without one), newest first; those after `before` (the `create_time` and id of the
    /// last token of the page before).
    async fn list_tokens(
        &self,
        project: Option<&str>,
        before: Option<(i64, TokenId)>,
        limit: u32,
    ) -> Result<Vec<TokenRow>>;

    /// Revokes a token for good. One that is revoked stays as it is.
    ///
    /// # Errors
    /// `NotFound`.
    async fn revoke_token(&self, id: TokenId, now: i64) -> Result<TokenRow>;

    /// Notes that a token is in use; nothing where it is gone. The time never goes back.
    async fn touch_token(&self, id: TokenId, now: i64) -> Result<()>;
}
