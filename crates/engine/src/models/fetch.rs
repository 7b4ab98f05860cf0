//! Copies a file from a path or an https URL, bounded and hashed on the way.
use super::{FileEntry, bad};
use crate::error::{Error, Result};
use sha2::{Digest, Sha256};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Where a model's files are.
pub(super) enum Source {
    /// The weights file on this machine.
    File(PathBuf),
    /// The weights file's URL.
    Url(String),
}

impl Source {
    /// Understands a path to the weights or their folder, or an https URL of the weights.
    pub fn parse(name: &str, source: &str) -> Result<Self> {
        if source.starts_with("https://") {
            return Ok(Self::Url(source.to_owned()));
        }
        if source.contains("://") {
            return Err(bad(name, format!("{source} is neither a path nor an https URL")));
        }
        let path = PathBuf::from(source);
        if path.is_dir() {
            crate::clip::weights_path(&path).map(Self::File)
        } else {
            Ok(Self::File(path))
        }
    }

    /// The file called `file` beside the weights. OpenCLIP's weights have `open_clip_config.json` beside them.
    pub fn beside(&self, file: &str) -> Self {
        let named = |weights: &str| match weights.starts_with("open_clip_") {
            true => file.replacen(
                "config.json",
                "open_clip_config.json",
                usize::from(file == "config.json"),
            ),
            false => file.to_owned(),
        };
        match self {
            Self::File(path) => {
                let weights = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
                Self::File(path.with_file_name(named(weights)))
            }
            Self::Url(url) => {
                let path = url.split(['?', '#']).next().unwrap_or(url);
                let (folder, weights) = path.rsplit_once('/').unwrap_or((path, ""));
                Self::Url(format!("{folder}/{}", named(weights)))
            }
        }
    }

    /// Copies it to `to`, at most `most` bytes. `None` when it does not exist.
    pub fn fetch(&self, name: &str, to: &Path, most: u64) -> Result<Option<FileEntry>> {
        match self {
            Self::File(path) => match std::fs::File::open(path) {
                Ok(file) => copy(name, file, to, most).map(Some),
                Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
                Err(error) => Err(Error::io(path)(error)),
            },
            Self::Url(url) => {
                let agent = ureq::Agent::config_builder()
                    .https_only(true)
                    .timeout_connect(Some(Duration::from_secs(30)))
                    .timeout_recv_response(Some(Duration::from_secs(60)))
                    .build()
                    .new_agent();
                match agent.get(url).call() {
                    Ok(response) => {
                        let body = response.into_body().into_with_config().limit(u64::MAX).reader();
                        copy(name, body, to, most).map(Some)
                    }
                    Err(ureq::Error::StatusCode(404)) => Ok(None),
                    Err(error) => Err(bad(name, format!("{url}: {error}"))),
                }
            }
        }
    }
}

impl std::fmt::Display for Source {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::File(path) => path.display().fmt(f),
            Self::Url(url) => f.write_str(url),
        }
    }
}

fn copy(name: &str, from: impl Read, to: &Path, most: u64) -> Result<FileEntry> {
    let mut from = from.take(most.saturating_add(1));
    let mut file = std::fs::File::create_new(to).map_err(Error::io(to))?;
    let (mut hasher, mut bytes, mut buffer) = (Sha256::new(), 0, vec![0; 1 << 16]);
    loop {
        let n = from
            .read(&mut buffer)
            .map_err(|e| bad(name, format!("reading stopped after {bytes} bytes: {e}")))?;
        if n == 0 {
            break;
        }
        bytes += n as u64;
        if bytes > most {
            return Err(bad(name, format!("is larger than {most} bytes")));
        }
        hasher.update(&buffer[..n]);
        file.write_all(&buffer[..n]).map_err(Error::io(to))?;
    }
    file.sync_all().map_err(Error::io(to))?;
    Ok(FileEntry {
        sha256: hex::encode(hasher.finalize()),
        bytes,
    })
}
