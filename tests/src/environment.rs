//! A folder of its own for a test, and commands run in it.
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

/// A temporary folder in which commands run; it goes away with the value.
pub struct TestEnvironment {
    folder: tempfile::TempDir,
    variables: Vec<(String, PathBuf)>,
}

impl Default for TestEnvironment {
    fn default() -> Self {
        Self::new()
    }
}

impl TestEnvironment {
    /// An empty folder.
    pub fn new() -> Self {
        Self {
            folder: tempfile::tempdir().expect("the temporary folder is writable"),
            variables: Vec::new(),
        }
    }

    /// Sets a variable for all commands that follow.
    pub fn set(&mut self, variable: &str, value: impl Into<PathBuf>) {
        self.variables.push((variable.into(), value.into()));
    }

    /// Path of a file in the folder.
    pub fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file.
    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), bytes).expect("the folder is writable");
    }

    /// Bytes of a file.
    pub fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// Everything in the folder with its contents, by path; folders end in a slash and have none.
    pub fn contents(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        let mut found = BTreeMap::new();
        let mut folders = vec![self.folder.path().to_path_buf()];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(&folder).expect("the folder is readable") {
                let path = entry.expect("the folder is readable").path();
                let name = path.strip_prefix(self.folder.path()).expect("it lies within");
                if path.is_dir() {
                    found.insert(name.join(""), Vec::new());
                    folders.push(path);
                } else {
                    found.insert(name.into(), std::fs::read(&path).expect("the file is readable"));
                }
            }
        }
        found
    }

    /// Names in a folder, sorted.
    pub fn names(&self, folder: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.path(folder)).unwrap_or_else(|e| panic!("{folder}: {e}"));
        let mut names: Vec<String> = entries
            .map(|entry| entry.expect("readable").file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    /// Runs the worker in the folder; `line` is split at spaces.
    pub fn run(&self, line: &str) -> Output {
        self.output(self.command(&crate::worker()).args(line.split_whitespace()))
    }

    /// Runs the worker where no file may grow beyond `blocks` of 512 bytes: what a full disk looks like.
    #[cfg(unix)]
    pub fn run_on_a_full_disk(&self, blocks: u32, line: &str) -> Output {
        // The signal of the limit is ignored, so that writes fail as they do on a disk without space.
        let script = format!("ulimit -f {blocks}; trap '' XFSZ; exec \"$0\" \"$@\"");
        let mut command = self.command("sh".as_ref());
        command.args(["-c".as_ref(), script.as_ref(), crate::worker().as_os_str()]);
        self.output(command.args(line.split_whitespace().map(OsStr::new)))
    }

    /// Runs the worker in an address space of so many KiB.
    #[cfg(unix)]
    pub fn run_in_little_memory(&self, kibibytes: u64, line: &str) -> Output {
        let script = format!("ulimit -v {kibibytes}; exec \"$0\" \"$@\"");
        let mut command = self.command("sh".as_ref());
        command.args(["-c".as_ref(), script.as_ref(), crate::worker().as_os_str()]);
        self.output(command.args(line.split_whitespace().map(OsStr::new)))
    }

    /// A program to be run in the folder, which finds nothing of the user's own.
    pub fn command(&self, program: &Path) -> Command {
        let mut command = Command::new(program);
        // What tells the tests where things are is for the programs too; all else is left out.
        for (name, _) in std::env::vars_os() {
            let text = name.to_string_lossy();
            if text.starts_with("GUARDSPLAT_") && text != "GUARDSPLAT_CLIP" {
                command.env_remove(name);
            }
        }
        command
            .current_dir(self.folder.path())
            .env("GUARDSPLAT_HOME", self.path("home"))
            .env("XDG_CONFIG_HOME", self.path("config"))
            .env_remove("RUST_LOG")
            .envs(self.variables.iter().map(|(name, value)| (name, value)));
        command
    }

    fn output(&self, command: &mut Command) -> Output {
        command.output().expect("the program starts")
    }

    /// Standard output of a command that must exit with `code`.
    #[track_caller]
    pub fn exits(&self, line: &str, code: i32) -> String {
        let output = self.run(line);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{line}: {stderr}");
        String::from_utf8(output.stdout).expect("it prints UTF-8")
    }

    /// As [`TestEnvironment::exits`], for a command that prints JSON.
    #[track_caller]
    pub fn json(&self, line: &str, code: i32) -> Value {
        let text = self.exits(line, code);
        serde_json::from_str(&text).unwrap_or_else(|e| panic!("{line}: {e}: {text}"))
    }

    /// Checks that a command fails with exit code 1 and one message that holds all of `needles`, and changes nothing
    /// in the folder.
    #[track_caller]
    pub fn refuses(&self, line: &str, needles: &[&str]) {
        let before = self.contents();
        let output = self.run(line);
        check_refusal(line, &output, needles);
        assert!(self.contents() == before, "{line}: it left something behind");
    }
}

/// Checks that a command failed with exit code 1 and a message that holds all of `needles`, without a panic.
#[track_caller]
pub fn check_refusal(line: &str, output: &Output, needles: &[&str]) {
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{line}: {stderr}");
    assert!(
        stderr.contains("error: ") && !stderr.contains("panicked"),
        "{line}: {stderr}"
    );
    for needle in needles {
        assert!(stderr.contains(needle), "{line}: no {needle:?} in {stderr}");
    }
    assert!(output.stdout.is_empty(), "{line}: it also printed a result");
}
