//! `completions`.
use clap::{Args, CommandFactory};
use clap_complete::Shell;

use crate::output::Exit;

/// Arguments of `completions`.
#[derive(Args)]
pub struct Arguments {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

/// Prints the script.
pub fn run(arguments: &Arguments) -> Exit {
    let mut script = Vec::new();
    clap_complete::generate(
        arguments.shell,
        &mut crate::arguments::Arguments::command(),
        "guardsplat",
        &mut script,
    );
    // That nobody listens any more is no error.
    let _ = std::io::Write::write_all(&mut std::io::stdout(), &script);
    Exit::Done
}
