//! Which ledger the settings name: a file in the data folder, or a database.
use std::path::Path;
use std::sync::Arc;

use crate::ledger::{Ledger, PostgresLedger, Result, SqliteLedger};
use crate::settings::Settings;

/// Opens the ledger, making or updating its tables as needed. `folder` is the data folder.
pub(crate) async fn open(settings: &Settings, folder: &Path) -> Result<Arc<dyn Ledger>> {
    let Some(database) = &settings.database else {
        return Ok(Arc::new(SqliteLedger::open(&folder.join("ledger.sqlite")).await?));
    };
    tracing::info!(%database, "the ledger is in a database");
    Ok(Arc::new(PostgresLedger::open(database.secret()).await?))
}
