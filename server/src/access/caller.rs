//! Who calls: the project that everything the call makes belongs to, and what it may do.
use std::net::IpAddr;

use uuid::Uuid;

use super::{Scope, Scopes};
use crate::error::{Error, Result};

/// The one project of a server that asks for no tokens, and whose everything is that was made before there were any.
pub const DEFAULT_PROJECT: &str = "default";

/// Most characters of a project's name.
const MAX_PROJECT: usize = 63;

/// Who calls. The guard puts one into the extensions of every request that it lets through.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Caller {
    /// Whose everything is that the call makes, and all that it sees.
    pub project: String,
    /// What it may do.
    pub scopes: Scopes,
    /// The token it showed; none where none is asked for.
    pub token: Option<Uuid>,
    /// Where it calls from, if that is known.
    pub address: Option<IpAddr>,
}

impl Caller {
    /// Anybody, where no tokens are asked for: all of the one project is theirs.
    pub fn anybody(address: Option<IpAddr>) -> Self {
        Self {
            project: DEFAULT_PROJECT.to_owned(),
            scopes: Scopes::all(),
            token: None,
            address,
        }
    }

    /// The worker that the server runs itself.
    pub fn own_worker() -> Self {
        Self {
            scopes: [Scope::Worker].into_iter().collect(),
            ..Self::anybody(None)
        }
    }

    /// Whether this is a worker for certain. On an open server anybody may be one, and so nobody is.
    pub fn is_worker(&self) -> bool {
        self.scopes.has(Scope::Worker) && self.scopes != Scopes::all()
    }

    /// Refuses a caller who may not do what `scope` is for.
    pub fn must(&self, scope: Scope) -> Result<()> {
        if self.scopes.has(scope) {
            return Ok(());
        }
        Err(Error::ScopeMissing {
            needed: vec![scope.word()],
        })
    }
}

/// Checks the name of a project: 1 to 63 small letters, digits and hyphens, a letter first.
pub fn check_project(field: &str, name: &str) -> Result<()> {
    let plain = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-';
    let begins = name.bytes().next().is_some_and(|b| b.is_ascii_lowercase());
    if begins && name.len() <= MAX_PROJECT && name.bytes().all(plain) {
        return Ok(());
    }
    Err(Error::invalid(
        field,
        "must be 1 to 63 characters, a small letter and then small letters, digits and hyphens",
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn projects_have_plain_names() {
        for good in ["default", "a", "studio-7", &"a".repeat(63)] {
            check_project("project", good).unwrap();
        }
        for bad in ["", "7up", "-a", "Studio", "a b", "a/b", "é", "a\n", &"a".repeat(64)] {
            assert!(check_project("project", bad).is_err(), "{bad:?}");
        }
    }

    #[test]
    fn what_is_missing_is_told() {
        assert!(Caller::own_worker().is_worker() && !Caller::anybody(None).is_worker());
        assert!(Caller::anybody(None).must(Scope::Admin).is_ok());
        let error = Caller::own_worker().must(Scope::Admin).unwrap_err().to_string();
        assert_eq!(error, "the token lacks the scope admin");
    }
}
