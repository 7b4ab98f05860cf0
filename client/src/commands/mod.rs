//! The commands, one a file.
pub mod artifact;
pub mod asset;
pub mod completions;
pub mod embed;
mod failed_jobs;
pub mod hook;
pub mod jobs;
pub mod key;
pub mod owner;
pub mod report;
pub mod token;
pub mod verify;

use crate::arguments::Command;
use crate::context::Context;
use crate::error::Result;
use crate::output::Exit;

/// Carries out a command that needs the server.
pub async fn run(context: &Context, command: Command) -> Result<Exit> {
    match command {
        Command::Key(command) => key::run(context, &command).await,
        Command::Embed(arguments) => embed::run(context, &arguments).await,
        Command::Verify(arguments) => verify::run(context, &arguments).await,
        Command::Jobs(command) => jobs::run(context, &command).await,
        Command::Artifact(command) => artifact::run(context, &command).await,
        Command::Owner(command) => owner::run(context, &command).await,
        Command::Asset(command) => asset::run(context, &command).await,
        Command::Token(command) => token::run(context, &command).await,
        Command::Hook(command) => hook::run(context, &command).await,
        Command::Report(command) => report::run(context, &command).await,
        Command::Completions(arguments) => Ok(completions::run(&arguments)),
    }
}
