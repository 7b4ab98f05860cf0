//! Sends one message to one URL: to an address that was looked at, in a bounded time, and without following anybody
//! elsewhere.
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;

use futures::future::BoxFuture;
use http_body_util::Full;
use hyper::Request;
use hyper::body::Bytes;
use hyper::client::conn::http1;
use hyper_util::rt::TokioIo;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio::task::JoinSet;
use tokio::time::timeout;
use tokio_rustls::TlsConnector;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::PemObject;
use tokio_rustls::rustls::pki_types::{CertificateDer, ServerName};
use tokio_rustls::rustls::{ClientConfig, RootCertStore};
use url::{Host, Position, Url};

use super::address::{Reach, reach};
use super::{Rules, check_url};

/// How long a message may take, from the name to the answer.
const LONGEST: Duration = Duration::from_secs(15);
/// How long one address may take to be connected to.
const CONNECT: Duration = Duration::from_secs(5);
/// Addresses of a name that are tried.
const ADDRESSES: usize = 4;
/// Most bytes of the head of an answer; its body is not read.
const MAX_HEAD: usize = 16 << 10;

/// Why a message did not arrive, or was not acknowledged.
#[derive(Debug, thiserror::Error)]
pub enum PostError {
    /// The URL is none that may be called.
    #[error("the URL {0}")]
    Url(String),
    /// The name leads nowhere.
    #[error("the name of the host could not be looked up: {0}")]
    NoAddress(String),
    /// It leads where nobody may be led. What names of its network the server can look up is nobody's business, so the
    /// text does not have the address.
    #[error("the host has an address that {}", why(*.reach))]
    Refused {
        /// Where it leads.
        address: IpAddr,
        /// Who is there.
        reach: Reach,
    },
    /// Nobody is there.
    #[error("no connection to {address}: {reason}")]
    Connect {
        /// Where.
        address: SocketAddr,
        /// Why.
        reason: String,
    },
    /// Whoever is there is somebody else.
    #[error("no TLS with the host: {0}")]
    Tls(String),
    /// The conversation broke off.
    #[error("the request failed: {0}")]
    Http(String),
    /// It was answered, and not acknowledged.
    #[error("answered {status}{}", if (300..400).contains(status) { ", and redirects are not followed" } else { "" })]
    Status {
        /// With what.
        status: u16,
    },
    /// Nothing was answered in time.
    #[error("no answer within {} s", LONGEST.as_secs())]
    TooSlow,
}

fn why(reach: Reach) -> &'static str {
    match reach {
        Reach::Never => "nobody can be at",
        Reach::Private | Reach::Public => "is not public; this server does not allow that (hook_allow_private)",
    }
}

type Lookup = Arc<dyn Fn(String, u16) -> BoxFuture<'static, io::Result<Vec<SocketAddr>>> + Send + Sync>;

/// Sends messages.
#[derive(Clone)]
pub struct Poster {
    rules: Rules,
    tls: TlsConnector,
    lookup: Lookup,
}

impl Poster {
    /// One that believes public authorities, or those in `ca` (PEM) instead.
    ///
    /// # Errors
    /// A text that says what is wrong with the certificates.
    pub fn new(rules: Rules, ca: Option<&[u8]>) -> Result<Self, String> {
        let mut roots = RootCertStore::empty();
        match ca {
            None => roots.extend(webpki_roots::TLS_SERVER_ROOTS.iter().cloned()),
            Some(pem) => {
                for certificate in CertificateDer::pem_slice_iter(pem) {
                    let certificate = certificate.map_err(|error| error.to_string())?;
                    roots.add(certificate).map_err(|error| error.to_string())?;
                }
                if roots.is_empty() {
                    return Err("holds no certificate".into());
                }
            }
        }
        let config = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()))
            .with_safe_default_protocol_versions()
            .map_err(|error| error.to_string())?;
        let mut config = config.with_root_certificates(roots).with_no_client_auth();
        config.alpn_protocols = vec![b"http/1.1".to_vec()];
        Ok(Self {
            rules,
            tls: TlsConnector::from(Arc::new(config)),
            lookup: Arc::new(|host, port| {
                Box::pin(async move { Ok(tokio::net::lookup_host((host, port)).await?.collect()) })
            }),
        })
    }

    /// One that finds addresses in another way.
    #[cfg(test)]
    pub(crate) fn with_lookup(mut self, lookup: Lookup) -> Self {
        self.lookup = lookup;
        self
    }

    /// Sends a message, and returns when it is acknowledged (200 to 299).
    ///
    /// # Errors
    /// Whatever kept it from being acknowledged.
    pub async fn post(&self, url: &str, headers: &[(&str, String)], body: Vec<u8>) -> Result<(), PostError> {
        let sent = timeout(LONGEST, self.converse(url, headers, body)).await;
        sent.map_err(|_| PostError::TooSlow)?
    }

    async fn converse(&self, url: &str, headers: &[(&str, String)], body: Vec<u8>) -> Result<(), PostError> {
        // What was allowed when it was registered may not be any more.
        let url = check_url(&self.rules, url).map_err(PostError::Url)?;
        let stream = self.connect(&url).await?;
        // The path and the query, and nothing of the rest.
        let mut request = Request::post(&url[Position::BeforePath..Position::AfterQuery])
            .header("host", &url[Position::BeforeHost..Position::AfterPort])
            .header("user-agent", concat!("guardsplat-server/", env!("CARGO_PKG_VERSION")));
        for (name, value) in headers {
            request = request.header(*name, value);
        }
        let request = request
            .body(Full::new(Bytes::from(body)))
            .map_err(|error| PostError::Http(error.to_string()))?;
        if url.scheme() == "http" {
            return exchange(stream, request).await;
        }
        let host = url.host_str().unwrap_or_default();
        let host = host.trim_start_matches('[').trim_end_matches(']').to_owned();
        let name = ServerName::try_from(host).map_err(|error| PostError::Tls(error.to_string()))?;
        let stream = self.tls.connect(name, stream).await;
        exchange(stream.map_err(|error| PostError::Tls(error.to_string()))?, request).await
    }

    /// A connection to one of the host's addresses. All of them are looked at first; the name is not looked up again, so
    /// that it can't lead elsewhere meanwhile.
    async fn connect(&self, url: &Url) -> Result<TcpStream, PostError> {
        let port = url.port_or_known_default().unwrap_or(443);
        let addresses = match url.host() {
            Some(Host::Ipv4(address)) => vec![SocketAddr::from((address, port))],
            Some(Host::Ipv6(address)) => vec![SocketAddr::from((address, port))],
            Some(Host::Domain(name)) => (self.lookup)(name.to_owned(), port)
                .await
                .map_err(|error| PostError::NoAddress(error.to_string()))?,
            None => Vec::new(),
        };
        for address in &addresses {
            let reach = reach(address.ip());
            let allowed = match reach {
                Reach::Public => true,
                Reach::Private => self.rules.allow_private,
                Reach::Never => false,
            };
            if !allowed {
                return Err(PostError::Refused {
                    address: address.ip(),
                    reach,
                });
            }
        }
        let mut failed = PostError::NoAddress("it has no address".into());
        for address in addresses.into_iter().take(ADDRESSES) {
            let reason = match timeout(CONNECT, TcpStream::connect(address)).await {
                Ok(Ok(stream)) => return Ok(stream),
                Ok(Err(error)) => error.to_string(),
                Err(_) => format!("nothing was answered within {} s", CONNECT.as_secs()),
            };
            failed = PostError::Connect { address, reason };
        }
        Err(failed)
    }
}

/// One request on a connection, which is closed when its answer has begun.
async fn exchange<S>(stream: S, request: Request<Full<Bytes>>) -> Result<(), PostError>
where
    S: AsyncRead + AsyncWrite + Send + Unpin + 'static,
{
    let failed = |error: hyper::Error| PostError::Http(error.to_string());
    let mut builder = http1::Builder::new();
    builder.max_buf_size(MAX_HEAD);
    let (mut sender, connection) = builder.handshake(TokioIo::new(stream)).await.map_err(failed)?;
    // Ends with this call.
    let mut driver = JoinSet::new();
    driver.spawn(connection);
    let answer = sender.send_request(request).await.map_err(failed)?;
    match answer.status().as_u16() {
        200..=299 => Ok(()),
        status => Err(PostError::Status { status }),
    }
}
