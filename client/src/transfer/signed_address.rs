//! Addresses of a store that a server signed: which of them may be asked, and how they are connected to.
use std::time::Duration;

use hyper::Uri;
use hyper::body::{Body, Bytes};

use crate::http_client::{Connection, HttpError};

/// Longest wait for a connection to the store, which may be out of reach from here.
const CONNECT: Duration = Duration::from_secs(5);

/// Whether the way to an address is as safe as the one to the server.
pub fn is_as_safe(server: &str, url: &str) -> bool {
    url.starts_with("https://") || url.starts_with("http://") && server.starts_with("http://")
}

/// Connects to the store at an address, within `limit` at most.
///
/// # Errors
/// That it is out of reach.
pub async fn connect<B>(uri: &Uri, limit: Duration) -> Result<Connection<B>, HttpError>
where
    B: Body<Data = Bytes> + Send + 'static,
    B::Error: Into<Box<dyn std::error::Error + Send + Sync>>,
{
    Connection::open(uri, CONNECT.min(limit)).await
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_way_is_less_safe_than_the_one_to_the_server() {
        for (server, url, safe) in [
            ("https://splat", "https://store", true),
            ("https://splat", "http://store", false),
            ("http://splat", "https://store", true),
            ("http://splat", "http://store", true),
            ("http://splat", "file:///etc", false),
            ("http://splat", "", false),
        ] {
            assert_eq!(is_as_safe(server, url), safe, "{url} of {server}");
        }
    }
}
