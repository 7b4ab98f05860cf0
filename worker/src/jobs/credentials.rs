//! Content credentials of the scene that a job marked: signed here, by the program that the offline commands use.
use std::fs;
use std::path::{Path, PathBuf};

use guardsplat_proto::v1::Credentials;
use guardsplat_scene::Format;
use guardsplat_soft_binding::Value;

use super::error::{Error, Result};
use crate::credentials_program::{self, Certificate, Named};

/// What the sidecar is called.
pub const NAME: &str = "marked.c2pa";

/// Fails where the files of a certificate can't be read, before any job is asked for.
pub fn check(certificate: &Certificate) -> Result<()> {
    let half = certificate.certificate.is_some() != certificate.private_key.is_some();
    if half || certificate.certificate.is_none() && certificate.algorithm.is_some() {
        return Err(Error::BadOption {
            field: "--certificate, --private-key",
            reason: "a certificate and its key belong together, and an algorithm to them".into(),
        });
    }
    for path in certificate.files() {
        fs::File::open(path).map_err(Error::io(path))?;
    }
    Ok(())
}

/// Credentials that are wanted of a job's marked scene.
pub struct Order {
    /// Who signs.
    pub certificate: Certificate,
    /// For files.
    pub folder: PathBuf,
    /// The name of the original where it came from.
    pub original_name: String,
}

/// A sidecar, and what is told of it.
pub struct Signed {
    /// The sidecar.
    pub path: PathBuf,
    /// All but its artifact.
    pub told: Credentials,
}

impl Order {
    /// Fails, before any work is done, where credentials can't be made.
    pub fn check(&self, original: &Path) -> Result<()> {
        credentials_program::check()?;
        let format = Format::of(original).map_err(guardsplat_engine::Error::from)?;
        let named_so = Format::of_name(Path::new(&self.original_name)) == Some(Format::Gltf);
        if format == Format::Gltf || named_so {
            return Err(Error::BadJob(
                "job.embed.credentials: they are of one file, and a .gltf may have its data in others; convert the scene to \
                 .glb"
                    .into(),
            ));
        }
        Ok(())
    }

    /// Signs for a scene that was marked with what the soft binding names.
    pub fn sign(&self, original: &Path, marked: &Path, marked_name: &str, value: &Value) -> Result<Signed> {
        let original = self.named(original, "original", &self.original_name)?;
        let marked = self.named(marked, "marked-scene", marked_name)?;
        let path = self.folder.join(NAME);
        credentials_program::sign(&self.certificate, &original, &marked, &path, value)?;
        let named = credentials_program::marks(std::slice::from_ref(&path))?;
        let Some(Named {
            manifest: Some(manifest),
            intact: true,
            ..
        }) = named.into_iter().next()
        else {
            return Err(Error::Damaged {
                what: NAME.into(),
                reason: "what was just signed does not read back".into(),
            });
        };
        Ok(Signed {
            path,
            told: Credentials {
                artifact: String::new(),
                manifest,
                soft_binding: value.text(),
                test_certificate: self.certificate.certificate.is_none(),
                job: String::new(),
            },
        })
    }

    /// The same file under the name that the statement is to tell, in a folder of its own.
    fn named(&self, file: &Path, folder: &str, name: &str) -> Result<PathBuf> {
        let folder = self.folder.join(folder);
        fs::create_dir(&folder).map_err(Error::io(&folder))?;
        // No folders, whatever the name says.
        let name = Path::new(name).file_name().unwrap_or("scene".as_ref());
        let path = folder.join(name);
        fs::hard_link(file, &path)
            .or_else(|_| fs::copy(file, &path).map(|_| ()))
            .map_err(Error::io(&path))?;
        Ok(path)
    }
}
