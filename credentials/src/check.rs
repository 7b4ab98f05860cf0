//! `check`: whether a scene is as it was signed, and by whom.
use std::path::PathBuf;

use c2pa::validation_status::{ASSERTION_DATAHASH_MISMATCH, SIGNING_CREDENTIAL_EXPIRED, SIGNING_CREDENTIAL_UNTRUSTED};
use c2pa::{Reader, Relationship, ValidationState};
use clap::Args;
use serde::Serialize;

use crate::error::{Error, Result};
use crate::signer::TEST_CERTIFICATE;
use crate::{print_json, print_line, scene_file, sidecar};

/// Arguments of `check`.
#[derive(Args)]
pub struct Arguments {
    /// The scene
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// Its credentials (.c2pa)
    #[arg(value_name = "SIDECAR")]
    sidecar: PathBuf,
    /// Certificates (PEM) of those who are trusted to sign, or of authorities that are; nobody is unless given
    #[arg(long, value_name = "FILE")]
    trust: Option<PathBuf>,
    /// Prints JSON on standard output
    #[arg(long)]
    json: bool,
}

/// What was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// As it was signed, by somebody who is trusted.
    Trusted,
    /// As it was signed, by somebody who is not: anybody can make a certificate.
    Untrusted,
    /// The scene or its credentials are not as they were signed.
    Invalid,
}

impl Verdict {
    /// What the process exits with.
    pub fn code(self) -> u8 {
        match self {
            Self::Trusted => 0,
            Self::Invalid => 2,
            Self::Untrusted => 3,
        }
    }
}

/// What is told.
#[derive(Debug, Serialize)]
struct Report {
    verdict: Verdict,
    /// The manifest's identifier.
    manifest: Option<String>,
    /// The subject of the certificate, and its organisation.
    signed_by: Option<String>,
    organisation: Option<String>,
    /// Whether that is a certificate of the moment.
    test_certificate: bool,
    /// What made the credentials.
    generator: Option<String>,
    /// The hash of the scene before it was marked, as RFC 6920 writes it, and its name.
    original: Option<String>,
    original_title: Option<String>,
    /// Ids of the keys that the scene is said to be marked with.
    marked_with_keys: Vec<String>,
    /// What is wrong: codes of the C2PA's specification, and words.
    failures: Vec<Failure>,
}

#[derive(Debug, Serialize)]
struct Failure {
    code: String,
    reason: String,
}

/// Checks, and tells what was found.
pub fn run(arguments: &Arguments) -> Result<Verdict> {
    let anchors = arguments
        .trust
        .as_ref()
        .map(|path| std::fs::read_to_string(path).map_err(Error::io(path)))
        .transpose()?;
    let bytes = sidecar::read(&arguments.sidecar)?;
    let scene = scene_file::open(&arguments.scene)?;
    let reader = sidecar::reader(anchors)
        .and_then(|reader| reader.with_manifest_data_and_stream(&bytes, scene_file::MEDIA_TYPE, scene))
        .map_err(|error| Error::file(&arguments.sidecar, format!("not content credentials: {error}")))?;
    let report = report(&reader);
    if arguments.json {
        print_json(&report)?;
    } else {
        tell(arguments, &report);
    }
    Ok(report.verdict)
}

fn report(reader: &Reader) -> Report {
    let manifest = reader.active_manifest();
    let signature = manifest.and_then(|manifest| manifest.signature_info());
    let original = manifest.and_then(|manifest| {
        let ingredients = manifest.ingredients().iter();
        ingredients
            .into_iter()
            .find(|ingredient| *ingredient.relationship() == Relationship::ParentOf)
    });
    let signed_by = signature.and_then(|signature| signature.common_name.clone());
    let generator = manifest.and_then(|manifest| manifest.claim_generator_info.as_ref()?.first());
    Report {
        verdict: match reader.validation_state() {
            ValidationState::Trusted => Verdict::Trusted,
            ValidationState::Valid => Verdict::Untrusted,
            ValidationState::Invalid => Verdict::Invalid,
        },
        manifest: reader.active_label().map(str::to_owned),
        test_certificate: signed_by.as_deref() == Some(TEST_CERTIFICATE),
        signed_by,
        organisation: signature.and_then(|signature| signature.issuer.clone()),
        generator: generator.map(|info| [info.name.as_str(), info.version.as_deref().unwrap_or("")].join(" ")),
        original: original.map(|original| original.instance_id().to_owned()),
        original_title: original.and_then(|original| original.title()).map(str::to_owned),
        marked_with_keys: manifest
            .map(sidecar::marks)
            .unwrap_or_default()
            .iter()
            .map(|value| value.key_id())
            .collect(),
        failures: reader
            .validation_status()
            .into_iter()
            .flatten()
            .filter(|status| status.code() != SIGNING_CREDENTIAL_UNTRUSTED)
            .map(|status| Failure {
                code: status.code().to_owned(),
                reason: match status.code() {
                    ASSERTION_DATAHASH_MISMATCH => "the scene is not the one that was signed".into(),
                    SIGNING_CREDENTIAL_EXPIRED => "the certificate has expired".into(),
                    code => status.explanation().unwrap_or(code).to_owned(),
                },
            })
            .collect(),
    }
}

fn tell(arguments: &Arguments, report: &Report) {
    let scene = arguments.scene.display();
    print_line(&match report.verdict {
        Verdict::Trusted => format!("valid: {scene} is as it was signed, by somebody you trust"),
        Verdict::Untrusted if report.test_certificate => {
            format!("unchanged: {scene} is as it was signed, but with a test certificate, which anybody can make")
        }
        Verdict::Untrusted => {
            format!("unchanged: {scene} is as it was signed, but --trust names nobody who vouches for the signer")
        }
        Verdict::Invalid => format!("not valid: {scene} or its credentials were changed"),
    });
    for failure in &report.failures {
        print_line(&format!("  {} ({})", failure.reason, failure.code));
    }
    // What an invalid manifest says is nobody's word.
    if report.verdict == Verdict::Invalid {
        return;
    }
    let unknown = || "not told".to_owned();
    print_line(&format!(
        "signed by   {} ({})",
        report.signed_by.clone().unwrap_or_else(unknown),
        report.organisation.clone().unwrap_or_else(unknown)
    ));
    print_line(&format!(
        "made with   {}",
        report.generator.clone().unwrap_or_else(unknown)
    ));
    print_line(&format!(
        "original    {} ({})",
        report.original.clone().unwrap_or_else(unknown),
        report.original_title.clone().unwrap_or_else(unknown)
    ));
    for key in &report.marked_with_keys {
        print_line(&format!(
            "marked with key {key}; its message is told to who has the key"
        ));
    }
}
