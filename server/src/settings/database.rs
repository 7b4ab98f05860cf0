//! The URL of a database, which may hold a password: it is shown without, everywhere.
use std::convert::Infallible;
use std::fmt;
use std::str::FromStr;

use secrecy::{ExposeSecret, SecretString};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// The environment variable that may hold the URL.
pub const DATABASE_VARIABLE: &str = "GUARDSPLAT_DATABASE";

/// Where a database is, and who asks there.
#[derive(Clone)]
pub struct DatabaseUrl(SecretString);

impl DatabaseUrl {
    /// All of it, for whoever connects.
    pub fn secret(&self) -> &SecretString {
        &self.0
    }
}

/// Anything is taken, so that no parser repeats it in an error; `Settings::check` looks at it.
impl FromStr for DatabaseUrl {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(Self(SecretString::from(text)))
    }
}

/// Without user and password, and without parameters.
impl fmt::Display for DatabaseUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some((scheme, rest)) = self.0.expose_secret().split_once("://") else {
            return f.write_str("…");
        };
        // The last one, and before anything else is looked for: a password may be written without the care it needs.
        let (who, rest) = match rest.rsplit_once('@') {
            Some((_, rest)) => ("…@", rest),
            None => ("", rest),
        };
        write!(
            f,
            "{scheme}://{who}{}",
            rest.split(['?', '#']).next().unwrap_or_default()
        )
    }
}

impl fmt::Debug for DatabaseUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}

impl Serialize for DatabaseUrl {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for DatabaseUrl {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer).map(|text| Self(text.into()))
    }
}

/// A text about a file that can't be read, which may quote from it: lines with a URL end there.
pub(super) fn without_urls(text: &str) -> String {
    let lines = text.lines().map(|line| match line.split_once("://") {
        Some((before, _)) => format!("{before}://…"),
        None => line.to_owned(),
    });
    lines.collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn passwords_are_not_shown() {
        for (url, shown) in [
            ("postgres://a:5ec2et@db:5432/ledger", "postgres://…@db:5432/ledger"),
            ("postgres://a:5ec2et?@/x#y@db/ledger", "postgres://…@db/ledger"),
            ("postgres://db/ledger?user=a&password=5ec2et", "postgres://db/ledger"),
            ("postgresql:///ledger", "postgresql:///ledger"),
            ("5ec2et", "…"),
        ] {
            let url: DatabaseUrl = url.parse().unwrap_or_else(|error| match error {});
            assert_eq!((url.to_string(), format!("{url:?}")), (shown.into(), shown.into()));
            assert_eq!(serde_json::to_value(&url).unwrap(), shown);
        }
        let quoted = "expected `\"`\n  | database = \"postgres://a:5ec2et@db\n  | ^";
        assert_eq!(
            without_urls(quoted),
            "expected `\"`\n  | database = \"postgres://…\n  | ^"
        );
    }
}
