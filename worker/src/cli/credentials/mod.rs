//! `credentials`, and the credentials that `embed` writes. Manifests are the business of a program of their own,
//! `guardsplat-credentials`: the C2PA's library would have burn built with other features, and read strangers' files here.
mod copy;
mod find;
mod value;

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use guardsplat_soft_binding::Value;

use super::Exit;
use crate::credentials_program::{self, Certificate, run_to_end};
use crate::error::{Error, Result};

#[derive(Subcommand)]
pub enum Command {
    /// Says whether a scene is as it was signed, and by whom
    ///
    /// Exits with 0 if it is and somebody trusted signed it, 2 if it is not, and 3 if nobody trusted did.
    Check {
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
    },
    /// Finds the credentials of a copy, or of pictures of one, by its mark
    ///
    /// Exits with 0 if they are found, 2 if they are not, and 3 if the key's messages are too short to tell.
    Find(find::Arguments),
    /// Prints what a service that resolves soft bindings is asked for: the value of the mark that a copy reads as
    Value(copy::Arguments),
}

pub fn run(command: &Command) -> Result<Exit> {
    match command {
        Command::Check {
            scene,
            sidecar,
            trust,
            json,
        } => {
            let mut arguments = vec!["check".into(), scene.into(), sidecar.into()];
            arguments.extend(trust.iter().flat_map(|path| ["--trust".into(), path.into()]));
            arguments.extend(json.then(|| "--json".into()));
            // Its exit codes are the same.
            Ok(match run_to_end(&arguments)?.code() {
                Some(0) => Exit::Done,
                Some(2) => Exit::NoMatch,
                Some(3) => Exit::Inconclusive,
                _ => Exit::Failed,
            })
        }
        Command::Find(arguments) => find::run(arguments),
        Command::Value(arguments) => value::run(arguments),
    }
}

/// Credentials that are written beside a marked scene.
#[derive(Args)]
pub struct Signing {
    /// Writes content credentials (C2PA) of the marked scene to this file, such as OUT.c2pa
    #[arg(long, value_name = "FILE")]
    credentials: Option<PathBuf>,
    /// The certificate that they are signed with and those above it (PEM, its own first); a test certificate unless given
    #[arg(long, value_name = "FILE", requires = "private_key", requires = "credentials")]
    certificate: Option<PathBuf>,
    /// Its private key (PEM, PKCS #8)
    #[arg(long, value_name = "FILE", requires = "certificate")]
    private_key: Option<PathBuf>,
    /// How that key signs: es256, es384, es512, ps256, ps384, ps512 or ed25519; es256 unless given
    #[arg(long, value_name = "NAME", requires = "certificate")]
    algorithm: Option<String>,
}

impl Signing {
    /// Whether credentials are asked for.
    pub fn is_wanted(&self) -> bool {
        self.credentials.is_some()
    }

    /// Fails before any work is done where credentials are wanted that can't be written: without the program, for a scene
    /// in several files, without the certificate's files.
    pub fn check(&self, scenes: [&Path; 2]) -> Result<()> {
        if self.credentials.is_none() {
            return Ok(());
        }
        for scene in scenes {
            let several = scene
                .extension()
                .is_some_and(|extension| extension.eq_ignore_ascii_case("gltf"));
            if several || scene.is_dir() {
                return Err(Error::bad_option(
                    "--credentials",
                    format!(
                        "they are of one file, and {} may be several; convert the scene to .glb or .sog",
                        scene.display()
                    ),
                ));
            }
        }
        for path in self.certificate().files() {
            std::fs::File::open(path).map_err(Error::io(path))?;
        }
        Ok(credentials_program::check()?)
    }

    fn certificate(&self) -> Certificate {
        Certificate {
            certificate: self.certificate.clone(),
            private_key: self.private_key.clone(),
            algorithm: self.algorithm.clone(),
        }
    }
}

/// Writes the credentials that are asked for, if any are; the line that tells of them.
pub fn sign(signing: &Signing, original: &Path, marked: &Path, value: &Value) -> Result<Option<String>> {
    let Some(output) = &signing.credentials else {
        return Ok(None);
    };
    let said = credentials_program::sign(&signing.certificate(), original, marked, output, value);
    let said = said.map_err(|error| {
        Error::Credentials(format!(
            "{error}\n  the marked scene is written, its credentials are not"
        ))
    })?;
    Ok(Some(said.trim_end().to_owned()))
}
