//! Options that many commands take: how the server is reached, and how a job is handed in.
use std::path::PathBuf;

use clap::Args;
use clap::builder::{OsStringValueParser, TypedValueParser};
use uuid::Uuid;

/// Longest display name of a job, in characters.
pub const LONGEST_NAME: usize = 63;

/// What every command understands.
#[derive(Args, Default)]
#[command(next_help_heading = "Options of every command")]
pub struct Global {
    /// Address of the server [default: http://127.0.0.1:50051]
    #[arg(long, global = true, value_name = "URL", env = "GUARDSPLAT_SERVER")]
    pub server: Option<String>,
    /// Configuration file [default: ~/.config/guardsplat/client.toml, where there is one]
    #[arg(long, global = true, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// How long a server that is silent or was lost is waited for, in seconds [default: 60]
    #[arg(long, global = true, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(1..=86_400))]
    pub timeout: Option<u64>,
    /// File of certificates (PEM) that an https server's is checked with, instead of those of public authorities
    #[arg(long, global = true, value_name = "FILE", env = "GUARDSPLAT_CA", value_parser = file())]
    pub ca: Option<PathBuf>,
    /// File of the certificate (PEM) to show to a server that asks for one
    #[arg(long, global = true, value_name = "FILE", env = "GUARDSPLAT_CERT", value_parser = file())]
    pub cert: Option<PathBuf>,
    /// File of that certificate's key (PEM)
    #[arg(long, global = true, value_name = "FILE", env = "GUARDSPLAT_CERT_KEY", value_parser = file())]
    pub cert_key: Option<PathBuf>,
    /// File of the token to show to a server that asks for one; GUARDSPLAT_TOKEN goes before it
    #[arg(long, global = true, value_name = "FILE", env = "GUARDSPLAT_TOKEN_FILE", value_parser = file())]
    pub token_file: Option<PathBuf>,
    /// Prints JSON on standard output
    #[arg(long, global = true)]
    pub json: bool,
}

/// What all commands understand that create a job.
#[derive(Args)]
pub struct Submission {
    /// What people call the job, at most 63 characters; the name of the file unless given
    #[arg(long, value_name = "TEXT", value_parser = display_name)]
    pub display_name: Option<String>,
    /// Names this request: the same command with the same id and the same files gives the same job, however often it is
    /// run; drawn at random unless given
    #[arg(long, value_name = "UUID")]
    pub request_id: Option<Uuid>,
    /// How urgent the job is, -10 to 10: workers are given jobs of a higher number first [default: 5 for verify, else 0]
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true, value_parser = clap::value_parser!(i32).range(-10..=10))]
    pub priority: Option<i32>,
    /// Ends as soon as the job is queued, and prints it
    #[arg(long)]
    pub no_wait: bool,
    /// Ctrl-C while waiting cancels the job; without this, it goes on
    #[arg(long, conflicts_with = "no_wait")]
    pub cancel_on_interrupt: bool,
}

/// Takes the name of a file, an empty one too: that is how a variable is unset in many places.
fn file() -> impl TypedValueParser<Value = PathBuf> {
    OsStringValueParser::new().map(PathBuf::from)
}

/// Takes a display name that is not too long.
///
/// # Errors
/// Its length in characters, for people.
pub fn display_name(text: &str) -> Result<String, String> {
    match text.chars().count() {
        0..=LONGEST_NAME => Ok(text.to_owned()),
        length => Err(format!("{length} characters, at most {LONGEST_NAME} are taken")),
    }
}
