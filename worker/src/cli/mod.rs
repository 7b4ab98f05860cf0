//! The command line: what there is to say, and what the process exits with.
mod bench;
mod cameras;
mod convert;
mod credentials;
mod display;
mod embed;
mod embed_copies;
mod embed_levels;
mod evaluate;
mod inspect;
mod key;
mod models;
mod render;
mod run;
mod sample;
mod verify;

use std::io::IsTerminal;
use std::process::ExitCode;

use clap::{Args, CommandFactory as _, Parser, Subcommand, ValueEnum};
use guardsplat_engine::view::SceneKind;
use guardsplat_engine::{Error, Result};
use guardsplat_operations::error_text::in_full;
use tracing_subscriber::EnvFilter;

/// What a command that could be carried out found; errors exit with 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Exit {
    /// Done, or the message matches.
    Done,
    /// The message does not match.
    NoMatch,
    /// Nothing could be decided, or a target was missed.
    Inconclusive,
    /// An error that was told already.
    Failed,
}

impl Exit {
    fn code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::Failed => 1,
            Self::NoMatch => 2,
            Self::Inconclusive => 3,
        }
    }
}

/// Marks 3D Gaussian Splatting scenes with a message and reads it back from pictures of them.
///
/// Exit codes: 0 done or match, 1 error, 2 no match, 3 inconclusive or target missed.
#[derive(Parser)]
#[command(name = "guardsplat-worker", version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Keys: secrets that messages are written and read with
    #[command(subcommand)]
    Key(key::Command),
    /// Marks a scene with a message, verifies the file and only then writes it
    Embed(embed::Arguments),
    /// Reads the message of a scene, or of pictures of one
    Verify(verify::Arguments),
    /// Content credentials (C2PA) of marked scenes: checked, and found again by the mark of a copy
    #[command(subcommand)]
    Credentials(credentials::Command),
    /// Renders views of a scene
    Render(render::Arguments),
    /// Tells what a scene file holds, and whether marking it fits in memory
    Inspect(inspect::Arguments),
    /// Turns cameras of one kind into another, such as those of COLMAP into a file for the service
    Cameras(cameras::Arguments),
    /// Writes a scene in another format
    Convert(convert::Arguments),
    /// Makes a small scene to try things with
    Sample(sample::Arguments),
    /// Weights of other CLIP models and of LPIPS
    #[command(subcommand)]
    Models(models::Command),
    /// Measures marks: scenes, lengths and seeds under attacks, kept in a folder, with reports
    Evaluate(Box<evaluate::Arguments>),
    /// Measures how long marking and verifying take on this machine, with sample scenes
    Bench(bench::Arguments),
    /// Carries out the jobs of a server, until SIGTERM or SIGINT
    Run(run::Arguments),
    // A doc comment would not be allowed here: each of them has its own.
    #[command(flatten)]
    Packaging(guardsplat_packaging::Command),
}

/// How much memory a command may take.
#[derive(Clone, Copy, Debug, Args)]
struct Budget {
    /// Most mebibytes of memory that a job may take; all that the machine has unless given
    #[arg(long, value_name = "MIB", value_parser = clap::value_parser!(u64).range(1..=1 << 24))]
    memory: Option<u64>,
}

impl Budget {
    /// In bytes, where there is one.
    fn bytes(self) -> Option<u64> {
        self.memory.map(|mebibytes| mebibytes << 20)
    }
}

/// What is behind a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Background {
    White,
    Black,
}

impl Background {
    fn rgb(self) -> [f32; 3] {
        match self {
            Self::White => [1.0; 3],
            Self::Black => [0.0; 3],
        }
    }
}

/// How a scene was captured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Kind {
    /// Seen from outside
    Object,
    /// Surroundings, seen from inside
    Room,
    /// Ground, seen from above
    Terrain,
    /// Seen from one side
    Forward,
    /// Something amid its surroundings, seen from around it
    Unbounded,
}

impl Kind {
    fn scene(self) -> SceneKind {
        match self {
            Self::Object => SceneKind::Object,
            Self::Room => SceneKind::Room,
            Self::Terrain => SceneKind::Terrain,
            Self::Forward => SceneKind::Forward,
            Self::Unbounded => SceneKind::Unbounded,
        }
    }
}

/// What reads a message from pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Extractor {
    /// CLIP's features, the key's projection and its decoder.
    Clip,
    /// A convolutional decoder that the key holds.
    Hidden,
}

/// Runs the command that the process was started with.
pub fn run() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and version are no errors. clap's own code for wrong usage, 2, means no match here.
            let code = u8::from(error.use_stderr());
            let _ = error.print();
            return ExitCode::from(code);
        }
    };
    tracing_subscriber::fmt()
        .with_env_filter(filter(&arguments.command))
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .init();
    match carry_out(arguments.command) {
        Ok(exit) => ExitCode::from(exit.code()),
        Err(error) => {
            eprintln!("error: {}", in_full(&error));
            ExitCode::FAILURE
        }
    }
}

/// What is logged: what `RUST_LOG` says, else errors; and of a worker for a server also what it does.
fn filter(command: &Command) -> EnvFilter {
    let default = match command {
        Command::Run(_) => "warn,guardsplat_worker=info,guardsplat_engine=info",
        // Of warnings those that tell a user what to write differently.
        _ => "error,guardsplat_engine::embed::optimizer=warn",
    };
    // After a space before a target the library takes the wrong part of the text.
    let said = std::env::var(EnvFilter::DEFAULT_ENV).ok().and_then(|text| {
        let directives: Vec<&str> = text.split(',').map(str::trim).collect();
        EnvFilter::try_new(directives.join(",")).ok()
    });
    said.unwrap_or_else(|| EnvFilter::new(default))
}

fn carry_out(command: Command) -> crate::error::Result<Exit> {
    Ok(match command {
        Command::Key(command) => key::run(command)?,
        Command::Embed(arguments) => embed::run(&arguments)?,
        Command::Verify(arguments) => verify::run(&arguments)?,
        Command::Credentials(command) => credentials::run(&command)?,
        Command::Render(arguments) => render::run(&arguments)?,
        Command::Inspect(arguments) => inspect::run(&arguments)?,
        Command::Evaluate(arguments) => evaluate::run(&arguments)?,
        Command::Cameras(arguments) => cameras::run(&arguments)?,
        Command::Convert(arguments) => convert::run(&arguments)?,
        Command::Sample(arguments) => sample::run(&arguments)?,
        Command::Models(command) => models::run(command)?,
        Command::Bench(arguments) => bench::run(&arguments)?,
        Command::Run(arguments) => run::run(arguments),
        Command::Packaging(command) => {
            command
                .run(Arguments::command())
                .map_err(|source| crate::error::Error::Packaging { source })?;
            Exit::Done
        }
    })
}

/// Prints a value as JSON on standard output.
fn print_json(value: &impl serde::Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(value).map_err(|e| Error::BadOption {
        field: "--json",
        reason: e.to_string(),
    })?;
    print_line(&text);
    Ok(())
}

/// Prints a line on standard output; that nobody listens any more is no error.
fn print_line(text: &str) {
    use std::io::Write;
    let _ = writeln!(std::io::stdout(), "{text}");
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn the_promised_commands_parse() {
        for line in [
            "key create --bits 32 --seed 7 -o K",
            "key create --bits 8 --extractor hidden --steps 20 -o K",
            "embed IN OUT --key K --message 0 --learn dc --ring -12.5",
            "evaluate DIR --scenes A B --extractor hidden --vae V",
            "embed IN OUT --key K --message 0123abcd --preset draft --seed 1 --device cpu --size 128 --json --memory 2048",
            "embed IN OUT --key K --message 0123abcd --force --report R --ignore-bad-rows",
            "verify A B C --key K --message 0123abcd --json --memory 1 --ignore-bad-rows",
            "render IN DIR --ignore-bad-rows --views 5 --cameras F --size 64 --background black --format exr --seed 3 --memory 9",
            "inspect SCENE --json --cameras F --memory 7 --views 16 --ignore-bad-rows",
            "embed IN OUT --key K --message 0 --kind room",
            "verify A --key K --kind forward --level 2",
            "convert IN OUT --level 1",
            "embed IN OUT --key K --message 0 --credentials C --certificate F --private-key P --algorithm es384",
            "credentials check SCENE SIDECAR --trust T --json",
            "credentials find A B --key K --store S --json",
            "credentials value A --key K --kind room",
            "render IN DIR --views 5 --kind terrain",
            "inspect SCENE --kind object",
            "cameras colmap/sparse/0 cameras.json",
            "sample OUT --gaussians 100 --sh-degree 2 --seed 4",
            "run --server http://127.0.0.1:50051 --device cpu --name a --stop-with-stdin --work-dir D --memory 16777216",
            "bench --gaussians 1000,20000 --presets draft,standard --repetitions 3 --device cpu --key K --json",
            "models list",
            "models verify",
            "completions zsh",
            "manual DIR",
        ] {
            let words = std::iter::once("guardsplat-worker").chain(line.split(' '));
            assert!(Arguments::try_parse_from(words).is_ok(), "{line}");
        }
        let wrong = |line: &str| {
            let words = std::iter::once("guardsplat-worker").chain(line.split(' '));
            Arguments::try_parse_from(words).err().unwrap().to_string()
        };
        let device = wrong("embed IN OUT --key K --message 0 --device cuda");
        assert!(device.contains("must be auto, wgpu or cpu"), "{device}");
        assert!(wrong("verify --key K").contains("PATH"));
        for memory in ["0", "16777217", "-1", "1GB"] {
            let line = format!("verify A --key K --memory={memory}");
            assert!(wrong(&line).contains("--memory"), "{line}");
        }
    }

    #[test]
    fn causes_are_told_once() {
        let inner = std::io::Error::other("disk on fire");
        let error = Error::io("a.ply")(inner);
        assert_eq!(in_full(&error), "a.ply: disk on fire");
    }
}
