//! Who signs: the operator, with a certificate and its key, or nobody in particular, with a certificate of the moment.
use std::path::PathBuf;

use c2pa::{BoxedSigner, EphemeralSigner, SigningAlg, create_signer};
use clap::{Args, ValueEnum};

use crate::error::{Error, Result};

/// The subject (common name) of test certificates. `.invalid` is nobody's domain (RFC 2606).
pub const TEST_CERTIFICATE: &str = "guardsplat-test-certificate.invalid";

/// The certificate to sign with.
#[derive(Args)]
pub struct Certificate {
    /// The certificate to sign with and those above it (PEM, its own first); a test certificate, made for the moment, unless
    /// given
    #[arg(long, value_name = "FILE", requires = "private_key")]
    certificate: Option<PathBuf>,
    /// Its private key (PEM, PKCS #8)
    #[arg(long, value_name = "FILE", requires = "certificate")]
    private_key: Option<PathBuf>,
    /// How the key signs
    #[arg(long, value_enum, default_value = "es256")]
    algorithm: Algorithm,
}

/// Algorithms of signatures that C2PA allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Algorithm {
    /// ECDSA on P-256
    Es256,
    /// ECDSA on P-384
    Es384,
    /// ECDSA on P-521
    Es512,
    /// RSASSA-PSS with SHA-256
    Ps256,
    /// RSASSA-PSS with SHA-384
    Ps384,
    /// RSASSA-PSS with SHA-512
    Ps512,
    /// Ed25519
    Ed25519,
}

impl Algorithm {
    fn of_c2pa(self) -> SigningAlg {
        match self {
            Self::Es256 => SigningAlg::Es256,
            Self::Es384 => SigningAlg::Es384,
            Self::Es512 => SigningAlg::Es512,
            Self::Ps256 => SigningAlg::Ps256,
            Self::Ps384 => SigningAlg::Ps384,
            Self::Ps512 => SigningAlg::Ps512,
            Self::Ed25519 => SigningAlg::Ed25519,
        }
    }
}

impl Certificate {
    /// What signs, and whether that is a test certificate.
    pub fn signer(&self) -> Result<(BoxedSigner, bool)> {
        let (Some(certificate), Some(private_key)) = (&self.certificate, &self.private_key) else {
            let signer = EphemeralSigner::new(TEST_CERTIFICATE).map_err(|source| self.failed(source))?;
            return Ok((Box::new(signer), true));
        };
        let read = |path: &PathBuf| std::fs::read(path).map_err(Error::io(path));
        let signer = create_signer::from_keys(&read(certificate)?, &read(private_key)?, self.algorithm.of_c2pa(), None);
        Ok((signer.map_err(|source| self.failed(source))?, false))
    }

    /// The error that names what was signed with.
    pub fn failed(&self, source: c2pa::Error) -> Error {
        let with = match &self.certificate {
            Some(path) => format!("{} ({:?})", path.display(), self.algorithm).to_lowercase(),
            None => "a test certificate".into(),
        };
        Error::Signing {
            with,
            source: Box::new(source),
        }
    }
}
