//! What a key may be used for.
use crate::error::{Error, Result};
use crate::ledger::{JobKind, KeyRow, KeyState};
use crate::service::names::ResourceKind;

/// Refuses a key whose state does not allow what a job of this kind does with it.
pub(crate) fn usable(key: &KeyRow, kind: JobKind) -> Result<()> {
    let name = || ResourceKind::Key.name(key.id);
    match (key.state, kind) {
        (KeyState::Active, _) | (KeyState::Retired, JobKind::Verify | JobKind::CreateKey) => Ok(()),
        (KeyState::Retired, JobKind::Embed) => Err(Error::KeyNotActive { name: name() }),
        (KeyState::Revoked, _) => Err(Error::KeyRevoked { name: name() }),
    }
}
