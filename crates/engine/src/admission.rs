//! Whether a scene can fit, told from the first bytes of its file: one that can't is not read at all.
//!
//! What is foreseen here is what a scene takes at least. An embedding predicts the whole once it has read the scene
//! ([`crate::embed::needs`]).
use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::error::{Error, Result};
use crate::memory::{Limits, Memory};
use crate::scene::{HEAD, Summary, summary};

/// Refuses a scene that can't be marked within `limits`, whatever the settings, beside `rest`: what the job takes
/// besides the scene.
///
/// # Errors
/// [`Error::DoesNotFit`] with the numbers. A file that can't be read, or is no scene, is left to
/// [`Scene::read`](crate::scene::Scene::read), which says more of it.
pub fn to_mark(path: &Path, limits: &Limits, rest: Memory) -> Result<()> {
    admit(path, limits, rest, Summary::least_to_mark)
}

/// Refuses a scene that can't even be read within `limits`, beside `rest`.
///
/// # Errors
/// Those of [`to_mark`].
pub fn to_read(path: &Path, limits: &Limits, rest: Memory) -> Result<()> {
    admit(path, limits, rest, Summary::least_to_read)
}

/// Bytes of a picture of so many pixels as it is drawn, and again in 8 bits a channel.
pub fn picture_bytes(width: u32, height: u32) -> u64 {
    2 * 12 * u64::from(width) * u64::from(height)
}

/// What the first bytes of a file say of its scene, if it is one and they do.
pub fn summary_of(path: &Path) -> Option<Summary> {
    let (head, size) = head(path)?;
    summary(path, &head, size).ok()?
}

fn admit(path: &Path, limits: &Limits, rest: Memory, least: impl Fn(&Summary) -> u64) -> Result<()> {
    let Some(summary) = summary_of(path) else {
        return Ok(());
    };
    let memory = Memory {
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
    use crate::embed::{ModelBytes, Preset, SceneSize, ViewSize, needs};
    use crate::sample::sample;
    use crate::scene::Scene;

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
        let rest = || Memory {
            models: 1 << 20,
            ..Memory::of_program()
        };
        let others = rest().total();
        let told = to_read(&path, &up_to(8 << 30), rest()).unwrap_err().to_string();
        let words = "the scene does not fit: 100000000 Gaussians are too many: it needs 10.5 GiB (program 36 MiB, models \
                     1 MiB, scene 10.4 GiB), its budget is 8.0 GiB";
        assert_eq!(told, words);
        // To the byte.
        to_read(&path, &up_to(scene + others), rest()).unwrap();
        assert!(to_read(&path, &up_to(scene + others - 1), rest()).is_err());
        to_mark(&path, &up_to(2 * scene + others), rest()).unwrap();
        assert!(to_mark(&path, &up_to(2 * scene + others - 1), rest()).is_err());
    }

    #[test]
    fn what_is_no_scene_is_left_to_the_reader() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("none.ply");
        let nothing = up_to(0);
        to_read(&path, &nothing, Memory::default()).unwrap();
        to_read(folder.path(), &nothing, Memory::default()).unwrap();
        std::fs::write(&path, "ply\nformat ascii 1.0\nelement vertex 7\n").unwrap();
        to_mark(&path, &nothing, Memory::default()).unwrap();
    }

    /// What is foreseen is never more than what is predicted once the scene is read.
    #[test]
    fn what_is_foreseen_is_less_than_what_is_predicted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("in.ply");
        let view = ViewSize {
            visible: 0.0,
            pixel: 0.0,
        };
        for degree in 0..=3 {
            let scene = sample(2000, degree, 1).unwrap();
            scene.write(&path, &scene.gaussians.sh).unwrap();
            let scene = Scene::read(&path).unwrap();
            let needed = needs(
                SceneSize::of(&scene),
                view,
                &Preset::Draft.settings(),
                ModelBytes::default(),
            );
            to_mark(&path, &up_to(needed.total()), Memory::of_program()).unwrap();
            to_read(&path, &up_to(needed.program + needed.scene), Memory::of_program()).unwrap();
        }
    }
}
