//! TLS of the listener, and certificates of clients (mTLS), by rustls.
use std::path::Path;
use std::sync::Arc;

use rustls::crypto::ring;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::server::WebPkiClientVerifier;
use rustls::{RootCertStore, ServerConfig};

use crate::error::{Error, Result};
use crate::settings::Settings;

/// What HTTP/2 and HTTP/1.1 are called when a protocol is agreed on.
const HTTP2: &[u8] = b"h2";
const HTTP1: &[u8] = b"http/1.1";

type Failure = Box<dyn std::error::Error + Send + Sync>;

/// What the listener needs for TLS, as the settings have it; none where they have no certificate. Files are read once,
/// at the start.
pub fn load(settings: &Settings) -> Result<Option<Arc<ServerConfig>>> {
    let (Some(certificate), Some(key)) = (&settings.tls_certificate, &settings.tls_key) else {
        // That one is there without the other was refused with the settings.
        return Ok(None);
    };
    let certificates = read("tls_certificate", certificate)?;
    let private = read("tls_key", key)?;
    let clients = settings.tls_client_ca.as_deref();
    let clients = clients.map(|path| read("tls_client_ca", path)).transpose()?;
    let config = config(&certificates, &private, clients.as_deref()).map_err(|cause| {
        Error::Startup(format!(
            "TLS can't be set up with tls_certificate {} and tls_key {}: {cause}",
            certificate.display(),
            key.display()
        ))
    })?;
    Ok(Some(Arc::new(config)))
}

/// The same for browsers, who are told that HTTP/1.1 is spoken.
pub fn for_page(config: &ServerConfig) -> Arc<ServerConfig> {
    let mut config = config.clone();
    config.alpn_protocols = vec![HTTP1.to_vec()];
    Arc::new(config)
}

fn config(certificates: &[u8], private: &[u8], clients: Option<&[u8]>) -> Result<ServerConfig, Failure> {
    let provider = Arc::new(ring::default_provider());
    let chain = CertificateDer::pem_slice_iter(certificates).collect::<Result<Vec<_>, _>>()?;
    let private = PrivateKeyDer::from_pem_slice(private)?;
    let builder = ServerConfig::builder_with_provider(provider.clone()).with_safe_default_protocol_versions()?;
    let builder = match clients {
        None => builder.with_no_client_auth(),
        Some(clients) => {
            let mut roots = RootCertStore::empty();
            for root in CertificateDer::pem_slice_iter(clients) {
                roots.add(root?)?;
            }
            let verifier = WebPkiClientVerifier::builder_with_provider(Arc::new(roots), provider).build()?;
            builder.with_client_cert_verifier(verifier)
        }
    };
    let mut config = builder.with_single_cert(chain, private)?;
    config.alpn_protocols.push(HTTP2.to_vec());
    Ok(config)
}

fn read(setting: &str, path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).map_err(|error| Error::Startup(format!("{setting} {}: {error}", path.display())))
}
