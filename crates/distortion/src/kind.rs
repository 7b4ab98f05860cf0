//! What distortions there are, by name.
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// A distortion that a mark may have to stand. The order is the one in which lists are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum DistortionKind {
    /// A window of the picture is all that is left.
    Crop,
    /// The picture is stored smaller or larger.
    Scaling,
    /// The picture is turned about its centre.
    Rotation,
    /// Colours times a factor.
    Brightness,
    /// Colours are moved from or towards the mean grey.
    Contrast,
    /// Lossy compression by JPEG.
    Jpeg,
    /// Normal noise on each value.
    Noise,
    /// A Gaussian window of three pixels.
    Blur,
    /// Rectangles are painted black.
    Mask,
    /// Values are stored in 8 bits.
    #[serde(rename = "8bit")]
    EightBit,
    /// Crop, brightness and JPEG, one after the other.
    Combined,
    /// Normal noise on the spherical harmonics of the scene.
    ShNoise,
    /// The scene loses spherical harmonics of higher degrees.
    ShTruncation,
    /// The scene is stored as SPZ.
    Spz,
    /// The scene is stored as SOG.
    Sog,
    /// The scene loses Gaussians.
    Pruning,
}

impl DistortionKind {
    /// All of them, in order.
    pub const ALL: [Self; 16] = [
        Self::Crop,
        Self::Scaling,
        Self::Rotation,
        Self::Brightness,
        Self::Contrast,
        Self::Jpeg,
        Self::Noise,
        Self::Blur,
        Self::Mask,
        Self::EightBit,
        Self::Combined,
        Self::ShNoise,
        Self::ShTruncation,
        Self::Spz,
        Self::Sog,
        Self::Pruning,
    ];

    /// The name on command lines and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Crop => "crop",
            Self::Scaling => "scaling",
            Self::Rotation => "rotation",
            Self::Brightness => "brightness",
            Self::Contrast => "contrast",
            Self::Jpeg => "jpeg",
            Self::Noise => "noise",
            Self::Blur => "blur",
            Self::Mask => "mask",
            Self::EightBit => "8bit",
            Self::Combined => "combined",
            Self::ShNoise => "sh-noise",
            Self::ShTruncation => "sh-truncation",
            Self::Spz => "spz",
            Self::Sog => "sog",
            Self::Pruning => "pruning",
        }
    }

    /// Whether it acts on the scene instead of its pictures. This crate only names those.
    pub fn acts_on_scene(self) -> bool {
        self >= Self::ShNoise
    }
}

impl fmt::Display for DistortionKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for DistortionKind {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL
            .into_iter()
            .find(|kind| kind.name() == name)
            .ok_or_else(|| Error::UnknownKind {
                name: name.into(),
                known: Self::ALL.map(Self::name).join(", "),
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_the_same_everywhere_and_all_is_in_order() {
        for kind in DistortionKind::ALL {
            assert_eq!(kind.to_string().parse::<DistortionKind>().unwrap(), kind);
            assert_eq!(serde_json::to_string(&kind).unwrap(), format!("\"{kind}\""));
            let read: DistortionKind = serde_json::from_str(&format!("\"{kind}\"")).unwrap();
            assert_eq!(read, kind);
        }
        assert!(DistortionKind::ALL.is_sorted());
        let scene = DistortionKind::ALL.into_iter().filter(|k| k.acts_on_scene());
        assert_eq!(
            scene.map(DistortionKind::name).collect::<Vec<_>>(),
            ["sh-noise", "sh-truncation", "spz", "sog", "pruning"]
        );
    }
}
