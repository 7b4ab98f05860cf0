//! The project's own CLIPs, which are part of the program. `docs/clip.md` tells how they came about.
//!
//! One that is replaced stays here under its name and hash, so that marks are read for ever.
use std::path::Path;

use burn::module::Module;
use burn::tensor::Device;

use super::config::ClipConfig;
use super::model::{ClipModel, Parts};
use super::tensor_file::TensorFile;
use super::{Clip, weights_path};
use crate::error::{Error, Result};

/// The CLIP that keys of more than [`ROBUST_BITS`] bits are made for.
pub const STANDARD: &str = "guardsplat";
/// The CLIP that shorter keys are made for: it sees coarser colours, and stands strong compression.
pub const ROBUST: &str = "guardsplat-robust";
/// Most bits of a key that is made for [`ROBUST`] unless another CLIP is asked for: it holds no more.
pub const ROBUST_BITS: usize = 16;

/// A CLIP in the program.
struct Shipped {
    name: &'static str,
    config: &'static str,
    weights: &'static [u8],
}

macro_rules! shipped {
    ($name:expr, $folder:literal) => {
        Shipped {
            name: $name,
            config: include_str!(concat!("../../models/", $folder, "/config.json")),
            weights: include_bytes!(concat!("../../models/", $folder, "/model.safetensors")),
        }
    };
}

/// Of one name, that which keys are made for comes first.
static ALL: [Shipped; 2] = [
    shipped!(STANDARD, "guardsplat-clip"),
    shipped!(ROBUST, "guardsplat-clip-robust"),
];

impl Shipped {
    fn hash(&self) -> Result<String> {
        match self.replacement() {
            Some(dir) => TensorFile::open(&weights_path(Path::new(&dir))?)?.sha256(),
            None => TensorFile::from_bytes(self.name, self.weights)?.sha256(),
        }
    }

    /// The folder that `$GUARDSPLAT_CLIP` names instead of the first.
    fn replacement(&self) -> Option<std::ffi::OsString> {
        std::env::var_os("GUARDSPLAT_CLIP").filter(|_| self.name == STANDARD)
    }

    fn load(&self, device: &Device, parts: Parts) -> Result<Clip> {
        if let Some(dir) = self.replacement() {
            return Clip::load(Path::new(&dir), device, parts);
        }
        let config = ClipConfig::parse(self.name, self.config)?;
        let mut file = TensorFile::from_bytes(self.name, self.weights)?;
        let model = ClipModel::new(&config, parts, device).load(&mut file)?;
        Ok(Clip {
            config,
            hash: file.sha256()?,
            model: model.freeze(),
        })
    }
}

impl Clip {
    /// The CLIP that keys are made for unless another is asked for; `$GUARDSPLAT_CLIP` names a folder to use instead.
    ///
    /// # Errors
    /// As [`Clip::load`].
    pub fn shipped(device: &Device, parts: Parts) -> Result<Self> {
        ALL[0].load(device, parts)
    }

    /// The shipped CLIP of this name: that with this hash, where one is wanted and there, else the one that keys are made
    /// for. `None` where none is called so.
    ///
    /// # Errors
    /// As [`Clip::load`].
    pub fn shipped_as(name: &str, hash: Option<&str>, device: &Device, parts: Parts) -> Option<Result<Self>> {
        let mut named = ALL.iter().filter(|shipped| shipped.name == name);
        let wanted = named.clone().find(|shipped| {
            let found = shipped.hash().ok();
            hash.is_some() && found.as_deref() == hash
        });
        wanted
            .or_else(|| named.next())
            .map(|shipped| shipped.load(device, parts))
    }

    /// The shipped CLIP that keys of so many bits are made for.
    pub fn shipped_for(bits: usize) -> &'static str {
        // One that was put in the place of the first is wanted for all keys.
        match bits <= ROBUST_BITS && std::env::var_os("GUARDSPLAT_CLIP").is_none() {
            true => ROBUST,
            false => STANDARD,
        }
    }

    /// Hashes of the weights of all shipped CLIPs, without loading them.
    ///
    /// # Errors
    /// [`Error::BadModel`] or [`Error::Io`] where `$GUARDSPLAT_CLIP` names none.
    pub fn shipped_hashes() -> Result<Vec<String>, Error> {
        ALL.iter().map(Shipped::hash).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_is_found_by_name_and_hash() {
        let device = Device::flex();
        let hashes = Clip::shipped_hashes().unwrap();
        for (shipped, hash) in ALL.iter().zip(&hashes) {
            let found = Clip::shipped_as(shipped.name, Some(hash), &device, Parts::Image);
            assert_eq!(&found.unwrap().unwrap().hash, hash);
        }
        let newest = Clip::shipped_as(STANDARD, None, &device, Parts::Image)
            .unwrap()
            .unwrap();
        assert_eq!(newest.hash, hashes[0]);
        let unknown = Clip::shipped_as(STANDARD, Some("00"), &device, Parts::Image)
            .unwrap()
            .unwrap();
        assert_eq!(unknown.hash, hashes[0]);
        assert!(Clip::shipped_as("vit-b32", None, &device, Parts::Image).is_none());
        assert_eq!([16, 17].map(Clip::shipped_for), [ROBUST, STANDARD]);
    }
}
