//! Adds a model: fetched beside its final place, checked, and only then moved there.
use super::fetch::Source;
use super::{CONFIG, Entry, LPIPS, MANIFEST, Models, PREPROCESSOR, WEIGHTS, bad, check_name};
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
    /// # Errors
    /// [`Error::BadModel`] when the name is taken, the source has no weights or configuration, the hash differs, or
    /// the weights do not fit; [`Error::Io`] when a file cannot be read or written. Nothing is left behind.
    pub fn add(&self, name: &str, source: &str, sha256: &str) -> Result<Entry> {
        check_name(name)?;
        let expected = sha256.to_ascii_lowercase();
        if expected.len() != 64 || !expected.bytes().all(|b| b.is_ascii_hexdigit()) {
            return Err(bad(name, "sha256 must be 64 hexadecimal digits"));
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
        if !fetch(&weights, WEIGHTS, MAX_WEIGHTS_BYTES)? {
            return Err(bad(name, format!("{weights} does not exist")));
        }
        let found = &files[WEIGHTS].sha256;
        if *found != expected {
            return Err(bad(name, format!("{weights} has hash {found}, expected {expected}")));
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
