//! Requests that were carried out before: the same one gets what the first made, another one under its id,
//! or the same of another project, is refused.
use uuid::Uuid;

use super::registry::{AssetRow, NewAsset, NewOwner, OwnerRow};
use super::types::{JobRow, NewJob};
use super::{LedgerError, Result, codec};

/// The job that was made under the request id, if this is the same request. `fingerprint` is that of the first.
pub(super) fn job(request: Uuid, there: JobRow, fingerprint: &[u8], new: &NewJob) -> Result<JobRow> {
    // Word for word the same, also when an artifact is gone by now whose content could be compared.
    let repeated = (
        there.kind(),
        codec::encode_spec(&there.spec),
        &there.display_name,
        there.priority,
    ) == (
        new.spec.kind(),
        codec::encode_spec(&new.spec),
        &new.display_name,
        new.priority,
    );
    let same_project = there.project == new.project;
    same(
        request,
        there,
        same_project && (repeated || fingerprint == new.fingerprint),
    )
}

/// The owner that was registered under the request id, if this is the same request.
pub(super) fn owner(request: Uuid, there: OwnerRow, new: &NewOwner) -> Result<OwnerRow> {
    let repeated = (&there.display_name, &there.project) == (&new.display_name, &new.project);
    same(request, there, repeated)
}

/// The asset that was registered under the request id, if this is the same request.
pub(super) fn asset(request: Uuid, there: AssetRow, new: &NewAsset) -> Result<AssetRow> {
    let repeated = (
        there.owner,
        there.key,
        there.sha256,
        &there.display_name,
        &there.project,
    ) == (new.owner, new.key, new.sha256, &new.display_name, &new.project);
    same(request, there, repeated)
}

fn same<T>(request: Uuid, there: T, repeated: bool) -> Result<T> {
    if repeated {
        Ok(there)
    } else {
        Err(LedgerError::RequestIdReused(request))
    }
}
