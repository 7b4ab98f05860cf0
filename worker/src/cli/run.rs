//! `run`.
use std::path::PathBuf;

use clap::Args;
use clap::builder::{OsStringValueParser, TypedValueParser};
use guardsplat_engine::device::DeviceChoice;
use guardsplat_proto::connect::{TOKEN_VARIABLE, Target, Token};

use super::{Budget, Exit};
use crate::credentials_program::Certificate;
use crate::jobs;

#[derive(Args)]
pub struct Arguments {
    /// Address of the server, such as http://127.0.0.1:50051, or https:// with TLS. A token is taken from GUARDSPLAT_TOKEN
    #[arg(long, value_name = "URL")]
    server: String,
    /// File of certificates (PEM) that an https server's is checked with, instead of those of public authorities
    #[arg(long, value_name = "FILE", env = "GUARDSPLAT_CA", value_parser = file())]
    ca: Option<PathBuf>,
    /// File of the certificate (PEM) to show to a server that asks for one
    #[arg(long, value_name = "FILE", env = "GUARDSPLAT_CERT", value_parser = file())]
    cert: Option<PathBuf>,
    /// File of that certificate's key (PEM)
    #[arg(long, value_name = "FILE", env = "GUARDSPLAT_CERT_KEY", value_parser = file())]
    cert_key: Option<PathBuf>,
    /// File of the token to show to a server that asks for one; GUARDSPLAT_TOKEN goes before it
    #[arg(long, value_name = "FILE", env = "GUARDSPLAT_TOKEN_FILE", value_parser = file())]
    token_file: Option<PathBuf>,
    /// Where to compute: auto, wgpu or cpu
    #[arg(long, default_value = "auto")]
    device: DeviceChoice,
    #[command(flatten)]
    budget: Budget,
    /// What the worker calls itself; the machine's name and the process's number unless given
    #[arg(long)]
    name: Option<String>,
    /// Leaves, as on SIGTERM, when standard input ends
    #[arg(long)]
    stop_with_stdin: bool,
    /// A folder for the files of jobs under way; the system's for temporary files unless given
    #[arg(long, value_name = "DIR")]
    work_dir: Option<PathBuf>,
    #[command(flatten)]
    signing: Signing,
}

/// Who signs the content credentials (C2PA) that jobs ask for.
#[derive(Args)]
struct Signing {
    /// The certificate that content credentials (C2PA) are signed with and those above it (PEM, its own first); a test
    /// certificate unless given
    #[arg(long, value_name = "FILE", env = "GUARDSPLAT_CREDENTIALS_CERTIFICATE", value_parser = file())]
    certificate: Option<PathBuf>,
    /// Its private key (PEM, PKCS #8)
    #[arg(long, value_name = "FILE", env = "GUARDSPLAT_CREDENTIALS_PRIVATE_KEY", value_parser = file())]
    private_key: Option<PathBuf>,
    /// How that key signs: es256, es384, es512, ps256, ps384, ps512 or ed25519; es256 unless given
    #[arg(long, value_name = "NAME", env = "GUARDSPLAT_CREDENTIALS_ALGORITHM")]
    algorithm: Option<String>,
}

/// Takes the name of a file, an empty one too: that is how a variable is unset in many places.
fn file() -> impl TypedValueParser<Value = PathBuf> {
    OsStringValueParser::new().map(PathBuf::from)
}

pub fn run(arguments: Arguments) -> Exit {
    let variable = std::env::var(TOKEN_VARIABLE).ok();
    let path = |given: Option<PathBuf>| given.filter(|path| !path.as_os_str().is_empty());
    let token_file = path(arguments.token_file);
    let token = match Token::find(variable.as_deref(), token_file.as_deref()) {
        Ok(token) => token,
        Err(error) => {
            eprintln!("error: {error}");
            return Exit::Failed;
        }
    };
    let options = jobs::Options {
        server: Target {
            url: arguments.server,
            ca: path(arguments.ca),
            certificate: path(arguments.cert),
            certificate_key: path(arguments.cert_key),
            token,
        },
        device: arguments.device,
        memory: arguments.budget.bytes(),
        name: arguments.name,
        stop_with_stdin: arguments.stop_with_stdin,
        work_dir: arguments.work_dir,
        certificate: Certificate {
            certificate: path(arguments.signing.certificate),
            private_key: path(arguments.signing.private_key),
            algorithm: arguments.signing.algorithm.filter(|name| !name.is_empty()),
        },
    };
    match jobs::run(&options) {
        Ok(()) => Exit::Done,
        Err(error) => {
            eprintln!("error: {error}");
            Exit::Failed
        }
    }
}
