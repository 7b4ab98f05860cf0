//! `guardsplat-credentials`: content credentials (C2PA) of marked scenes, as sidecars. Nothing is fetched from anywhere.
mod api;
mod check;
mod error;
mod marks;
mod scene_file;
mod serve;
mod sidecar;
mod sign;
mod signer;
mod store;

use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{CommandFactory as _, Parser, Subcommand};

use error::{Error, Result};

/// Signs, checks and reads content credentials (C2PA) of marked scenes.
///
/// Exit codes: 0 done, or the scene is as it was signed by somebody trusted; 1 error; 2 the scene or its credentials were
/// changed; 3 unchanged, but signed by nobody trusted.
#[derive(Parser)]
#[command(name = "guardsplat-credentials", version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Writes the credentials of a marked scene
    Sign(sign::Arguments),
    /// Says whether a scene is as it was signed, and by whom
    Check(check::Arguments),
    /// Prints as JSON which marks credentials name
    Marks {
        /// Sidecars (.c2pa)
        #[arg(value_name = "SIDECAR", required = true)]
        sidecars: Vec<PathBuf>,
    },
    /// Answers the C2PA's Soft Binding Resolution API from a folder of credentials
    Serve(serve::Arguments),
    // A doc comment would not be allowed here: each of them has its own.
    #[command(flatten)]
    Packaging(guardsplat_packaging::Command),
}

fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and version are no errors. clap's own code for wrong usage, 2, means that something was changed.
            let code = u8::from(error.use_stderr());
            let _ = error.print();
            return ExitCode::from(code);
        }
    };
    match run(arguments.command) {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            let _ = writeln!(std::io::stderr(), "error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> Result<u8> {
    match command {
        Command::Sign(arguments) => sign::run(&arguments).map(|()| 0),
        Command::Check(arguments) => check::run(&arguments).map(check::Verdict::code),
        Command::Marks { sidecars } => marks::run(&sidecars).map(|()| 0),
        Command::Serve(arguments) => serve::run(&arguments).map(|()| 0),
        Command::Packaging(command) => command.run(Arguments::command()).map(|()| 0).map_err(Error::Packaging),
    }
}

/// Prints a line on standard output; that nobody listens any more is no error.
fn print_line(text: &str) {
    let _ = writeln!(std::io::stdout(), "{text}");
}

/// Prints a value as JSON on standard output.
fn print_json(value: &impl serde::Serialize) -> Result<()> {
    print_line(&serde_json::to_string_pretty(value).map_err(Error::Json)?);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Arguments::command().debug_assert();
    }
}
