//! `completions`.
use clap::Args;
use clap_complete::Shell;

use crate::output::Exit;

/// Arguments of `completions`.
#[derive(Args)]
pub struct Arguments {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

/// Prints the script for the whole command line.
pub fn run(arguments: &Arguments, command_line: &mut clap::Command) -> Exit {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, command_line, "guardsplat", &mut script);
    // That nobody listens any more is no error.
    let _ = std::io::Write::write_all(&mut std::io::stdout(), &script);
    Exit::Done
}
