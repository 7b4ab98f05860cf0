//! The commands, one a file.
pub mod artifact;
pub mod asset;
pub mod commitment;
pub mod embed;
mod failed_jobs;
pub mod hook;
mod job_list;
pub mod jobs;
pub mod key;
pub mod owner;
pub mod report;
pub mod token;
pub mod verify;
pub mod worker;

use clap::Subcommand;

use crate::context::Context;
use crate::error::Result;
use crate::output::Exit;

/// The commands that work with a server.
#[derive(Subcommand)]
pub enum Command {
    /// Keys: secrets that messages are written and read with; they stay with the server
    #[command(subcommand)]
    Key(key::Command),
    /// Has a scene marked, with an asset's codeword or a raw message, and fetches it
    ///
    /// Exits with 3 when the mark misses what its preset promises; then nothing is written unless --force is given.
    Embed(embed::Arguments),
    /// Tests a claim on a scene or on pictures of one: that they carry the mark of an asset, of an owner, or of anything
    /// that is registered; or reads a raw message
    ///
    /// Exits with 0 for a match, 2 for no match, and 3 when nothing can be decided.
    Verify(verify::Arguments),
    /// Work that is waiting, under way or over
    #[command(subcommand)]
    Jobs(jobs::Command),
    /// Those who carry jobs out
    #[command(subcommand)]
    Worker(worker::Command),
    /// Scenes and pictures that the server keeps
    #[command(subcommand)]
    Artifact(artifact::Command),
    /// Whose originals are registered
    #[command(subcommand)]
    Owner(owner::Command),
    /// Originals that are registered
    #[command(subcommand)]
    Asset(asset::Command),
    /// What was signed of an asset when it was registered: exported, opened in a dispute, checked
    #[command(subcommand)]
    Commitment(commitment::Command),
    /// Tokens of the project: who may call for it, and what
    #[command(subcommand)]
    Token(token::Command),
    /// URLs that the service calls when jobs are over; receivers for such calls, and for notifications of an S3 store
    #[command(subcommand)]
    Hook(hook::Command),
    /// Signed evidence that jobs with an asset or a claim leave
    #[command(subcommand)]
    Report(report::Command),
}

/// Carries out a command that needs the server.
pub async fn run(context: &Context, command: Command) -> Result<Exit> {
    match command {
        Command::Key(command) => key::run(context, &command).await,
        Command::Embed(arguments) => embed::run(context, &arguments).await,
        Command::Verify(arguments) => verify::run(context, &arguments).await,
        Command::Jobs(command) => jobs::run(context, &command).await,
        Command::Worker(command) => worker::run(context, &command).await,
        Command::Artifact(command) => artifact::run(context, &command).await,
        Command::Owner(command) => owner::run(context, &command).await,
        Command::Asset(command) => asset::run(context, &command).await,
        Command::Commitment(command) => commitment::run(context, &command).await,
        Command::Token(command) => token::run(context, &command).await,
        Command::Hook(command) => hook::run(context, &command).await,
        Command::Report(command) => report::run(context, &command).await,
    }
}
