//! A small HTTP/1.1 client: a connection for each request, to nobody but who was named. It follows no redirects, asks no
//! proxy and keeps nothing.
use std::io;
use std::sync::Arc;
use std::time::Duration;

use http_body_util::BodyExt;
use hyper::body::{Body, Bytes, Incoming};
use hyper::client::conn::http1::{self, SendRequest};
use hyper::header::{HOST, HeaderValue, USER_AGENT};
use hyper::{Request, StatusCode, Uri};
use hyper_util::rt::TokioIo;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio::task::JoinSet;
use tokio::time::timeout;
use tokio_rustls::TlsConnector;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::ServerName;
use tokio_rustls::rustls::{self, ClientConfig, RootCertStore};

use crate::error::root_cause;

/// Why a request has no answer. None of these says the address, which may be a secret.
#[derive(Debug, thiserror::Error)]
pub enum HttpError {
    /// The address is none that can be asked.
    #[error("is no http or https URL with a host")]
    Address,
    /// No connection, or none any more.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// TLS can't be spoken.
    #[error("{0}")]
    Tls(#[from] rustls::Error),
    /// The other side does not speak HTTP, or stopped.
    #[error("{}", root_cause(.0))]
    Http(#[from] hyper::Error),
    /// Nothing was heard for so long.
    #[error("the store was silent for {} s", .0.as_secs())]
    Silent(Duration),
}

/// A connection, for one request.
pub struct Connection<B> {
    sender: SendRequest<B>,
    // Ends with the connection.
    driver: JoinSet<hyper::Result<()>>,
}

/// An answer whose body is still arriving.
pub struct Answer {
    status: StatusCode,
    body: Incoming,
    _driver: JoinSet<hyper::Result<()>>,
}

impl<B> Connection<B>
where
    B: Body<Data = Bytes> + Send + 'static,
    B::Error: Into<Box<dyn std::error::Error + Send + Sync>>,
{
    /// Connects to the host of `uri`, with TLS for https, within `limit`.
    ///
    /// # Errors
    /// That nobody is there, or not whom the address names.
    pub async fn open(uri: &Uri, limit: Duration) -> Result<Self, HttpError> {
        let opened = timeout(limit, Self::connect(uri)).await;
        opened.unwrap_or(Err(HttpError::Silent(limit)))
    }

    async fn connect(uri: &Uri) -> Result<Self, HttpError> {
        let (secure, default_port) = match uri.scheme_str() {
            Some("https") => (true, 443),
            Some("http") => (false, 80),
            _ => return Err(HttpError::Address),
        };
        let host = uri.host().ok_or(HttpError::Address)?;
        let host = host.trim_start_matches('[').trim_end_matches(']').to_owned();
        let stream = TcpStream::connect((host.as_str(), uri.port_u16().unwrap_or(default_port))).await?;
        stream.set_nodelay(true)?;
        if !secure {
            return Self::over(stream).await;
        }
        let name = ServerName::try_from(host).map_err(|_| HttpError::Address)?;
        Self::over(tls()?.connect(name, stream).await?).await
    }

    async fn over(stream: impl AsyncRead + AsyncWrite + Send + Unpin + 'static) -> Result<Self, HttpError> {
        let (sender, connection) = http1::handshake(TokioIo::new(stream)).await?;
        let mut driver = JoinSet::new();
        driver.spawn(connection);
        Ok(Self { sender, driver })
    }

    /// Sends a request, which has a whole URI; waits for the head of the answer without limit.
    ///
    /// # Errors
    /// That the connection broke.
    pub async fn send(mut self, mut request: Request<B>) -> Result<Answer, HttpError> {
        let authority = request.uri().authority().ok_or(HttpError::Address)?.as_str();
        let host = authority.rsplit('@').next().unwrap_or(authority);
        let host = HeaderValue::from_str(host).map_err(|_| HttpError::Address)?;
        let path = request.uri().path_and_query().cloned().ok_or(HttpError::Address)?;
        *request.uri_mut() = path.into();
        let headers = request.headers_mut();
        headers.entry(HOST).or_insert(host);
        let agent = HeaderValue::from_static(concat!("guardsplat/", env!("CARGO_PKG_VERSION")));
        headers.entry(USER_AGENT).or_insert(agent);
        let (head, body) = self.sender.send_request(request).await?.into_parts();
        Ok(Answer {
            status: head.status,
            body,
            _driver: self.driver,
        })
    }
}

impl Answer {
    /// What it says of itself.
    pub fn status(&self) -> StatusCode {
        self.status
    }

    /// Bytes of its body that are still to come, where it says so.
    pub fn length(&self) -> Option<u64> {
        self.body.size_hint().exact()
    }

    /// The next bytes, or nothing at the end; they must come within `limit`.
    ///
    /// # Errors
    /// That they did not.
    pub async fn chunk(&mut self, limit: Duration) -> Result<Option<Bytes>, HttpError> {
        loop {
            let frame = timeout(limit, self.body.frame()).await;
            let Some(frame) = frame.map_err(|_| HttpError::Silent(limit))? else {
                return Ok(None);
            };
            // What is no data are trailers, which say nothing here.
            if let Ok(data) = frame?.into_data() {
                return Ok(Some(data));
            }
        }
    }
}

fn tls() -> Result<TlsConnector, rustls::Error> {
    let mut roots = RootCertStore::from_iter(webpki_roots::TLS_SERVER_ROOTS.iter().cloned());
    // A store of one's own may have an authority that only this machine trusts. What can't be read is not trusted.
    roots.add_parsable_certificates(rustls_native_certs::load_native_certs().certs);
    let config = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()?
        .with_root_certificates(roots)
        .with_no_client_auth();
    Ok(TlsConnector::from(Arc::new(config)))
}
