//! The connection to the server.
use std::time::Duration;

use guardsplat_proto::connect::{Channel, ConnectError, Target};
use tokio::sync::OnceCell;
use tonic::transport::Endpoint;
use tonic::{Code, Status};

use crate::error::{Error, Result, root_cause};
use crate::settings::Settings;

/// Longest wait for the first connection.
const CONNECT: Duration = Duration::from_secs(10);
/// Between signs of life on a connection that is in use, so that a vanished server is noticed.
const KEEP_ALIVE: Duration = Duration::from_secs(15);

/// A server, connected to when it is first needed.
pub struct Server {
    endpoint: Endpoint,
    target: Target,
    channel: OnceCell<Channel>,
    /// Its address.
    pub url: String,
    /// How long it is waited for.
    pub timeout: Duration,
}

impl Server {
    /// Checks the address, and reads certificates; nothing is sent.
    pub fn new(settings: &Settings) -> Result<Self> {
        let target = settings.target.clone();
        let endpoint = target.endpoint().map_err(|error| Error::BadOption {
            field: field(&error),
            reason: error.to_string(),
        })?;
        let endpoint = endpoint
            .connect_timeout(CONNECT.min(settings.timeout))
            .http2_keep_alive_interval(KEEP_ALIVE)
            .keep_alive_timeout(KEEP_ALIVE)
            .tcp_nodelay(true);
        Ok(Self {
            endpoint,
            url: target.url.clone(),
            target,
            channel: OnceCell::new(),
            timeout: settings.timeout,
        })
    }

    /// The channel; it connects again by itself when the connection is lost.
    ///
    /// A server that is not there at first is told at once: waiting for it would only hide a wrong address.
    pub async fn channel(&self) -> Result<Channel> {
        let connect = async || {
            let channel = self.endpoint.connect().await.map_err(|e| Error::NoServer {
                url: self.url.clone(),
                reason: root_cause(&e),
            })?;
            Ok(self.target.authorised(channel))
        };
        self.channel.get_or_try_init(connect).await.cloned()
    }
}

/// The option that an error is about.
fn field(error: &ConnectError) -> &'static str {
    match error {
        ConnectError::Address { .. } | ConnectError::Plain { .. } => "--server",
        ConnectError::HalfAnIdentity => "--cert",
        ConnectError::Unreadable { .. } | ConnectError::Tls(_) => "--ca or --cert",
        ConnectError::NoToken { .. } => "--token-file",
    }
}

/// Whether a call failed because the server could not be reached any more, so that it may be sent again.
pub fn is_lost(status: &Status) -> bool {
    use std::error::Error;
    match status.code() {
        Code::Unavailable => true,
        // Of this side's own deadline: the server is there, but silent.
        Code::DeadlineExceeded => false,
        // What the transport below gRPC reports has a cause; what a server says has none.
        _ => status.source().is_some(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn server(url: &str) -> Result<Server> {
        Server::new(&Settings {
            target: Target {
                url: url.into(),
                ..Target::default()
            },
            timeout: Duration::from_secs(1),
        })
    }

    #[test]
    fn addresses_are_checked() {
        assert_eq!(server("http://h:1").unwrap().url, "http://h:1");
        server("https://h:1").unwrap();
        for wrong in ["h:1", "", "http://", "http://a b"] {
            let error = server(wrong).err().unwrap().to_string();
            assert!(error.contains("--server"), "{wrong}: {error}");
        }
    }

    #[test]
    fn only_a_lost_connection_is_worth_another_try() {
        assert!(is_lost(&Status::unavailable("")));
        assert!(is_lost(&Status::from_error(Box::new(std::io::Error::other("reset")))));
        assert!(!is_lost(&Status::deadline_exceeded("")));
        assert!(!is_lost(&Status::internal("a bug")));
        assert!(!is_lost(&Status::not_found("")));
    }
}
