//! The distortions that a mark is trained to stand, as told on a command line or in a file.
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::kind::Kind;

/// A set of distortions, sorted and without duplicates. In files it is a list of names.
///
/// As text it is a list with commas, `all` or `none`. It is shown as a list even if it has all, so that what was written
/// down keeps its meaning when more distortions become known.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(from = "Vec<Kind>", into = "Vec<Kind>")]
pub struct RobustTo(Vec<Kind>);

impl RobustTo {
    /// Nothing: marks are trained on clean pictures.
    pub fn none() -> Self {
        Self::default()
    }

    /// All that are known, those that act on the scene included.
    pub fn all() -> Self {
        Self(Kind::ALL.to_vec())
    }

    /// What it contains, sorted.
    pub fn kinds(&self) -> &[Kind] {
        &self.0
    }

    /// Whether it contains `kind`.
    pub fn contains(&self, kind: Kind) -> bool {
        self.0.contains(&kind)
    }

    /// Those that act on pictures, sorted.
    pub fn of_pictures(&self) -> impl Iterator<Item = Kind> + '_ {
        self.0.iter().copied().filter(|kind| !kind.acts_on_scene())
    }

    /// Those that act on the scene, sorted.
    pub fn of_scenes(&self) -> impl Iterator<Item = Kind> + '_ {
        self.0.iter().copied().filter(|kind| kind.acts_on_scene())
    }
}

impl From<Vec<Kind>> for RobustTo {
    fn from(mut kinds: Vec<Kind>) -> Self {
        kinds.sort();
        kinds.dedup();
        Self(kinds)
    }
}

impl From<RobustTo> for Vec<Kind> {
    fn from(robust_to: RobustTo) -> Self {
        robust_to.0
    }
}

impl FromIterator<Kind> for RobustTo {
    fn from_iter<I: IntoIterator<Item = Kind>>(kinds: I) -> Self {
        kinds.into_iter().collect::<Vec<_>>().into()
    }
}

impl fmt::Display for RobustTo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() {
            return f.pad("none");
        }
        let names: Vec<_> = self.0.iter().map(|kind| kind.name()).collect();
        f.pad(&names.join(","))
    }
}

impl FromStr for RobustTo {
    type Err = Error;

    /// Fails with [`Error::UnknownKind`] for a name that is none, the empty one included; `all` and `none` stand alone.
    fn from_str(text: &str) -> Result<Self> {
        match text.trim() {
            "none" => Ok(Self::none()),
            "all" => Ok(Self::all()),
            list => list.split(',').map(|name| name.trim().parse::<Kind>()).collect(),
        }
        .map_err(|e| match e {
            Error::UnknownKind { name, known } => Error::UnknownKind {
                name,
                known: format!("{known}; or all, or none"),
            },
            other => other,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> RobustTo {
        text.parse().unwrap()
    }

    #[test]
    fn lists_are_sorted_and_without_duplicates() {
        let some = parse("noise, jpeg,crop,jpeg ");
        assert_eq!(some.kinds(), [Kind::Crop, Kind::Jpeg, Kind::Noise]);
        assert_eq!(some.to_string(), "crop,jpeg,noise");
        assert_eq!(parse(&some.to_string()), some);
        assert!(some.contains(Kind::Jpeg) && !some.contains(Kind::Blur));
        assert_eq!(parse("none"), RobustTo::default());
        assert_eq!(parse("none").to_string(), "none");
        assert_eq!(parse("all").kinds(), Kind::ALL);
        assert_eq!(parse(&parse("all").to_string()), parse("all"));
        assert_eq!(format!("{:>6}|", parse("none")), "  none|");
        let mixed = parse("spz,8bit");
        assert_eq!(mixed.of_pictures().collect::<Vec<_>>(), [Kind::EightBit]);
        assert_eq!(mixed.of_scenes().collect::<Vec<_>>(), [Kind::Spz]);
    }

    #[test]
    fn errors_name_what_is_known() {
        for (text, name) in [
            ("jpeg,crp", "\"crp\""),
            ("", "\"\""),
            ("crop,", "\"\""),
            ("all,crop", "\"all\""),
        ] {
            let error = text.parse::<RobustTo>().unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
            assert!(
                error.contains("crop, scaling") && error.ends_with("or all, or none"),
                "{error}"
            );
        }
    }

    #[test]
    fn files_hold_a_list() {
        let read: RobustTo = serde_json::from_str(r#"["8bit","crop","8bit"]"#).unwrap();
        assert_eq!(serde_json::to_string(&read).unwrap(), r#"["crop","8bit"]"#);
        assert!(serde_json::from_str::<RobustTo>(r#"["all"]"#).is_err());
    }
}
