//! How a program reaches a server: its address, TLS, and the token that it shows. One for client and worker.
use std::fmt;
use std::path::{Path, PathBuf};

use tonic::metadata::{Ascii, MetadataValue};
use tonic::service::Interceptor;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::{self, Certificate, ClientTlsConfig, Endpoint, Identity, Uri};
use tonic::{Request, Status};

/// The variable that a token is taken from.
pub const TOKEN_VARIABLE: &str = "GUARDSPLAT_TOKEN";

/// A channel whose calls show the token.
pub type Channel = InterceptedService<transport::Channel, Credentials>;

/// Why a server can't be called as was asked.
#[derive(Debug, thiserror::Error)]
pub enum ConnectError {
    /// The address is none.
    #[error("{url:?} {reason}")]
    Address {
        /// The address.
        url: String,
        /// What is wrong with it.
        reason: String,
    },
    /// What is for TLS, and an address without it.
    #[error("{url:?} is without TLS, and {what} is for TLS: begin the address with https://")]
    Plain {
        /// The address.
        url: String,
        /// What was given.
        what: &'static str,
    },
    /// A certificate without its key, or a key without its certificate.
    #[error("a certificate and its key belong together, and one of them is missing")]
    HalfAnIdentity,
    /// A file can't be read.
    #[error("{}: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// A token that is none.
    #[error("{place} holds no token: one line of letters, digits and underscores was expected")]
    NoToken {
        /// Where it was taken from.
        place: String,
    },
    /// Certificates or a key that can't be used.
    #[error("TLS can't be set up: {0}")]
    Tls(String),
}

/// A token, for the header of calls. It shows nothing of itself.
#[derive(Clone)]
pub struct Token(MetadataValue<Ascii>);

impl Token {
    /// From a text; `place` says where that is from, for the error. Spaces around it do not matter.
    ///
    /// # Errors
    /// [`ConnectError::NoToken`].
    pub fn new(text: &str, place: &str) -> Result<Self, ConnectError> {
        let text = text.trim();
        let plain = !text.is_empty() && text.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_');
        let header = MetadataValue::try_from(format!("Bearer {text}")).ok().filter(|_| plain);
        let mut header = header.ok_or_else(|| ConnectError::NoToken {
            place: place.to_owned(),
        })?;
        // Neither debug output nor the compression of headers sees it.
        header.set_sensitive(true);
        Ok(Self(header))
    }

    /// From the environment, else from a file; none where neither has one.
    ///
    /// # Errors
    /// [`ConnectError::Unreadable`], [`ConnectError::NoToken`].
    pub fn find(variable: Option<&str>, file: Option<&Path>) -> Result<Option<Self>, ConnectError> {
        // An empty variable is how one is unset in many places.
        if let Some(text) = variable.filter(|text| !text.trim().is_empty()) {
            return Self::new(text, TOKEN_VARIABLE).map(Some);
        }
        let Some(path) = file else { return Ok(None) };
        let text = String::from_utf8(read(path)?).unwrap_or_default();
        Self::new(&text, &path.display().to_string()).map(Some)
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token")
    }
}

/// Puts the token into the metadata of calls.
#[derive(Clone, Debug, Default)]
pub struct Credentials {
    token: Option<Token>,
}

impl Interceptor for Credentials {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        if let Some(Token(header)) = &self.token {
            request.metadata_mut().insert("authorization", header.clone());
        }
        Ok(request)
    }
}

/// A server, and how it is to be reached.
#[derive(Clone, Debug, Default)]
pub struct Target {
    /// Its address, as `http://HOST:PORT`, or `https://HOST:PORT` with TLS.
    pub url: String,
    /// File of the certificates (PEM) that the server's is checked with; without one, those of public authorities.
    pub ca: Option<PathBuf>,
    /// File of the certificate (PEM) to show, where the server asks for one.
    pub certificate: Option<PathBuf>,
    /// File of its key (PEM).
    pub certificate_key: Option<PathBuf>,
    /// The token to show.
    pub token: Option<Token>,
}

impl Target {
    /// The server, with its certificates read; nothing is sent. Time limits are for the caller to set.
    ///
    /// # Errors
    /// All but [`ConnectError::NoToken`].
    pub fn endpoint(&self) -> Result<Endpoint, ConnectError> {
        let bad = |reason: String| ConnectError::Address {
            url: self.url.clone(),
            reason,
        };
        let uri: Uri = self
            .url
            .parse()
            .map_err(|error| bad(format!("is no address such as http://127.0.0.1:50051 ({error})")))?;
        let tls = match uri.scheme_str() {
            Some("http") => false,
            Some("https") => true,
            _ => return Err(bad("must begin with http:// or https://".into())),
        };
        if uri.host().is_none_or(str::is_empty) {
            return Err(bad("must name a host".into()));
        }
        let endpoint = Endpoint::from(uri);
        if tls {
            return endpoint.tls_config(self.tls()?).map_err(|error| {
                let cause = std::error::Error::source(&error).map(ToString::to_string);
                ConnectError::Tls(cause.unwrap_or_else(|| error.to_string()))
            });
        }
        for (what, given) in [
            ("a CA", &self.ca),
            ("a certificate", &self.certificate),
            ("a key", &self.certificate_key),
        ] {
            if given.is_some() {
                return Err(ConnectError::Plain {
                    url: self.url.clone(),
                    what,
                });
            }
        }
        Ok(endpoint)
    }

    fn tls(&self) -> Result<ClientTlsConfig, ConnectError> {
        let mut tls = match &self.ca {
            Some(path) => ClientTlsConfig::new().ca_certificate(Certificate::from_pem(read(path)?)),
            None => ClientTlsConfig::new().with_webpki_roots(),
        };
        match (&self.certificate, &self.certificate_key) {
            (Some(certificate), Some(key)) => tls = tls.identity(Identity::from_pem(read(certificate)?, read(key)?)),
            (None, None) => {}
            _ => return Err(ConnectError::HalfAnIdentity),
        }
        Ok(tls)
    }

    /// A channel of the endpoint, whose calls show the token.
    pub fn authorised(&self, channel: transport::Channel) -> Channel {
        let token = self.token.clone();
        InterceptedService::new(channel, Credentials { token })
    }
}

fn read(path: &Path) -> Result<Vec<u8>, ConnectError> {
    std::fs::read(path).map_err(|source| ConnectError::Unreadable {
        path: path.to_owned(),
        source,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(target: Target) -> String {
        target.endpoint().unwrap_err().to_string()
    }

    fn at(url: &str) -> Target {
        Target {
            url: url.into(),
            ..Target::default()
        }
    }

    #[test]
    fn addresses_are_checked() {
        for good in ["http://127.0.0.1:50051", "https://example.org", "http://[::1]:7/"] {
            at(good).endpoint().unwrap();
        }
        for bad in ["127.0.0.1:50051", "ftp://h:1", "http://", "", "http://a b", "h:1"] {
            let text = refused(at(bad));
            assert!(text.starts_with(&format!("{bad:?} ")), "{text}");
        }
    }

    #[test]
    fn what_is_for_tls_needs_it() {
        let ca = Some(PathBuf::from("/nowhere/ca.pem"));
        let plain = Target {
            ca: ca.clone(),
            ..at("http://h:1")
        };
        assert!(refused(plain).contains("a CA is for TLS"));
        let missing = Target {
            ca,
            ..at("https://h:1")
        };
        assert!(refused(missing).starts_with("/nowhere/ca.pem: "));
        let half = Target {
            certificate: Some("c.pem".into()),
            ..at("https://h:1")
        };
        assert!(refused(half).contains("belong together"));
    }

    #[test]
    fn tokens_are_found_and_never_shown() {
        let token = Token::new(" gst_0_5ec2e7\n", "here").unwrap();
        assert_eq!(token.0.to_str().unwrap(), "Bearer gst_0_5ec2e7");
        let target = Target {
            token: Some(token),
            ..at("http://h:1")
        };
        assert!(!format!("{target:?} {:?}", target.token.as_ref().unwrap().0).contains("5ec2e7"));
        for bad in ["", " ", "a b", "a\nb", "gst_é", "a\u{7f}"] {
            let text = Token::new(bad, "the file").unwrap_err().to_string();
            assert!(text.starts_with("the file holds no token"), "{bad:?}: {text}");
        }
        assert!(Token::find(Some(" "), None).unwrap().is_none());
        let nowhere = Some(Path::new("/nowhere/token"));
        assert!(Token::find(Some("gst_1_2"), nowhere).unwrap().is_some());
        let text = Token::find(None, nowhere).unwrap_err().to_string();
        assert!(text.starts_with("/nowhere/token: "), "{text}");
    }
}
