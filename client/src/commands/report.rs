//! `report open`, `report check` and `report key`: the signed evidence that jobs with an asset or a claim leave.
use std::path::{Path, PathBuf};

use clap::Subcommand;
use guardsplat_commitment::PublicKey;
use guardsplat_evidence::limits::HTML_BYTES;
use guardsplat_evidence::{Altered, Answer, Checked, VerifyingKey, check};
use guardsplat_proto::v1::job::Result as Outcome;
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::registry_service_client::RegistryServiceClient;
use guardsplat_proto::v1::{GetJobRequest, GetPublicKeyRequest};
use serde::Serialize;

use crate::context::Context;
use crate::error::{Error, Result};
use crate::output::{Exit, print_json, print_line, printable};
use crate::resource_names;
use crate::transfer::download;

/// Bytes of a key's file; PEM takes 113.
const KEY_BYTES: u64 = 4096;

/// The commands on reports.
#[derive(Subcommand)]
pub enum Command {
    /// Fetches the report of a job: a page for people, and the same as JSON
    Open {
        /// jobs/ID, or the id alone
        job: String,
        /// The folder to write evidence.html and evidence.json into; made if it is missing
        #[arg(short, long, value_name = "FOLDER")]
        output: PathBuf,
    },
    /// Says whether a report, page or JSON, is as it was signed, and whether its numbers follow from each other
    ///
    /// Exits with 0 if all of that holds, and with 2 if not.
    Check {
        /// evidence.html or evidence.json
        file: PathBuf,
        /// The public key of the service that signed, as PEM or 64 hexadecimal digits; nothing else is needed then.
        /// Without it, the server is asked for its key
        #[arg(long, value_name = "FILE")]
        public_key: Option<PathBuf>,
    },
    /// Prints the public key that the server signs with, as PEM: keep it for those who check
    Key,
}

#[derive(Serialize)]
struct Opened {
    job: String,
    html: PathBuf,
    json: PathBuf,
}

/// What a check found.
#[derive(Serialize)]
struct Report {
    holds: bool,
    /// `genuine`, `altered`, `wrong_key`, `unsigned` or `not_a_report`.
    answer: &'static str,
    reason: Option<String>,
    findings: Vec<Finding>,
}

#[derive(Serialize)]
struct Finding {
    what: String,
    stated: String,
    recomputed: String,
    agrees: bool,
}

/// Carries out one of them.
pub async fn run(context: &Context, command: &Command) -> Result<Exit> {
    match command {
        Command::Open { job, output } => open(context, resource_names::job(job)?, output).await,
        Command::Check { file, public_key } => {
            let document = document(file)?;
            let key = match public_key {
                Some(path) => key_of(path)?,
                None => key_from(&public_key_of_server(context).await?.hex)?,
            };
            Ok(tell(context, check(&document, &key)))
        }
        Command::Key => {
            let key = public_key_of_server(context).await?;
            match context.json {
                true => print_json(&serde_json::json!({ "hex": key.hex, "pem": key.pem })),
                false => print_line(key.pem.trim_end()),
            }
            Ok(Exit::Done)
        }
    }
}

async fn open(context: &Context, job: String, folder: &Path) -> Result<Exit> {
    let request = GetJobRequest { name: job.clone() };
    let sent = context.call("reading the job", request, async |channel, request| {
        JobServiceClient::new(channel).get_job(request).await
    });
    let [page, data] = match sent.await?.result {
        Some(Outcome::EmbedResult(result)) => [result.evidence_html, result.evidence_json],
        Some(Outcome::VerifyResult(result)) => [result.evidence_html, result.evidence_json],
        _ => Default::default(),
    };
    if page.is_empty() || data.is_empty() {
        return Err(Error::BadOption {
            field: "JOB",
            reason: format!(
                "{job} left no report; jobs that mark an asset or test a claim do when they have succeeded"
            ),
        });
    }
    std::fs::create_dir_all(folder).map_err(Error::io(folder))?;
    let [html, json] = ["evidence.html", "evidence.json"].map(|name| folder.join(name));
    download(context, &page, &html).await?;
    download(context, &data, &json).await?;
    context.console.clear();
    match context.json {
        true => print_json(&Opened { job, html, json }),
        false => [html, json]
            .iter()
            .for_each(|path| print_line(&format!("written to {}", path.display()))),
    }
    Ok(Exit::Done)
}

pub(super) async fn public_key_of_server(context: &Context) -> Result<guardsplat_proto::v1::PublicKey> {
    let request = GetPublicKeyRequest {};
    let sent = context.call("reading the public key", request, async |channel, request| {
        RegistryServiceClient::new(channel).get_public_key(request).await
    });
    sent.await
}

pub(super) fn key_of(path: &Path) -> Result<VerifyingKey> {
    let bytes = read(path, KEY_BYTES)?;
    let text = String::from_utf8_lossy(&bytes);
    let key = match text.trim_start().starts_with("-----BEGIN") {
        true => PublicKey::from_pem(&text).map(|key| key.to_hex()),
        false => PublicKey::from_hex(&text).map(|key| key.to_hex()),
    };
    key_from(&key.map_err(|error| Error::io(path)(std::io::Error::other(error.to_string())))?)
}

fn key_from(digits: &str) -> Result<VerifyingKey> {
    let bad = |reason: String| Error::Answer { reason };
    let key = PublicKey::from_hex(digits).map_err(|error| bad(error.to_string()))?;
    VerifyingKey::from_bytes(&key.to_bytes()).map_err(|error| bad(error.to_string()))
}

/// A report, as a file.
pub(super) fn document(path: &Path) -> Result<Vec<u8>> {
    read(path, HTML_BYTES as u64)
}

/// A file that may have so many bytes.
pub(super) fn read(path: &Path, limit: u64) -> Result<Vec<u8>> {
    let size = std::fs::metadata(path).map_err(Error::io(path))?.len();
    if size > limit {
        let reason = format!("{size} bytes, at most {limit} are read");
        return Err(Error::io(path)(std::io::Error::other(reason)));
    }
    std::fs::read(path).map_err(Error::io(path))
}

fn tell(context: &Context, checked: Checked) -> Exit {
    let holds = checked.holds();
    let (answer, reason) = match checked.answer {
        Answer::Genuine => ("genuine", None),
        Answer::Altered(Altered::Evidence) => (
            "altered",
            Some("the evidence, or its signature, is not as it was signed".to_owned()),
        ),
        Answer::Altered(Altered::Page) => (
            "altered",
            Some("the page is not as it was signed; the evidence inside is".to_owned()),
        ),
        Answer::Altered(Altered::Impossible(error)) => ("altered", Some(error.to_string())),
        Answer::WrongKey { signer } => (
            "wrong_key",
            Some(format!("it was signed by {}", hex::encode(signer.as_bytes()))),
        ),
        Answer::Unsigned => ("unsigned", Some("nobody signed it".to_owned())),
        Answer::NotAReport(error) => ("not_a_report", Some(error.to_string())),
    };
    let findings: Vec<_> = checked.findings.into_iter().map(Finding::from).collect();
    if context.json {
        print_json(&Report {
            holds,
            answer,
            reason,
            findings,
        });
    } else {
        let reason = reason.map(|reason| format!(": {}", printable(&reason)));
        print_line(&format!("{}{}", answer.replace('_', " "), reason.unwrap_or_default()));
        for finding in &findings {
            let agrees = if finding.agrees { "agrees" } else { "DOES NOT AGREE" };
            print_line(&printable(&format!(
                "{agrees}: {}: {} stated, {} computed again",
                finding.what, finding.stated, finding.recomputed
            )));
        }
    }
    match holds {
        true => Exit::Done,
        false => Exit::NoMatch,
    }
}

impl From<guardsplat_evidence::Finding> for Finding {
    fn from(finding: guardsplat_evidence::Finding) -> Self {
        Self {
            what: finding.what,
            stated: finding.stated,
            recomputed: finding.recomputed,
            agrees: finding.agrees,
        }
    }
}
