//! Resource names, such as `jobs/{uuid}`: a collection, and an id in its one spelling.
use uuid::Uuid;

use crate::error::{Error, Result};

/// What has a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResourceKind {
    /// A job.
    Job,
    /// An artifact.
    Artifact,
    /// A key.
    Key,
    /// An owner of originals.
    Owner,
    /// An original that was registered.
    Asset,
    /// What was signed of an asset.
    Commitment,
    /// What callers show.
    Token,
    /// A URL that is told of jobs that are over.
    Hook,
    /// One message for it.
    Delivery,
}

impl ResourceKind {
    /// Everything that has a name.
    pub const ALL: [Self; 9] = [
        Self::Job,
        Self::Artifact,
        Self::Key,
        Self::Owner,
        Self::Asset,
        Self::Commitment,
        Self::Token,
        Self::Hook,
        Self::Delivery,
    ];

    /// The collection, the first segment of the name.
    pub fn collection(self) -> &'static str {
        match self {
            Self::Job => "jobs",
            Self::Artifact => "artifacts",
            Self::Key => "keys",
            Self::Owner => "owners",
            Self::Asset => "assets",
            Self::Commitment => "commitments",
            Self::Token => "tokens",
            Self::Hook => "hooks",
            Self::Delivery => "deliveries",
        }
    }

    /// One of them, in words.
    pub fn singular(self) -> &'static str {
        match self {
            Self::Job => "job",
            Self::Artifact => "artifact",
            Self::Key => "key",
            Self::Owner => "owner",
            Self::Asset => "asset",
            Self::Commitment => "commitment",
            Self::Token => "token",
            Self::Hook => "hook",
            Self::Delivery => "delivery",
        }
    }

    /// The name of the one with this id.
    pub fn name(self, id: Uuid) -> String {
        format!("{}/{id}", self.collection())
    }

    /// The id in a name; `field` is where the name was given.
    pub fn parse(self, field: &str, name: &str) -> Result<Uuid> {
        let collection = self.collection();
        let id = name.strip_prefix(collection).and_then(|rest| rest.strip_prefix('/'));
        id.and_then(canonical).ok_or_else(|| {
            let what = if name.is_empty() {
                "is missing, it"
            } else {
                "is no such name, it"
            };
            let id = "the id in lower case, as the server gave it";
            Error::invalid(field, format!("{what} must be {collection}/ and {id}"))
        })
    }

    /// That there is none with this id.
    pub fn not_found(self, id: Uuid) -> Error {
        Error::NotFound {
            kind: self.singular(),
            name: self.name(id),
        }
    }
}

/// A UUID in its one spelling: lower case, with hyphens. Other spellings would give one resource several names.
fn canonical(text: &str) -> Option<Uuid> {
    let id = Uuid::try_parse(text).ok()?;
    (id.hyphenated().encode_lower(&mut Uuid::encode_buffer()) == text).then_some(id)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back() {
        let id = Uuid::now_v7();
        for kind in ResourceKind::ALL {
            assert_eq!(kind.parse("name", &kind.name(id)).unwrap(), id);
        }
    }

    #[test]
    fn a_resource_has_one_name_only() {
        let id = Uuid::now_v7();
        let wrong = [
            String::new(),
            "jobs".to_owned(),
            "jobs/".to_owned(),
            format!("keys/{id}"),
            format!("/jobs/{id}"),
            format!("jobs/{id}/"),
            format!("jobs/ {id}"),
            format!("jobs/{}", id.simple()),
            format!("jobs/{}", id.to_string().to_uppercase()),
            format!("jobs/{{{id}}}"),
            format!("jobs/../jobs/{id}"),
            "jobs/../../etc/passwd".to_owned(),
            "é".to_owned(),
        ];
        for name in wrong {
            let error = ResourceKind::Job.parse("job.name", &name).unwrap_err();
            assert!(
                matches!(&error, Error::Invalid(v) if v[0].field == "job.name"),
                "{name}: {error:?}"
            );
        }
    }
}
