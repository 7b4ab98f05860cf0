//! The distortions that a mark is trained to stand, as told on a command line or in a file.
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::kind::DistortionKind;

/// A set of distortions. In files it is a sorted list of names.
///
/// As text it is a list with commas, `all` or `none`. It is shown as a list even if it has all, so that what was written
/// down keeps its meaning when more distortions become known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(from = "Vec<DistortionKind>", into = "Vec<DistortionKind>")]
pub struct RobustTo(u32); // a bit for each kind

impl RobustTo {
    /// Nothing: marks are trained on clean pictures.
    pub fn none() -> Self {
        Self::default()
    }

    /// All that are known, those that act on the scene included.
    pub fn all() -> Self {
        DistortionKind::ALL.into_iter().collect()
    }

    /// What it contains, sorted.
    pub fn kinds(self) -> impl Iterator<Item = DistortionKind> {
        DistortionKind::ALL.into_iter().filter(move |kind| self.contains(*kind))
    }

    /// Whether it contains nothing.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Whether it contains `kind`.
    pub fn contains(self, kind: DistortionKind) -> bool {
        self.0 & bit(kind) != 0
    }

    /// Those that act on pictures, sorted.
    pub fn of_pictures(self) -> impl Iterator<Item = DistortionKind> {
        self.kinds().filter(|kind| !kind.acts_on_scene())
    }

    /// Those that act on the scene, sorted.
    pub fn of_scenes(self) -> impl Iterator<Item = DistortionKind> {
        self.kinds().filter(|kind| kind.acts_on_scene())
    }
}

fn bit(kind: DistortionKind) -> u32 {
    1 << kind as u32
}

impl From<Vec<DistortionKind>> for RobustTo {
    fn from(kinds: Vec<DistortionKind>) -> Self {
        kinds.into_iter().collect()
    }
}

impl From<RobustTo> for Vec<DistortionKind> {
    fn from(robust_to: RobustTo) -> Self {
        robust_to.kinds().collect()
    }
}

impl FromIterator<DistortionKind> for RobustTo {
    fn from_iter<I: IntoIterator<Item = DistortionKind>>(kinds: I) -> Self {
        Self(kinds.into_iter().fold(0, |bits, kind| bits | bit(kind)))
    }
}

impl fmt::Display for RobustTo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_empty() {
            return f.pad("none");
        }
        let names: Vec<_> = self.kinds().map(DistortionKind::name).collect();
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
            list => list
                .split(',')
                .map(|name| name.trim().parse::<DistortionKind>())
                .collect(),
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
        assert_eq!(
            Vec::from(some),
            [DistortionKind::Crop, DistortionKind::Jpeg, DistortionKind::Noise]
        );
        assert_eq!(some.to_string(), "crop,jpeg,noise");
        assert_eq!(parse(&some.to_string()), some);
        assert!(some.contains(DistortionKind::Jpeg) && !some.contains(DistortionKind::Blur));
        assert_eq!(parse("none"), RobustTo::default());
        assert_eq!(parse("none").to_string(), "none");
        assert_eq!(Vec::from(parse("all")), DistortionKind::ALL);
        assert_eq!(parse(&parse("all").to_string()), parse("all"));
        assert_eq!(format!("{:>6}|", parse("none")), "  none|");
        let mixed = parse("spz,8bit");
        assert_eq!(mixed.of_pictures().collect::<Vec<_>>(), [DistortionKind::EightBit]);
        assert_eq!(mixed.of_scenes().collect::<Vec<_>>(), [DistortionKind::Spz]);
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
