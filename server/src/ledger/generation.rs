//! Which generation of the artifact store a ledger belongs to: the store names it too, so that a copy of a ledger that
//! goes on without it is known.
use uuid::Uuid;

use super::Result;

/// The generation that ledger and store are in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Generation {
    /// Its name.
    pub current: Uuid,
    /// The one before, which the store may still name if a server was cut off in between.
    pub previous: Option<Uuid>,
    /// When it began.
    pub time: i64,
}

/// The generation, as the ledger has it.
#[async_trait::async_trait]
pub trait GenerationLedger: Send + Sync + 'static {
    /// The one it is in; none before the first start.
    async fn generation(&self) -> Result<Option<Generation>>;

    /// Goes on from `from` to `next`, and returns the one it is in then: another one if some server came first.
    async fn advance_generation(&self, from: Option<Uuid>, next: Uuid, now: i64) -> Result<Generation>;
}
