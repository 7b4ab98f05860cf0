//! Admission of scenes by the first bytes of their files: a scene that can't fit is not read at all.
//!
//! Only the least that a scene takes is known here. An embedding predicts the rest once it has read the scene
//! ([`embedding_requirements`](super::embedding_requirements)).
use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::{Limits, MemoryRequirements};
use crate::error::{Error, Result};
use crate::scene::{HEAD, Summary, summary};

/// Refuses a scene that can't be marked within `limits`, whatever the settings, beside `rest`: what the job takes
/// besides the scene.
///
/// # Errors
/// [`Error::DoesNotFit`] with the numbers. A file that can't be read, or is no scene, is left to
/// [`Scene::read`](crate::scene::Scene::read), which says more of it.
pub fn admit_marking(path: &Path, limits: &Limits, rest: MemoryRequirements) -> Result<()> {
    admit(path, limits, rest, Summary::least_to_mark)
}

/// Refuses a scene that can't even be read within `limits`, beside `rest`.
///
/// # Errors
/// Those of [`admit_marking`].
pub fn admit_reading(path: &Path, limits: &Limits, rest: MemoryRequirements) -> Result<()> {
    admit(path, limits, rest, Summary::least_to_read)
}

/// What the first bytes of a file say of its scene, if it is one and they do.
pub fn summary_of(path: &Path) -> Option<Summary> {
    let (head, size) = head(path)?;
    summary(path, &head, size).ok()?
}

fn admit(path: &Path, limits: &Limits, rest: MemoryRequirements, least: impl Fn(&Summary) -> u64) -> Result<()> {
    let Some(summary) = summary_of(path) else {
        return Ok(());
    };
    let memory = MemoryRequirements {
        scene: least(&summary),
        ..rest
    };
    limits.admit(&memory).map_err(|error| match error {
        Error::DoesNotFit { reason } => Error::DoesNotFit {
            reason: format!("{} Gaussians are too many: {reason}", summary.gaussians),
        },
        other => other,
    })
}

/// The first bytes of a file, and its size.
fn head(path: &Path) -> Option<(Vec<u8>, u64)> {
    // Looked at first: what is no file could keep whoever opens it waiting.
    let metadata = std::fs::metadata(path).ok().filter(std::fs::Metadata::is_file)?;
    let mut head = Vec::new();
    let file = File::open(path).ok()?;
    file.take(HEAD as u64).read_to_end(&mut head).ok()?;
    Some((head, metadata.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn up_to(memory: u64) -> Limits {
        Limits {
            memory,
            budget: true,
            buffer: None,
        }
    }

    /// A scene whose file is there to its full length, though nothing but its header is on the disk.
    fn vast(path: &Path, gaussians: u64) -> u64 {
        let names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
        let properties: String = names
            .split(' ')
            .map(|name| format!("property float {name}\n"))
            .collect();
        let header =
            format!("ply\nformat binary_little_endian 1.0\nelement vertex {gaussians}\n{properties}end_header\n");
        std::fs::write(path, &header).unwrap();
        let size = header.len() as u64 + 56 * gaussians;
        File::options().write(true).open(path).unwrap().set_len(size).unwrap();
        size
    }

    #[test]
    fn a_vast_scene_is_refused_unread() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("vast.ply");
        let gaussians = 100_000_000;
        let scene = vast(&path, gaussians) + 56 * gaussians;
        let rest = || MemoryRequirements {
            models: 1 << 20,
            ..MemoryRequirements::of_program()
        };
        let others = rest().total();
        let told = admit_reading(&path, &up_to(8 << 30), rest()).unwrap_err().to_string();
        let words = "the scene does not fit: 100000000 Gaussians are too many: it needs 10.5 GiB (program 36 MiB, models \
                     1 MiB, scene 10.4 GiB), its budget is 8.0 GiB";
        assert_eq!(told, words);
        // To the byte.
        admit_reading(&path, &up_to(scene + others), rest()).unwrap();
        assert!(admit_reading(&path, &up_to(scene + others - 1), rest()).is_err());
        admit_marking(&path, &up_to(2 * scene + others), rest()).unwrap();
        assert!(admit_marking(&path, &up_to(2 * scene + others - 1), rest()).is_err());
    }

    #[test]
    fn what_is_no_scene_is_left_to_the_reader() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("none.ply");
        let nothing = up_to(0);
        admit_reading(&path, &nothing, MemoryRequirements::default()).unwrap();
        admit_reading(folder.path(), &nothing, MemoryRequirements::default()).unwrap();
        std::fs::write(&path, "ply\nformat ascii 1.0\nelement vertex 7\n").unwrap();
        admit_marking(&path, &nothing, MemoryRequirements::default()).unwrap();
    }
}
