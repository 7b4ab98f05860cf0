//! The CLIPs that are part of the program: the one that new keys read with, and those of before, whose marks are read for ever. `docs/clip.md` tells how they came about.
use super::{Clip, ClipConfig, ClipModel, Parts, TensorFile, weights_path};
use crate::error::{Error, Result};
use burn::tensor::Device;
use std::path::Path;

/// The variable that names a folder to use instead of the newest.
const INSTEAD: &str = "GUARDSPLAT_CLIP";

/// A CLIP that is part of the program.
pub struct ShippedClip {
    /// What keys call it.
    pub name: &'static str,
    config: &'static str,
    weights: &'static [u8],
    /// SHA-256 of the weights that keys are bound to, where only the image tower of these is kept: reading takes no more.
    whole: Option<&'static str>,
}

// Statics: of a constant the program would hold a copy for each use.
static NEWEST_WEIGHTS: [u8; include_bytes!("../../models/guardsplat-2/model.safetensors").len()] =
    *include_bytes!("../../models/guardsplat-2/model.safetensors");
static SHORT_WEIGHTS: [u8; include_bytes!("../../models/guardsplat-short/image.safetensors").len()] =
    *include_bytes!("../../models/guardsplat-short/image.safetensors");
static FIRST_WEIGHTS: [u8; include_bytes!("../../models/guardsplat/image.safetensors").len()] =
    *include_bytes!("../../models/guardsplat/image.safetensors");

/// The newest.
const NEWEST: ShippedClip = ShippedClip {
    name: "guardsplat-2",
    config: include_str!("../../models/guardsplat-2/config.json"),
    weights: &NEWEST_WEIGHTS,
    whole: None,
};

/// For messages of up to 16 bits that were embedded bit by bit: of lower radians, which stand more and tell fewer messages
/// apart.
const SHORT: ShippedClip = ShippedClip {
    name: "guardsplat-short",
    config: include_str!("../../models/guardsplat-short/config.json"),
    weights: &SHORT_WEIGHTS,
    whole: Some("7399ef0fa63a4fb623fd9d186f9db191d8fcfa66d6279acf501d67932c320c3c"),
};

/// The first, of November 2026: all pixels weigh alike.
const FIRST: ShippedClip = ShippedClip {
    name: "guardsplat",
    config: include_str!("../../models/guardsplat/config.json"),
    weights: &FIRST_WEIGHTS,
    whole: Some("e24e926482d51d0867cb74de92595c5155954c00dcedf253004cf53148bf04c5"),
};

impl ShippedClip {
    /// All of them, the newest first.
    pub const ALL: [Self; 3] = [NEWEST, SHORT, FIRST];
    /// What the newest is called, with which new keys read.
    pub const NEWEST: &'static str = NEWEST.name;

    /// The one of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|clip| clip.name == name)
    }

    /// Loads it; `$GUARDSPLAT_CLIP` names a folder to use instead of the newest.
    ///
    /// # Errors
    /// As [`Clip::load`], and where a text tower is asked of one of which only the image tower is kept.
    pub fn load(&self, device: &Device, parts: Parts) -> Result<Clip> {
        if let Some(dir) = self.instead() {
            return Clip::load(Path::new(&dir), device, parts);
        }
        if self.whole.is_some() && parts != Parts::Image {
            return Err(Error::BadModel {
                name: self.name.into(),
                reason: format!("only reads: new keys are made with {}", Self::NEWEST),
            });
        }
        let config = ClipConfig::parse(self.name, self.config)?;
        let mut file = self.file()?;
        let model = ClipModel::new(&config, parts, device).load(&mut file)?;
        Ok(Clip {
            config,
            hash: self.hash()?,
            model: model.settled(),
        })
    }

    /// The hash that keys are bound to, without loading weights.
    ///
    /// # Errors
    /// As [`Clip::load`], of the file of weights.
    pub fn hash(&self) -> Result<String> {
        match (self.instead(), self.whole) {
            (Some(dir), _) => TensorFile::open(&weights_path(Path::new(&dir))?)?.sha256(),
            (None, Some(hash)) => Ok(hash.into()),
            (None, None) => self.file()?.sha256(),
        }
    }

    fn file(&self) -> Result<TensorFile> {
        TensorFile::from_bytes(self.name, self.weights)
    }

    fn instead(&self) -> Option<std::ffi::OsString> {
        std::env::var_os(INSTEAD).filter(|_| self.name == Self::NEWEST)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn those_of_before_read_and_make_no_keys() {
        let device = Device::flex();
        for before in ["guardsplat", "guardsplat-short"].map(|name| ShippedClip::named(name).unwrap()) {
            let clip = before.load(&device, Parts::Image).unwrap();
            assert_eq!(clip.hash, before.hash().unwrap());
            let refused = before.load(&device, Parts::Both).unwrap_err().to_string();
            assert!(refused.contains("guardsplat-2"), "{refused}");
        }
        assert!(ShippedClip::named("guardsplat-0").is_none());
    }

    #[test]
    fn names_and_hashes_differ() {
        let [newest, short, first] = ShippedClip::ALL.map(|clip| (clip.name, clip.hash().unwrap()));
        for (a, b) in [(&newest, &short), (&short, &first), (&newest, &first)] {
            assert!(a.0 != b.0 && a.1 != b.1, "{a:?} {b:?}");
        }
        assert_eq!(newest.0, ShippedClip::NEWEST);
    }
}
