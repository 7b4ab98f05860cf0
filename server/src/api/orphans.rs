//! Bytes in the store that no row points at. There should be none: rows come before bytes, and go after them. But a store
//! may carry out late what a server gave up, and a ledger may be set back to a backup.
use std::collections::HashSet;

use futures::TryStreamExt;

use super::status::chain;
use super::{Api, clock};
use crate::artifacts::Listed;
use crate::error::{Error, Result};
use crate::ledger::ArtifactId;

/// Paths that the ledger is asked about at one go.
const AT_ONCE: usize = 500;

impl Api {
    /// Deletes bytes that nothing points at, and that are older than anything may be that is still arriving.
    pub(super) async fn collect_orphans(&self) -> Result<()> {
        let older_than = clock::now().saturating_sub(clock::micros(self.limits().abandoned_after));
        let mut pages = self.store().list().try_chunks(AT_ONCE);
        while let Some(page) = pages.try_next().await.map_err(|error| Error::from(error.1))? {
            let old = page.into_iter().filter(|listed| listed.written < older_than).collect();
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
