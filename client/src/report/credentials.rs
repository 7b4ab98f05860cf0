//! Content credentials (C2PA) of marked scenes.
use guardsplat_proto::v1::Credentials;
use serde::Serialize;

use super::text::some;
use crate::output::printable;

/// A sidecar that the server keeps.
#[derive(Debug, Serialize)]
pub struct CredentialsReport {
    artifact: String,
    manifest: String,
    soft_binding: String,
    test_certificate: bool,
    job: Option<String>,
}

impl From<&Credentials> for CredentialsReport {
    fn from(credentials: &Credentials) -> Self {
        Self {
            artifact: credentials.artifact.clone(),
            manifest: credentials.manifest.clone(),
            soft_binding: credentials.soft_binding.clone(),
            test_certificate: credentials.test_certificate,
            job: some(&credentials.job),
        }
    }
}

impl CredentialsReport {
    /// For people, on a line of its own.
    pub fn line(&self) -> String {
        let test = match self.test_certificate {
            true => ", signed with a test certificate that nobody trusts",
            false => "",
        };
        format!(
            "\ncredentials: {}, manifest {}{test}",
            printable(&self.artifact),
            printable(&self.manifest)
        )
    }
}
