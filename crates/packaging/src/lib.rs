//! What packages ask of a program: shell completions and man pages of its command line.
use std::io::{Result, Write as _};
use std::path::PathBuf;

use clap::Subcommand;
use clap_complete::Shell;

/// Commands that every program has, and that need neither settings nor a server.
#[derive(Clone, Debug, Subcommand)]
pub enum Command {
    /// Prints a script that completes commands and options in a shell
    Completions {
        /// The shell
        #[arg(value_enum)]
        shell: Shell,
    },
    /// Writes man pages into a folder, one for each command
    #[command(hide = true)]
    Manual {
        /// The folder; it is made if need be
        #[arg(value_name = "DIR")]
        folder: PathBuf,
    },
}

impl Command {
    /// Carries it out for the whole command line of a program. An error names the file.
    pub fn run(&self, command_line: clap::Command) -> Result<()> {
        match self {
            Self::Completions { shell } => {
                print_completions(*shell, command_line);
                Ok(())
            }
            Self::Manual { folder } => std::fs::create_dir_all(folder)
                .and_then(|()| clap_mangen::generate_to(command_line, folder))
                .map_err(|error| std::io::Error::new(error.kind(), format!("{}: {error}", folder.display()))),
        }
    }
}

fn print_completions(shell: Shell, mut command_line: clap::Command) {
    let name = command_line.get_name().to_owned();
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut command_line, name, &mut script);
    // That nobody listens any more is no error.
    let _ = std::io::stdout().write_all(&script);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(clap::Parser)]
    #[command(name = "program", version)]
    struct Arguments {
        #[command(subcommand)]
        _command: Command,
    }

    #[test]
    fn every_command_that_is_shown_has_its_page() {
        let folder = tempfile::TempDir::new().unwrap();
        let below = folder.path().join("man");
        let manual = Command::Manual { folder: below.clone() };
        manual.run(<Arguments as clap::CommandFactory>::command()).unwrap();
        let mut names: Vec<_> = std::fs::read_dir(&below)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        assert_eq!(names, ["program-completions.1", "program.1"]);
        let page = std::fs::read_to_string(below.join("program-completions.1")).unwrap();
        assert!(page.contains(".SH SYNOPSIS") && page.contains("SHELL"), "{page}");
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_named() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let folder = file.path().join("man");
        let manual = Command::Manual { folder: folder.clone() };
        let error = manual.run(<Arguments as clap::CommandFactory>::command()).unwrap_err();
        assert!(error.to_string().contains(folder.to_str().unwrap()), "{error}");
    }
}
