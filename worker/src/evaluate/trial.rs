//! What is done to a mark before it is read: to pictures of it, or to the scene.
use std::fmt;
use std::str::FromStr;

use guardsplat_evaluation::attack::Attack;
use guardsplat_evaluation::report::names::{self, SH_DEGREE};
use guardsplat_scene::alter::{ShNoise, add_sh_noise, prune_faint, prune_random, truncate_sh};
use guardsplat_scene::convert::convert;

use crate::error::{Error, Result};
use guardsplat_engine::scene::{Format, Gaussians, Scene};

/// What the mask of the attacks on pictures is called.
const MASK: &str = "mask:";

/// What is done to a mark before it is read; as text what records and reports call it.
#[derive(Clone, Debug, PartialEq)]
pub enum Trial {
    /// Something done to pictures, nothing included.
    Pictures {
        /// What records call it.
        name: String,
        /// What is done.
        attack: Attack,
    },
    /// Compression of pictures by the learned codec, with weights that somebody gave.
    Vae,
    /// Something done to the scene.
    Scene(SceneChange),
}

/// What strangers do to scenes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SceneChange {
    /// A share of the Gaussians is left out, those of lowest opacity.
    PruneLowest(f64),
    /// A share of the Gaussians is left out, at random.
    PruneRandom(f64),
    /// Normal noise of this deviation on all coefficients of the colours.
    ShNoise(f32),
    /// Bands above this degree are dropped.
    ShDegree(usize),
    /// Written in another format and read back.
    Format(Format),
}

impl Trial {
    /// A program of the system that it needs and that is not there, with what to do about it.
    pub fn missing_program(&self) -> Option<String> {
        match self {
            Self::Pictures { attack, .. } => attack.missing_program(),
            Self::Vae | Self::Scene(_) => None,
        }
    }
}

impl FromStr for Trial {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let number = |digits: &str| {
            digits
                .parse::<f64>()
                .map_err(|e| Error::bad_option("attack", format!("{text:?}: {e}")))
        };
        let change = if let Some(share) = text.strip_prefix(names::PRUNE_LOWEST_PREFIX) {
            SceneChange::PruneLowest(number(share)?)
        } else if let Some(share) = text.strip_prefix(names::PRUNE_RANDOM_PREFIX) {
            SceneChange::PruneRandom(number(share)?)
        } else if let Some(sigma) = text.strip_prefix(names::SH_NOISE) {
            SceneChange::ShNoise(number(sigma)? as f32)
        } else if let Some(degree) = text.strip_prefix(SH_DEGREE) {
            SceneChange::ShDegree(number(degree)? as usize)
        } else if let Some(format) = text.strip_prefix(names::FORMAT) {
            SceneChange::Format(format_of(format)?)
        } else if text == names::VAE {
            return Ok(Self::Vae);
        } else {
            let attack = match text.strip_prefix(names::OCCLUSION) {
                Some(share) => format!("{MASK}{share}").parse(),
                None => text.parse(),
            };
            return Ok(Self::Pictures {
                name: text.into(),
                attack: attack.map_err(Error::Evaluation)?,
            });
        };
        Ok(Self::Scene(change))
    }
}

impl fmt::Display for Trial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Pictures { name, .. } => f.write_str(name),
            Self::Vae => f.write_str(names::VAE),
            Self::Scene(SceneChange::PruneLowest(share)) => write!(f, "{}{share}", names::PRUNE_LOWEST_PREFIX),
            Self::Scene(SceneChange::PruneRandom(share)) => write!(f, "{}{share}", names::PRUNE_RANDOM_PREFIX),
            Self::Scene(SceneChange::ShNoise(sigma)) => write!(f, "{}{sigma}", names::SH_NOISE),
            Self::Scene(SceneChange::ShDegree(degree)) => write!(f, "{SH_DEGREE}{degree}"),
            Self::Scene(SceneChange::Format(format)) => write!(f, "{}{}", names::FORMAT, format_name(*format)),
        }
    }
}

impl SceneChange {
    /// The scene after the change; `seed` decides what is random.
    ///
    /// # Errors
    /// Shares and deviations outside their limits, and what a format has no place for.
    pub fn apply(self, gaussians: &Gaussians, seed: u64) -> Result<Gaussians> {
        Ok(match self {
            Self::PruneLowest(share) => prune_faint(gaussians, share)?,
            Self::PruneRandom(share) => prune_random(gaussians, share, seed)?,
            Self::ShNoise(sigma) => {
                let noise = ShNoise {
                    constant: sigma,
                    rest: sigma,
                };
                add_sh_noise(gaussians, noise, seed)?
            }
            Self::ShDegree(degree) => truncate_sh(gaussians, degree),
            Self::Format(format) => {
                let name = std::path::Path::new(format_name(format));
                let mut bytes = Vec::new();
                convert(gaussians, format, name, &mut bytes)?;
                Scene::parse(name, &bytes)?.into_gaussians()
            }
        })
    }
}

/// Formats by the names that reports have for them.
const FORMATS: [(&str, Format); 8] = [
    ("ply", Format::Ply),
    ("compressed-ply", Format::CompressedPly),
    ("spz", Format::Spz),
    ("splat", Format::Splat),
    ("ksplat", Format::Ksplat),
    ("sog", Format::Sog),
    ("gltf", Format::Gltf),
    ("glb", Format::Glb),
];

fn format_name(format: Format) -> &'static str {
    FORMATS
        .iter()
        .find(|(_, f)| *f == format)
        .map_or("ply", |(name, _)| name)
}

fn format_of(name: &str) -> Result<Format> {
    let found = FORMATS.iter().find(|(known, _)| *known == name);
    found.map(|(_, format)| *format).ok_or_else(|| {
        let known = FORMATS.map(|(name, _)| name).join(", ");
        Error::bad_option("attack", format!("{name:?} is no format of scenes; known are {known}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use guardsplat_engine::sample::sample;

    #[test]
    fn names_are_those_of_the_reports() {
        let all = names::PAPER_ATTACKS.iter();
        let scene = [
            "prune-lowest:0.25",
            "prune-random:0.5",
            "sh-noise:0.02",
            "sh-degree:0",
            "occlusion:0.1",
        ];
        for name in all.chain(&scene) {
            assert_eq!(name.parse::<Trial>().unwrap().to_string(), *name);
        }
        for format in names::FORMATS {
            let name = format!("format:{format}");
            assert_eq!(name.parse::<Trial>().unwrap().to_string(), name);
        }
        assert_eq!("format:glb".parse::<Trial>().unwrap().to_string(), "format:glb");
        for wrong in [
            "prune-lowest:x",
            "format:obj",
            "occlusion:2",
            "jpeg:1000",
            "vae:1",
            "magic",
        ] {
            assert!(wrong.parse::<Trial>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn scenes_change_as_they_are_said_to() {
        let scene = sample(64, 2, 1).unwrap().gaussians;
        let after = |change: SceneChange| change.apply(&scene, 7).unwrap();
        assert_eq!(after(SceneChange::PruneLowest(0.25)).len(), 48);
        assert_eq!(after(SceneChange::PruneRandom(0.5)).len(), 32);
        assert_eq!(after(SceneChange::ShDegree(0)).sh.degree, 0);
        assert_eq!(after(SceneChange::Format(Format::Ply)), scene);
        assert_eq!(after(SceneChange::Format(Format::Splat)).sh.degree, 0);
        assert_eq!(after(SceneChange::Format(Format::Glb)).sh, scene.sh);
        assert_ne!(after(SceneChange::ShNoise(0.01)), scene);
        assert!(SceneChange::PruneLowest(1.0).apply(&scene, 1).is_err());
    }
}
