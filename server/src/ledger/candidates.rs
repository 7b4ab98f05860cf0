//! All assets of a key, one after the other, for a search that looks at each.
use futures::stream::{self, Stream, StreamExt, TryStreamExt};

use super::{Candidate, KeyId, Ledger, Result};

/// Assets that are read at once: enough that a page costs little, few enough that memory does not matter.
const PAGE: u32 = 1000;

/// All assets of a key by their payload numbers. Read page by page, so that no transaction stays open meanwhile; one
/// that is registered while the stream is read has a higher number, and comes at the end.
pub fn of_key(ledger: &dyn Ledger, key: KeyId) -> impl Stream<Item = Result<Candidate>> + Send + '_ {
    // Behind which payload number the next page begins; none behind the last.
    let pages = stream::try_unfold(Some(0), move |after| async move {
        let Some(after) = after else { return Result::Ok(None) };
        let page = ledger.candidates(key, after, PAGE).await?;
        let full = page.len() == PAGE as usize;
        let next = page.last().filter(|_| full).map(|last| last.payload);
        Ok(Some((stream::iter(page).map(Ok), next)))
    });
    pages.try_flatten()
}
