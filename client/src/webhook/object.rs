//! Fetches an object by HTTP into a file: what a store's own URL, or a proxy that signs for it, gives to a plain GET.
use std::io::Write;
use std::time::Duration;

use http_body_util::Empty;
use hyper::body::Bytes;
use hyper::{Request, StatusCode, Uri};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use tempfile::TempDir;
use tokio::time::timeout;

use crate::error::{Error, Result};
use crate::http_client::{Connection, HttpError};

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
        let folder = tempfile::tempdir().map_err(Error::io(std::env::temp_dir()))?;
        let fetched = Fetched {
            folder,
            name: parts.last().copied().unwrap_or("object").to_owned(),
        };
        receive(&uri, &fetched, patience).await.map_err(failed)?;
        Ok(fetched)
    }
}

async fn receive(uri: &Uri, to: &Fetched, patience: Duration) -> Result<(), String> {
    let told = |error: HttpError| error.to_string();
    let request = Request::get(uri).body(Empty::<Bytes>::new());
    let request = request.map_err(|error| error.to_string())?;
    let connection = Connection::open(uri, patience).await.map_err(told)?;
    let answer = timeout(patience, connection.send(request)).await;
    let mut answer = answer.unwrap_or(Err(HttpError::Silent(patience))).map_err(told)?;
    if answer.status() != StatusCode::OK {
        return Err(format!("the store answered {}", answer.status()));
    }
    let path = to.path();
    let mut file = std::fs::File::create(&path).map_err(|error| error.to_string())?;
    let mut length = 0;
    while let Some(data) = answer.chunk(patience).await.map_err(told)? {
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
