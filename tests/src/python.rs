//! A Python with packages of tests, in an environment of its own below the build's folder.
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::installed::{folder, or_skip, run};

/// Python with the packages of `tests/requirements/NAME.txt`, or `None` (with a message) where it can't be had. In CI
/// that is a failure.
///
/// # Panics
/// In CI, when it can't be had.
pub fn python(name: &str) -> Option<PathBuf> {
    or_skip("Python", install(name))
}

fn install(name: &str) -> Result<PathBuf, String> {
    let requirements = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("requirements/{name}.txt"));
    let folder = folder(&format!("python-for-tests-{name}"))?;
    let python = folder.join("bin/python");
    // Written last, with what was installed.
    let (mark, wanted) = (folder.join("installed.txt"), read(&requirements)?);
    if read(&mark).is_ok_and(|installed| installed == wanted) {
        return Ok(python);
    }
    run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&folder))?;
    run(Command::new(&python)
        .args([
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            "--requirement",
        ])
        .arg(&requirements))?;
    std::fs::write(&mark, wanted).map_err(|e| format!("{}: {e}", mark.display()))?;
    Ok(python)
}

fn read(path: &Path) -> Result<String, String> {
    std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))
}
