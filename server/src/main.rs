//! `guardsplat-server`: settings, log and signals around the server.
use std::io::{IsTerminal, Write as _};
use std::process::ExitCode;
use std::time::Duration;

use clap::{CommandFactory as _, Parser};
use guardsplat_server::settings::{self, Arguments, Command, LogFormat, Settings};
use guardsplat_server::{offline, run};
use tokio::signal::unix::{Signal, SignalKind, signal};

/// What is still being removed from disk at the end gets so long.
const LAST_WORK: Duration = Duration::from_secs(2);

fn main() -> ExitCode {
    let Arguments { flags, command } = Arguments::parse();
    let command = match command {
        Some(Command::Packaging(command)) => {
            return match command.run(Arguments::command()) {
                Ok(()) => ExitCode::SUCCESS,
                Err(error) => {
                    say(&format!("error: {error}"));
                    ExitCode::FAILURE
                }
            };
        }
        Some(Command::Offline(command)) => Some(command),
        None => None,
    };
    // A variable that is not text is none of ours, or names a file that will not be found.
    let environment = std::env::vars_os()
        .filter_map(|(name, value)| Some((name.into_string().ok()?, value.to_string_lossy().into_owned())));
    match settings::load(flags, environment)
        .map_err(|error| error.to_string())
        .and_then(|settings| match command {
            Some(command) => beside(settings, command),
            None => start(settings),
        }) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            say(&format!("error: {error}"));
            ExitCode::FAILURE
        }
    }
}

/// Prints a line on standard error; unlike `eprintln!` it goes on when nobody listens there any more.
fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Does something else than serving.
fn beside(settings: Settings, command: offline::Command) -> Result<(), String> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(|error| format!("starting threads: {error}"))?;
    let said = runtime
        .block_on(offline::run(&settings, command))
        .map_err(|error| in_full(&error))?;
    for line in &said.err {
        say(line);
    }
    for line in &said.out {
        writeln!(std::io::stdout(), "{line}").map_err(|error| format!("standard output: {error}"))?;
    }
    Ok(())
}

fn start(settings: Settings) -> Result<(), String> {
    log(&settings)?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .map_err(|error| format!("starting threads: {error}"))?;
    let ended = runtime.block_on(async {
        let shutdown = asked_to_stop().map_err(|error| format!("listening to signals: {error}"))?;
        run::serve(settings, shutdown).await.map_err(|error| in_full(&error))
    });
    runtime.shutdown_timeout(LAST_WORK);
    ended
}

/// Ends with SIGTERM or SIGINT. Another one while the server is stopping ends the process at once.
fn asked_to_stop() -> std::io::Result<impl Future<Output = ()>> {
    let mut terminate = signal(SignalKind::terminate())?;
    let mut interrupt = signal(SignalKind::interrupt())?;
    Ok(async move {
        either(&mut terminate, &mut interrupt).await;
        tokio::spawn(async move {
            either(&mut terminate, &mut interrupt).await;
            say("error: asked to stop twice, so stopped at once");
            std::process::exit(1);
        });
    })
}

async fn either(one: &mut Signal, other: &mut Signal) {
    tokio::select! {
        _ = one.recv() => {}
        _ = other.recv() => {}
    }
}

fn log(settings: &Settings) -> Result<(), String> {
    let filter = settings.log_filter().map_err(|error| error.to_string())?;
    let subscriber = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal());
    match settings.log_format {
        LogFormat::Text => subscriber.init(),
        LogFormat::Json => subscriber.json().init(),
    }
    Ok(())
}

/// An error and its causes.
fn in_full(error: &dyn std::error::Error) -> String {
    std::iter::successors(Some(error), |error| error.source())
        .map(ToString::to_string)
        .collect::<Vec<_>>()
        .join(": ")
}
