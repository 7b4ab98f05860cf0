//! Programs that are run for a message: it is on their standard input, and the main things of it in variables.
use std::process::Stdio;

use tokio::io::AsyncWriteExt;
use tokio::process::Command;

use crate::error::{Error, Result};
use crate::output::printable;

/// Most bytes of its standard output that are read.
const MOST: usize = 64 << 10;

/// A program and its arguments.
#[derive(Clone, Debug)]
pub struct Program(Vec<String>);

impl Program {
    /// None where there are no words.
    pub fn new(words: &[String]) -> Option<Self> {
        (!words.is_empty()).then(|| Self(words.to_vec()))
    }

    /// Runs it to its end; what it wrote on standard output.
    ///
    /// # Errors
    /// That it could not be run, or did not exit with 0.
    pub async fn run(&self, input: &[u8], variables: &[(&str, String)]) -> Result<String> {
        let (name, arguments) = self
            .0
            .split_first()
            .map_or(("", &[][..]), |(name, rest)| (name.as_str(), rest));
        let mut child = Command::new(name)
            .args(arguments)
            .envs(variables.iter().map(|(name, value)| (*name, value)))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .kill_on_drop(true)
            .spawn()
            .map_err(Error::io(name))?;
        let mut stdin = child.stdin.take();
        let feed = async {
            if let Some(mut stdin) = stdin.take() {
                // A program may not care for it.
                let _ = stdin.write_all(input).await;
            }
        };
        let (_, output) = tokio::join!(feed, child.wait_with_output());
        let output = output.map_err(Error::io(name))?;
        let failed = |reason: String| Error::Program {
            program: name.to_owned(),
            reason,
        };
        if !output.status.success() {
            return Err(failed(output.status.to_string()));
        }
        if output.stdout.len() > MOST {
            return Err(failed(format!("wrote more than {MOST} bytes")));
        }
        String::from_utf8(output.stdout).map_err(|error| failed(printable(&error.to_string())))
    }
}
