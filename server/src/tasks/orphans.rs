//! Bytes in the store that no row points at. There should be none: rows come before bytes, and go after them. But a store
//! may carry out late what a server gave up, a client may send something to the store and not finish, and a ledger may be
//! set back to a backup.
use std::collections::HashSet;

use futures::TryStreamExt;

use crate::artifacts::Listed;
use crate::error::{Error, Result, chain};
use crate::ledger::ArtifactId;
use crate::service::{Service, clock};

/// Paths that the ledger is asked about at one go.
const AT_ONCE: usize = 500;

impl Service {
    /// Deletes bytes that nothing points at, and that are older than anything may be that is still arriving. What went to
    /// the store without the server may wait so long to be finished, and finishing may take so long again.
    pub(crate) async fn collect_orphans(&self) -> Result<()> {
        let longest = clock::micros(self.limits().abandoned_after);
        let [once, twice] = [1, 2].map(|times| clock::now().saturating_sub(longest.saturating_mul(times)));
        let is_old = |listed: &Listed| match listed.path.is_ahead_of_its_row() {
            true => listed.written < twice,
            false => listed.written < once,
        };
        let mut pages = self.store().list().try_chunks(AT_ONCE);
        while let Some(page) = pages.try_next().await.map_err(|error| Error::from(error.1))? {
            let old = page.into_iter().filter(is_old).collect();
            self.delete_unknown(old).await?;
        }
        Ok(())
    }

    async fn delete_unknown(&self, listed: Vec<Listed>) -> Result<()> {
        let ids: Vec<ArtifactId> = listed.iter().filter_map(|listed| listed.path.id()).collect();
        if ids.is_empty() {
            return Ok(());
        }
        let known: HashSet<String> = self.ledger().known_paths(&ids).await?;
        for Listed { path, .. } in listed {
            if known.contains(&path.to_string()) {
                continue;
            }
            match self.store().delete(&path).await {
                Ok(()) => tracing::warn!(%path, "deleted bytes that nothing points at"),
                // The others are not to wait for this one.
                Err(error) => tracing::error!(%path, error = %chain(&error), "could not be deleted"),
            }
        }
        Ok(())
    }
}
