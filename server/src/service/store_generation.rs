//! Whether the store is this ledger's to delete from. Ledger and store name the same generation, and go on to the next
//! together every few minutes. So a ledger that is a copy (a backup that is tried out, with the same bucket) is told from
//! the one that goes on: it takes whatever came since for bytes that nothing points at.
use std::time::Duration;

use uuid::Uuid;

use crate::artifacts::ArtifactStore;
use crate::error::Result;
use crate::ledger::GenerationLedger;
use crate::service::clock;

/// How long a generation lasts, at least: longer than any write to the store is tried.
const LASTS: Duration = Duration::from_secs(5 * 60);

/// What is told while nothing is deleted for it.
pub const CONTESTED: &str = "another ledger takes these artifacts for its own, so nothing is deleted that nobody asks to \
                             delete; stop the servers of the one that is a copy, then say `guardsplat-server store \
                             take-over` with the settings of the other";

/// Whose the store is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    /// This ledger's.
    Ours,
    /// The store went on without this ledger, which is a copy.
    Behind,
    /// Two ledgers take it for theirs.
    Contested,
}

/// Looks whose the store is, and goes on to the next generation when it is time.
pub async fn standing<L: GenerationLedger + ?Sized>(ledger: &L, store: &ArtifactStore, now: i64) -> Result<Standing> {
    // The store first: whatever it names by then, the ledger that goes on knows.
    let there = store.generation().await?;
    let kept = match (ledger.generation().await?, there) {
        (Some(kept), _) => kept,
        (None, None) => ledger.advance_generation(None, Uuid::now_v7(), now).await?,
        // From before there were generations, and its store is not.
        (None, Some(_)) => return Ok(Standing::Behind),
    };
    if store.is_contested().await? {
        return Ok(Standing::Contested);
    }
    match there {
        Some(there) if there == kept.current => {
            if now.saturating_sub(kept.time) >= clock::micros(LASTS) {
                let next = ledger.advance_generation(Some(kept.current), Uuid::now_v7(), now);
                store.set_generation(next.await?.current).await?;
            }
            Ok(Standing::Ours)
        }
        // A server was cut off before it told the store; or the store is new.
        Some(there) if Some(there) != kept.previous => Ok(Standing::Behind),
        Some(_) | None => {
            store.set_generation(kept.current).await?;
            Ok(Standing::Ours)
        }
    }
}

/// Takes the store for this ledger, whatever it names: what came to it since the ledger was copied is lost.
pub async fn take_over<L: GenerationLedger + ?Sized>(ledger: &L, store: &ArtifactStore, now: i64) -> Result<()> {
    let kept = ledger.generation().await?.map(|kept| kept.current);
    let next = ledger.advance_generation(kept, Uuid::now_v7(), now).await?;
    store.set_generation(next.current).await?;
    Ok(store.settle().await?)
}
