//! A folder of sidecars, and which marks they name.
use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::error::{Error, Result};
use crate::marks::{self, Named};

/// What is in the folder: name, length and time of every sidecar.
type Listing = BTreeMap<PathBuf, (u64, Option<SystemTime>)>;

/// Sidecars that are as they were signed.
#[derive(Default)]
pub struct Store {
    folder: PathBuf,
    listing: Listing,
    sidecars: Vec<Named>,
    /// By value, places in `sidecars`, in the order of their names.
    by_mark: BTreeMap<String, Vec<usize>>,
    /// By identifier of the active manifest, the first by name.
    by_manifest: BTreeMap<String, usize>,
}

impl Store {
    /// Reads all sidecars (`.c2pa`) of a folder. Those that are not as they were signed are left out and told on standard
    /// error.
    pub fn open(folder: &Path) -> Result<Self> {
        let mut store = Self {
            folder: folder.into(),
            ..Self::default()
        };
        let listing = list(folder)?;
        store.fill(listing);
        Ok(store)
    }

    /// Reads them again if the folder has changed.
    pub fn refresh(&mut self) -> Result<()> {
        let listing = list(&self.folder)?;
        if listing != self.listing {
            self.fill(listing);
        }
        Ok(())
    }

    fn fill(&mut self, listing: Listing) {
        (self.sidecars, self.by_mark, self.by_manifest) = Default::default();
        for path in listing.keys() {
            let named = marks::read_or_reason(path);
            let Some(manifest) = named.manifest.clone().filter(|_| named.intact) else {
                let reason = named.reason.unwrap_or_else(|| "changed since it was signed".into());
                let _ = writeln!(std::io::stderr(), "left out: {}: {reason}", path.display());
                continue;
            };
            let place = self.sidecars.len();
            for mark in &named.marks {
                self.by_mark.entry(mark.clone()).or_default().push(place);
            }
            self.by_manifest.entry(manifest).or_insert(place);
            self.sidecars.push(named);
        }
        self.listing = listing;
    }

    /// Identifiers of manifests that name a mark, at most so many.
    pub fn manifests_of(&self, mark: &str, most: usize) -> Vec<&str> {
        let places = self.by_mark.get(mark).into_iter().flatten();
        let named = places.filter_map(|&place| self.sidecars.get(place)?.manifest.as_deref());
        named.take(most).collect()
    }

    /// The sidecar of which this is the active manifest.
    pub fn sidecar(&self, manifest: &str) -> Option<&Named> {
        self.sidecars.get(*self.by_manifest.get(manifest)?)
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.sidecars.len()
    }
}

fn list(folder: &Path) -> Result<Listing> {
    let mut listing = Listing::new();
    for entry in std::fs::read_dir(folder).map_err(Error::io(folder))? {
        let path = entry.map_err(Error::io(folder))?.path();
        if path.extension().is_none_or(|extension| extension != "c2pa") {
            continue;
        }
        // One that was just taken away is none.
        if let Ok(metadata) = std::fs::metadata(&path) {
            listing.insert(path, (metadata.len(), metadata.modified().ok()));
        }
    }
    Ok(listing)
}
