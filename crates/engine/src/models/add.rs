//! Adds a model: fetched beside its final place, checked, and only then moved there.
use super::fetch::Source;
use super::{CONFIG, Entry, LPIPS, MANIFEST, Models, PREPROCESSOR, WEIGHTS, bad, check_name, lpips};
use crate::clip::{ClipConfig, ClipModel, TensorFile, write_whole};
use crate::error::{Error, Result};
use std::collections::BTreeMap;

/// Largest weights file. The largest published CLIP (RN50x64, f32) has 2.5 GB.
const MAX_WEIGHTS_BYTES: u64 = 8 << 30;
const MAX_CONFIG_BYTES: u64 = 1 << 20;

impl Models {
    /// Adds the model `name` from a weights file, a folder with one, or an https URL of one, whose SHA-256 must be
    /// `sha256` (hexadecimal). The configuration is taken from beside the weights, and must fit them.
    ///
    /// [`LPIPS`] has no configuration. Its published weights are known by their hash, so it may go without one; where
    /// they come as the package or the checkpoint of [`lpips`], the safetensors file is made of it, and `sha256` may be
    /// that of either.
    ///
    /// # Errors
    /// [`Error::BadModel`] when the name is taken, the source has no weights or configuration, the hash differs or is
    /// wanted, or the weights do not fit; [`Error::Io`] when a file cannot be read or written. Nothing is left behind.
    pub fn add(&self, name: &str, source: &str, sha256: Option<&str>) -> Result<Entry> {
        check_name(name)?;
        let expected = sha256.map(str::to_ascii_lowercase);
        match &expected {
            Some(hash) if hash.len() != 64 || !hash.bytes().all(|b| b.is_ascii_hexdigit()) => {
                return Err(bad(name, "sha256 must be 64 hexadecimal digits"));
            }
            None if name != LPIPS => return Err(bad(name, "the SHA-256 of its weights must be given")),
            _ => (),
        }
        let place = self.folder.join(name);
        if place.exists() {
            return Err(bad(name, format!("is there already; delete {} first", place.display())));
        }
        std::fs::create_dir_all(&self.folder).map_err(Error::io(&self.folder))?;
        let staged = tempfile::Builder::new()
            .prefix(".add-")
            .tempdir_in(&self.folder)
            .map_err(Error::io(&self.folder))?;

        let weights = Source::parse(name, source)?;
        let mut files = BTreeMap::new();
        let mut fetch = |from: &Source, file: &str, most: u64| -> Result<bool> {
            let found = from.fetch(name, &staged.path().join(file), most)?;
            Ok(found.map(|entry| files.insert(file.to_owned(), entry)).is_some())
        };
        // The small files first: a missing one is then found before gigabytes are fetched.
        if name != LPIPS {
            let config = weights.beside(CONFIG);
            if !fetch(&config, CONFIG, MAX_CONFIG_BYTES)? {
                return Err(bad(
                    name,
                    format!("{config} does not exist; the configuration must be beside the weights"),
                ));
            }
            fetch(&weights.beside(PREPROCESSOR), PREPROCESSOR, MAX_CONFIG_BYTES)?;
            ClipConfig::read(staged.path())?;
        }
        let most = if name == LPIPS {
            lpips::MAX_SOURCE_BYTES
        } else {
            MAX_WEIGHTS_BYTES
        };
        if !fetch(&weights, WEIGHTS, most)? {
            return Err(bad(name, format!("{weights} does not exist")));
        }
        let fetched = files[WEIGHTS].sha256.clone();
        if name == LPIPS
            && let Some(unpacked) = lpips::unpack(&staged.path().join(WEIGHTS), &fetched)?
        {
            files.insert(WEIGHTS.to_owned(), unpacked);
        }
        let found = &files[WEIGHTS].sha256;
        match expected {
            Some(expected) if expected != fetched && expected != *found => {
                return Err(bad(name, format!("{weights} has hash {fetched}, expected {expected}")));
            }
            None if found != lpips::WEIGHTS_SHA256 => {
                let known = [lpips::PACKAGE_SHA256, lpips::CHECKPOINT_SHA256, lpips::WEIGHTS_SHA256].join(", ");
                return Err(bad(
                    name,
                    format!(
                        "{weights} has hash {fetched}, expected one of {known}; others are added with their SHA-256"
                    ),
                ));
            }
            _ => (),
        }
        let file = TensorFile::open(&staged.path().join(WEIGHTS))?;
        if name != LPIPS {
            ClipModel::check(&ClipConfig::read(staged.path())?, &file)?;
        }

        let entry = Entry {
            name: name.to_owned(),
            source: source.to_owned(),
            files,
        };
        let manifest = serde_json::to_vec_pretty(&entry).map_err(|e| bad(name, e))?;
        write_whole(&staged.path().join(MANIFEST), &manifest)?;
        std::fs::rename(staged.path(), &place).map_err(Error::io(&place))?;
        // Moved away: there is nothing left to clean up.
        let _ = staged.keep();
        Ok(entry)
    }
}
