//! TLS of the listener, and certificates of clients (mTLS), by rustls.
use std::path::Path;

use tonic::transport::{Certificate, Identity, Server, ServerTlsConfig};

use crate::error::{Error, Result};
use crate::settings::Settings;

/// What the listener needs for TLS, as the settings have it; none where they have no certificate. Files are read once,
/// at the start.
pub fn load(settings: &Settings) -> Result<Option<ServerTlsConfig>> {
    let (Some(certificate), Some(key)) = (&settings.tls_certificate, &settings.tls_key) else {
        // That one is there without the other was refused with the settings.
        return Ok(None);
    };
    let identity = Identity::from_pem(read("tls_certificate", certificate)?, read("tls_key", key)?);
    let mut tls = ServerTlsConfig::new().identity(identity);
    if let Some(ca) = &settings.tls_client_ca {
        tls = tls.client_ca_root(Certificate::from_pem(read("tls_client_ca", ca)?));
    }
    // Set up once for nothing, so that files that are no certificates are told at the start.
    Server::builder().tls_config(tls.clone()).map_err(|error| {
        let cause = std::error::Error::source(&error).map_or_else(|| error.to_string(), ToString::to_string);
        Error::Startup(format!(
            "TLS can't be set up with tls_certificate {} and tls_key {}: {cause}",
            certificate.display(),
            key.display()
        ))
    })?;
    Ok(Some(tls))
}

fn read(setting: &str, path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).map_err(|error| Error::Startup(format!("{setting} {}: {error}", path.display())))
}
