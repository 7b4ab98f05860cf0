//! `guardsplat`: marks scenes and verifies suspects through a GuardSplat server.
mod arguments;
mod backoff;
mod commands;
mod commitment;
mod console;
mod context;
mod details;
mod distortion;
mod error;
mod file_kind;
mod http_client;
mod inputs;
mod interrupt;
mod job;
mod options;
mod output;
mod pages;
mod report;
mod resource_names;
mod scene_kind;
mod server;
mod settings;
mod stage;
mod trace;
mod transfer;
mod webhook;

use std::process::ExitCode;

use arguments::{Arguments, Command};
use clap::CommandFactory as _;
use context::Context;
use error::{Error, Result};
use output::Exit;
use trace::Trace;

fn main() -> ExitCode {
    let (arguments, name) = match Arguments::read() {
        Ok(arguments) => arguments,
        Err(error) => {
            // Help and version are no errors. clap's own code for wrong usage, 2, means no match here.
            let code = u8::from(error.use_stderr());
            let _ = error.print();
            return ExitCode::from(code);
        }
    };
    let json = arguments.global.json;
    match run(arguments, &name) {
        Ok(exit) => ExitCode::from(exit.code()),
        Err(error) => {
            error.tell(json);
            ExitCode::FAILURE
        }
    }
}

/// Carries out one command, which is called `name`; an interrupt ends it at any time.
fn run(arguments: Arguments, name: &str) -> Result<Exit> {
    let Arguments { global, command } = arguments;
    let command = match command {
        Command::Server(command) => *command,
        Command::Packaging(command) => {
            return command
                .run(Arguments::command())
                .map(|()| Exit::Done)
                .map_err(|source| Error::Packaging { source });
        }
    };
    let mut context = Context::new(&global)?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(|source| Error::Runtime { source })?;
    let result = runtime.block_on(async {
        let trace = Trace::begin(name);
        context.trace(&trace);
        let result = tokio::select! {
            biased;
            () = interrupt::heard() => Err(interrupt::answer(&context).await),
            result = commands::run(&context, command) => result,
        };
        context.console.clear();
        let (code, failure) = match &result {
            Ok(exit) => (exit.code(), None),
            Err(error) => (1, Some(error.reason())),
        };
        trace.end(code, failure).await;
        result
    });
    // An interrupted command may have left a file being read; the process does not wait for it.
    runtime.shutdown_background();
    result
}
