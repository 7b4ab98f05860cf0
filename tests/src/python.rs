//! A Python with packages of tests, in an environment of its own below the build's folder.
use std::path::{Path, PathBuf};
use std::process::Command;

/// The packages and their versions.
const REQUIREMENTS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/requirements.txt");

/// Python with the packages of `tests/requirements.txt`, or `None` (with a message) where it can't be had. In CI that is
/// a failure.
///
/// # Panics
/// In CI, when it can't be had.
pub fn python() -> Option<PathBuf> {
    match install() {
        Ok(python) => Some(python),
        Err(reason) => {
            assert!(std::env::var_os("CI").is_none(), "no Python for tests: {reason}");
            eprintln!("skipped: no Python for this test: {reason}");
            None
        }
    }
}

fn install() -> Result<PathBuf, String> {
    let programs = crate::program("guardsplat");
    let target = programs.parent().ok_or("no folder for it")?;
    let folder = target.join("python-for-tests");
    let python = folder.join("bin/python");
    // Written last, with what was installed.
    let (mark, wanted) = (folder.join("installed.txt"), read(Path::new(REQUIREMENTS))?);
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
        .arg(REQUIREMENTS))?;
    std::fs::write(&mark, wanted).map_err(|e| format!("{}: {e}", mark.display()))?;
    Ok(python)
}

fn read(path: &Path) -> Result<String, String> {
    std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))
}

fn run(command: &mut Command) -> Result<(), String> {
    let output = command.output().map_err(|e| format!("{command:?}: {e}"))?;
    if output.status.success() {
        return Ok(());
    }
    let text = [output.stdout, output.stderr].concat();
    Err(format!("{command:?}: {}", String::from_utf8_lossy(&text)))
}
