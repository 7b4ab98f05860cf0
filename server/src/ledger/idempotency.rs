//! Requests that were carried out before: the same one gets what the first made, another one under its id,
//! or the same of another project, is refused.
use uuid::Uuid;

use super::registry::{AssetRow, NewAsset, NewOwner, OwnerRow};
use super::types::{JobRow, NewJob};
use super::{LedgerError, Result};

/// The job that was made under the request id, if this is the same request. `fingerprint` is that of the first.
pub(super) fn job(request: Uuid, there: JobRow, fingerprint: &[u8], new: &NewJob) -> Result<JobRow> {
    // Word for word the same, also when an artifact is gone by now whose content could be compared.
    let said_again = (there.kind, &there.spec, &there.display_name, there.priority)
        == (new.kind, &new.spec, &new.display_name, new.priority);
    let same_project = there.project == new.project;
    same(
        request,
        there,
        same_project && (said_again || fingerprint == new.fingerprint),
    )
}

/// The owner that was registered under the request id, if this is the same request.
pub(super) fn owner(request: Uuid, there: OwnerRow, new: &NewOwner) -> Result<OwnerRow> {
    let said_again = (&there.display_name, &there.project) == (&new.display_name, &new.project);
    same(request, there, said_again)
}

/// The asset that was registered under the request id, if this is the same request.
pub(super) fn asset(request: Uuid, there: AssetRow, new: &NewAsset) -> Result<AssetRow> {
    let said_again = (
        there.owner,
        there.key,
        there.sha256,
        &there.display_name,
        &there.project,
    ) == (new.owner, new.key, new.sha256, &new.display_name, &new.project);
    same(request, there, said_again)
}

fn same<T>(request: Uuid, there: T, said_again: bool) -> Result<T> {
    if said_again {
        Ok(there)
    } else {
        Err(LedgerError::RequestIdReused(request))
    }
}
