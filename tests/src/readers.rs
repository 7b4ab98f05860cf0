//! Programs of other authors that read scenes: what they find in a marked file is what its users see.
//!
//! Both are asked for a PLY of the scene, which they write in single precision.
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use crate::installed::{folder, or_skip, run};
use crate::ply::Ply;
use crate::python::python;

/// The last version that says of itself that it runs on Node.js 18, which Debian has.
const SPLAT_TRANSFORM: &str = "@playcanvas/splat-transform@2.7.1";
/// Reads a scene and writes it as a PLY.
const GSPLY: &str = r#"
import sys
import gsply
source, target = sys.argv[1:]
data = gsply.read_spz(source) if source.endswith(".spz") else gsply.plyread(source)
gsply.plywrite(target, data)
"#;

/// A program that reads scenes.
#[derive(Clone, Debug)]
pub enum Reader {
    /// PlayCanvas' converter, in JavaScript; it reads SPZ with Niantic's own library. A scene in SPZ is turned by half a
    /// turn about x, to the axes that PLYs usually have.
    SplatTransform(PathBuf),
    /// A library in Python; numbers are as the file has them.
    Gsply(PathBuf),
}

impl Reader {
    /// PlayCanvas' converter, or `None` (with a message) where it can't be had. In CI that is a failure.
    ///
    /// # Panics
    /// In CI, when it can't be had.
    pub fn splat_transform() -> Option<Self> {
        static FOUND: OnceLock<Option<PathBuf>> = OnceLock::new();
        let found = FOUND.get_or_init(|| or_skip("Node.js", install_splat_transform()));
        found.clone().map(Self::SplatTransform)
    }

    /// The Python library, or `None` (with a message) where it can't be had. In CI that is a failure.
    ///
    /// # Panics
    /// In CI, when it can't be had.
    pub fn gsply() -> Option<Self> {
        static FOUND: OnceLock<Option<PathBuf>> = OnceLock::new();
        FOUND.get_or_init(|| python("scenes")).clone().map(Self::Gsply)
    }

    /// Whether it turns scenes of this file's kind by half a turn about x.
    pub fn turns(&self, scene: &Path) -> bool {
        matches!(self, Self::SplatTransform(_)) && scene.extension().is_some_and(|e| e == "spz")
    }

    /// Converts a scene to the format of the other name.
    ///
    /// # Panics
    /// When it can't.
    #[track_caller]
    pub fn convert(&self, scene: &Path, other: &Path) {
        let mut command = match self {
            Self::SplatTransform(program) => {
                let mut command = Command::new("node");
                // What it would compute on a GPU can be had on the CPU, and is the same everywhere.
                command.arg(program).args(["--quiet", "--overwrite", "--gpu", "cpu"]);
                command
            }
            Self::Gsply(python) => {
                let mut command = Command::new(python);
                command.args(["-c", GSPLY]);
                command
            }
        };
        let done = run(command.arg(scene).arg(other));
        assert!(done.is_ok() && other.is_file(), "{done:?}");
    }

    /// What it finds in a scene, by way of the PLY `copy`.
    ///
    /// # Panics
    /// When it can't read it.
    #[track_caller]
    pub fn read(&self, scene: &Path, copy: &Path) -> Ply {
        self.convert(scene, copy);
        Ply::parse(&std::fs::read(copy).expect("it was written"))
    }
}

fn install_splat_transform() -> Result<PathBuf, String> {
    let (_, version) = SPLAT_TRANSFORM.rsplit_once('@').ok_or("no version")?;
    let folder = folder(&format!("splat-transform-{version}"))?;
    let program = folder.join("node_modules/@playcanvas/splat-transform/bin/cli.mjs");
    let mark = folder.join("installed");
    if !mark.is_file() {
        run(Command::new("npm")
            .args([
                "install",
                "--loglevel=error",
                "--no-audit",
                "--no-fund",
                "--no-save",
                "--ignore-scripts",
            ])
            // Its peer is a whole engine for viewers, which converting does without.
            .args(["--legacy-peer-deps", "--prefix"])
            .arg(&folder)
            .arg(SPLAT_TRANSFORM))?;
    }
    run(Command::new("node").arg(&program).arg("--version"))?;
    std::fs::write(&mark, "").map_err(|e| format!("{}: {e}", mark.display()))?;
    Ok(program)
}
