//! The connection to the server: calls that are made again until they are answered.
use std::time::Duration;

use guardsplat_proto::connect::{Channel, ConnectError, Target};
use guardsplat_proto::v1::artifact_service_client::ArtifactServiceClient;
use guardsplat_proto::v1::worker_service_client::WorkerServiceClient;
use tonic::{Response, Status};

use super::backoff::Backoff;
use super::error::{Error, Result};

/// How long a connection may take to come about.
const CONNECT: Duration = Duration::from_secs(5);
/// A connection that is silent for so long is asked for a sign of life, and given up if none comes in as long.
const ALIVE: Duration = Duration::from_secs(10);

/// A server, connected to when it is needed and again when the connection is lost.
#[derive(Clone)]
pub struct Server {
    channel: Channel,
    encrypted: bool,
}

impl Server {
    /// The server at an address, with its certificates read; nothing is sent yet.
    ///
    /// # Errors
    /// [`Error::BadOption`] where that is no address, or certificates can't be used.
    pub fn new(target: &Target) -> Result<Self> {
        let endpoint = target.endpoint().map_err(|error| Error::BadOption {
            field: match error {
                ConnectError::Address { .. } | ConnectError::Plain { .. } => "--server",
                _ => "--ca, --cert or --cert-key",
            },
            reason: error.to_string(),
        })?;
        let channel = endpoint
            .connect_timeout(CONNECT)
            .tcp_nodelay(true)
            .http2_keep_alive_interval(ALIVE)
            .keep_alive_timeout(ALIVE)
            .keep_alive_while_idle(true)
            .connect_lazy();
        Ok(Self {
            channel: target.authorised(channel),
            encrypted: target.url.starts_with("https://"),
        })
    }

    /// Whether nobody on the way can read along.
    pub fn is_encrypted(&self) -> bool {
        self.encrypted
    }

    /// Calls of workers.
    pub fn worker(&self) -> WorkerServiceClient<Channel> {
        WorkerServiceClient::new(self.channel.clone())
    }

    /// Calls about artifacts.
    pub fn artifacts(&self) -> ArtifactServiceClient<Channel> {
        ArtifactServiceClient::new(self.channel.clone())
    }
}

/// The answer to a call that is to come within `limit`.
///
/// # Errors
/// What [`Error::of`] makes of the server's; [`Error::Unreachable`] when the time is up.
pub async fn within<T>(
    limit: Duration,
    call: &'static str,
    answer: impl Future<Output = Result<Response<T>, Status>>,
) -> Result<T> {
    match tokio::time::timeout(limit, answer).await {
        Ok(Ok(answer)) => Ok(answer.into_inner()),
        Ok(Err(status)) => Err(Error::of(call, &status)),
        Err(_) => Err(Error::Unreachable(format!("no answer within {} s", limit.as_secs()))),
    }
}

/// How often a server is asked again that is there and says that something is wrong with itself.
const WHILE_UNWELL: u32 = 5;

/// Does `work` again, waiting in between, for as long as the server can't be reached, and a few times when it is unwell.
///
/// # Errors
/// Whatever else `work` fails with.
pub async fn persist<T>(call: &'static str, mut work: impl AsyncFnMut() -> Result<T>) -> Result<T> {
    let mut backoff = Backoff::new();
    let mut unwell = 0;
    loop {
        let error = match work().await {
            Ok(answer) => return Ok(answer),
            Err(error) => error,
        };
        unwell += u32::from(error.is_unwell());
        let again = matches!(error, Error::Unreachable(_)) || error.is_unwell() && unwell <= WHILE_UNWELL;
        if !again {
            return Err(error);
        }
        let wait = backoff.next();
        tracing::warn!("could not {call}: {error}; trying again in {:.1} s", wait.as_secs_f64());
        tokio::time::sleep(wait).await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn addresses_are_checked() {
        let at = |url: &str| {
            Server::new(&Target {
                url: url.into(),
                ..Target::default()
            })
        };
        at("http://127.0.0.1:50051").unwrap();
        at("https://example.org").unwrap();
        for bad in ["127.0.0.1:50051", "http://", "", "http://a b"] {
            let error = at(bad).err().expect(bad).to_string();
            assert!(error.starts_with("--server: "), "{error}");
        }
    }

    #[tokio::test]
    async fn only_a_server_that_may_answer_later_is_asked_again() {
        let mut calls = 0;
        let answer = persist("try", async || {
            calls += 1;
            match calls {
                1 => Err(Error::Unreachable("down".into())),
                2 => Err(Error::of("try", &Status::internal("disk full"))),
                _ => Ok(calls),
            }
        });
        assert_eq!(answer.await.unwrap(), 3);
        let refused: Result<()> = persist("try", async || Err(Error::LeaseLost)).await;
        assert!(matches!(refused, Err(Error::LeaseLost)));
    }
}
