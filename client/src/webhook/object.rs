//! Fetches an object by HTTP into a file: what a store's own URL, or a proxy that signs for it, gives to a plain GET.
use std::io::Write;
use std::sync::Arc;
use std::time::Duration;

use http_body_util::{BodyExt, Empty};
use hyper::body::Bytes;
use hyper::client::conn::http1;
use hyper::{Request, StatusCode, Uri};
use hyper_util::rt::TokioIo;
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use tempfile::TempDir;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio::task::JoinSet;
use tokio::time::timeout;
use tokio_rustls::TlsConnector;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::ServerName;
use tokio_rustls::rustls::{ClientConfig, RootCertStore};

use crate::error::{Error, Result, root_cause};

/// Most bytes of an object, as many as a server takes unless it is told otherwise.
const MOST: u64 = 4 << 30;
/// What of a key stands in a URL as it is.
const KEPT: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~');

/// Where objects are, by their keys.
#[derive(Clone, Debug)]
pub struct Prefix(Uri);

/// An object that was fetched; it goes with this.
pub struct Fetched {
    folder: TempDir,
    name: String,
}

impl Fetched {
    /// Where it is.
    pub fn path(&self) -> std::path::PathBuf {
        self.folder.path().join(&self.name)
    }
}

impl Prefix {
    /// Reads a URL such as `http://store:9000/uploads/`.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(text: &str) -> Result<Self, String> {
        let uri: Uri = text.parse().map_err(|error| format!("is no URL: {error}"))?;
        if !matches!(uri.scheme_str(), Some("http" | "https")) || uri.host().is_none_or(str::is_empty) {
            return Err("must begin with http:// or https:// and a host".into());
        }
        if !uri.path().ends_with('/') || uri.query().is_some() {
            return Err("must end with /, as keys are put behind it".into());
        }
        Ok(Self(uri))
    }

    /// Fetches the object whose key has these parts. `patience` is how long the store may be silent.
    ///
    /// # Errors
    /// That it did not arrive, or is too long.
    pub async fn fetch(&self, parts: &[&str], patience: Duration) -> Result<Fetched> {
        let encoded: Vec<String> = parts
            .iter()
            .map(|part| utf8_percent_encode(part, KEPT).to_string())
            .collect();
        let url = format!("{}{}", self.0, encoded.join("/"));
        let failed = |reason: String| Error::Object {
            url: url.clone(),
            reason,
        };
        let uri: Uri = url.parse().map_err(|_| failed("is no URL".into()))?;
        let (secure, host) = (uri.scheme_str() == Some("https"), uri.host().unwrap_or_default());
        let host = host.trim_start_matches('[').trim_end_matches(']').to_owned();
        let port = uri.port_u16().unwrap_or(if secure { 443 } else { 80 });
        let silent = |_| failed(format!("the store was silent for {} s", patience.as_secs()));
        let stream = timeout(patience, TcpStream::connect((host.as_str(), port)))
            .await
            .map_err(silent)?;
        let stream = stream.map_err(|error| failed(error.to_string()))?;
        let request = Request::get(uri.path())
            .header("host", uri.authority().map_or("", |authority| authority.as_str()))
            .header("user-agent", concat!("guardsplat/", env!("CARGO_PKG_VERSION")))
            .body(Empty::<Bytes>::new())
            .map_err(|error| failed(error.to_string()))?;
        let folder = tempfile::tempdir().map_err(Error::io(std::env::temp_dir()))?;
        let fetched = Fetched {
            folder,
            name: parts.last().copied().unwrap_or("object").to_owned(),
        };
        let moved = if secure {
            let name = ServerName::try_from(host).map_err(|error| failed(error.to_string()))?;
            let stream = timeout(patience, tls().map_err(failed)?.connect(name, stream))
                .await
                .map_err(silent)?;
            let stream = stream.map_err(|error| failed(error.to_string()))?;
            receive(stream, request, &fetched, patience).await
        } else {
            receive(stream, request, &fetched, patience).await
        };
        moved.map_err(failed)?;
        Ok(fetched)
    }
}

fn tls() -> Result<TlsConnector, String> {
    let roots = RootCertStore::from_iter(webpki_roots::TLS_SERVER_ROOTS.iter().cloned());
    let config = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .map_err(|error| error.to_string())?;
    Ok(TlsConnector::from(Arc::new(
        config.with_root_certificates(roots).with_no_client_auth(),
    )))
}

async fn receive<S>(stream: S, request: Request<Empty<Bytes>>, to: &Fetched, patience: Duration) -> Result<(), String>
where
    S: AsyncRead + AsyncWrite + Send + Unpin + 'static,
{
    let told = |error: hyper::Error| root_cause(&error);
    let silent = |_| format!("the store was silent for {} s", patience.as_secs());
    let (mut sender, connection) = http1::handshake(TokioIo::new(stream)).await.map_err(told)?;
    // Ends with this call.
    let mut driver = JoinSet::new();
    driver.spawn(connection);
    let answer = timeout(patience, sender.send_request(request)).await.map_err(silent)?;
    let answer = answer.map_err(told)?;
    if answer.status() != StatusCode::OK {
        return Err(format!("the store answered {}", answer.status()));
    }
    let path = to.path();
    let mut file = std::fs::File::create(&path).map_err(|error| error.to_string())?;
    let mut body = answer.into_body();
    let mut length = 0;
    while let Some(frame) = timeout(patience, body.frame()).await.map_err(silent)? {
        let Ok(data) = frame.map_err(told)?.into_data() else {
            continue;
        };
        length += data.len() as u64;
        if length > MOST {
            return Err(format!("is longer than {MOST} bytes"));
        }
        file.write_all(&data).map_err(|error| error.to_string())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prefix_is_a_folder_on_a_host() {
        for good in [
            "http://store:9000/uploads/",
            "https://uploads.store.example/",
            "http://[::1]:9000/a/b/",
        ] {
            Prefix::parse(good).unwrap();
        }
        for wrong in [
            "",
            "/uploads/",
            "store:9000/",
            "ftp://h/",
            "http://h/uploads",
            "http://h/?a/",
            "http:///a/",
        ] {
            assert!(Prefix::parse(wrong).is_err(), "{wrong}");
        }
    }
}
