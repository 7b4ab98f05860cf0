//! `hook`: URLs that the service calls when jobs are over, and receivers for such calls and for notifications of stores.
mod listen;
mod manage;
mod s3;

use clap::Subcommand;

use crate::context::Context;
use crate::error::Result;
use crate::output::Exit;

/// The commands on hooks; a token with the scope admin is needed for all but the last two.
#[derive(Subcommand)]
pub enum Command {
    /// Has the service call a URL when jobs are over, and prints the secret of its signatures, this one time
    Create(manage::Create),
    /// Hooks of the project, newest first
    List,
    /// Deletes a hook with all its deliveries
    Delete {
        /// Its name or id
        #[arg(value_name = "HOOK")]
        hook: String,
    },
    /// What was sent to hooks, is to be sent, or was given up, newest first
    Deliveries(manage::Deliveries),
    /// Sends a delivery again, whatever became of it
    Redeliver {
        /// Its name or id
        #[arg(value_name = "DELIVERY")]
        delivery: String,
    },
    /// Takes the service's calls: checks their signatures, fetches marked scenes, and runs a program
    Listen(listen::Arguments),
    /// Takes notifications of an S3 store, and has scenes marked that were put into a bucket
    S3(s3::Arguments),
}

/// Carries out one of them.
pub async fn run(context: &Context, command: &Command) -> Result<Exit> {
    match command {
        Command::Create(arguments) => manage::create(context, arguments).await,
        Command::List => manage::list(context).await,
        Command::Delete { hook } => manage::delete(context, hook).await,
        Command::Deliveries(arguments) => manage::deliveries(context, arguments).await,
        Command::Redeliver { delivery } => manage::redeliver(context, delivery).await,
        Command::Listen(arguments) => listen::run(context, arguments).await,
        Command::S3(arguments) => s3::run(context, arguments).await,
    }
}
