//! `commitment export`, `commitment reveal` and `commitment check`: what was signed of an asset, opened in a dispute, and
//! checked by whoever has to believe it.
use std::io::Write as _;
use std::path::{Path, PathBuf};

use clap::Subcommand;
use guardsplat_commitment::PublicKey;
use guardsplat_proto::v1::registry_service_client::RegistryServiceClient;
use guardsplat_proto::v1::{ExportCommitmentRequest, GetAssetRequest, RevealCommitmentRequest};
use serde::Serialize;

use super::report::{key_of, public_key_of_server};
use crate::commitment::{self, Finding};
use crate::context::Context;
use crate::error::{Error, Result};
use crate::output::{Exit, print_json, print_line, printable};
use crate::report::time;
use crate::resource_names;

/// The commands on commitments.
#[derive(Subcommand)]
pub enum Command {
    /// Writes the commitment to an asset as a document that stands for itself; keep it with the original
    Export {
        /// assets/ID, or commitments/ID
        name: String,
        /// The file to write
        #[arg(short, long, value_name = "FILE")]
        output: PathBuf,
    },
    /// Opens the commitment to an asset for a dispute: writes it with the nonce and the blinding that it hides
    ///
    /// Whoever has the file can compute the word of this asset, and of no other; that it was opened stands in evidence of
    /// later claims. Needs the scope admin.
    Reveal {
        /// assets/ID, or commitments/ID
        name: String,
        /// The file to write
        #[arg(short, long, value_name = "FILE")]
        output: PathBuf,
    },
    /// Says whether a commitment is as it was signed; of one that was opened, whether that opens it, and which word the
    /// asset is marked with; and whether that is the word in a report
    ///
    /// Exits with 0 if all of that holds, and with 2 if not.
    Check {
        /// What export or reveal wrote
        file: PathBuf,
        /// evidence.html or evidence.json of a claim on the asset, to compare with
        #[arg(long, value_name = "FILE")]
        report: Option<PathBuf>,
        /// The public key of the service that signed, as PEM or 64 hexadecimal digits; nothing else is needed then.
        /// Without it, the server is asked for its key
        #[arg(long, value_name = "FILE")]
        public_key: Option<PathBuf>,
    },
}

#[derive(Serialize)]
struct Written<'a> {
    commitment: String,
    file: &'a Path,
    /// When it was first opened; null for one that was exported.
    reveal_time: Option<String>,
}

#[derive(Serialize)]
struct Checked {
    holds: bool,
    /// The word that the asset is marked with, in hexadecimal; null where the commitment is not opened.
    word: Option<String>,
    findings: Vec<Finding>,
}

/// Carries out one of them.
pub async fn run(context: &Context, command: &Command) -> Result<Exit> {
    match command {
        Command::Export { name, output } => {
            let request = ExportCommitmentRequest {
                name: commitment_of(context, name).await?,
            };
            let commitment = request.name.clone();
            let sent = context.call("exporting the commitment", request, async |channel, request| {
                RegistryServiceClient::new(channel).export_commitment(request).await
            });
            keep(output, &sent.await?.document)?;
            told(context, commitment, output, None);
            Ok(Exit::Done)
        }
        Command::Reveal { name, output } => {
            let request = RevealCommitmentRequest {
                name: commitment_of(context, name).await?,
            };
            let commitment = request.name.clone();
            let sent = context.call("opening the commitment", request, async |channel, request| {
                RegistryServiceClient::new(channel).reveal_commitment(request).await
            });
            let answer = sent.await?;
            keep(output, &answer.document)?;
            told(context, commitment, output, time(answer.reveal_time));
            Ok(Exit::Done)
        }
        Command::Check {
            file,
            report,
            public_key,
        } => {
            let document = super::report::read(file, guardsplat_commitment::MAX_DOCUMENT_BYTES as u64)?;
            let report = report.as_deref().map(super::report::document).transpose()?;
            let key = match public_key {
                Some(path) => PublicKey::from_bytes(key_of(path)?.as_bytes()),
                None => PublicKey::from_hex(&public_key_of_server(context).await?.hex),
            };
            let key = key.map_err(|error| Error::Answer {
                reason: error.to_string(),
            })?;
            let checked = commitment::check(&document, report.as_deref(), &key);
            let checked = checked.map_err(|error| Error::io(file)(std::io::Error::other(error.to_string())))?;
            Ok(tell(context, checked))
        }
    }
}

/// The name of a commitment, or of the one to an asset.
async fn commitment_of(context: &Context, name: &str) -> Result<String> {
    if let Some(commitment) = resource_names::commitment(name) {
        return Ok(commitment);
    }
    let request = GetAssetRequest {
        name: resource_names::asset(name)?,
    };
    let sent = context.call("reading the asset", request, async |channel, request| {
        RegistryServiceClient::new(channel).get_asset(request).await
    });
    Ok(sent.await?.commitment)
}

/// Writes a document, whole or not at all, for nobody else on this machine.
fn keep(path: &Path, document: &str) -> Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let mut file = tempfile::NamedTempFile::new_in(folder.unwrap_or(Path::new("."))).map_err(Error::io(path))?;
    file.write_all(document.as_bytes()).map_err(Error::io(path))?;
    file.persist(path).map_err(|error| Error::io(path)(error.error))?;
    Ok(())
}

fn told(context: &Context, commitment: String, file: &Path, reveal_time: Option<String>) {
    context.console.clear();
    if context.json {
        print_json(&Written {
            commitment,
            file,
            reveal_time,
        });
        return;
    }
    let opened = reveal_time.map(|time| format!(", opened since {time}"));
    let opened = opened.unwrap_or_default();
    print_line(&printable(&format!(
        "{commitment}{opened}, written to {}",
        file.display()
    )));
}

fn tell(context: &Context, checked: commitment::Checked) -> Exit {
    let holds = checked.findings.iter().all(|finding| finding.holds);
    let word = checked.word.map(|word| word.to_string());
    if context.json {
        print_json(&Checked {
            holds,
            word,
            findings: checked.findings,
        });
    } else {
        for finding in &checked.findings {
            let holds = if finding.holds { "holds" } else { "DOES NOT HOLD" };
            print_line(&printable(&format!("{holds}: {}: {}", finding.what, finding.detail)));
        }
        if let Some(word) = word {
            print_line(&format!("the asset is marked with {word}"));
        }
    }
    match holds {
        true => Exit::Done,
        false => Exit::NoMatch,
    }
}
