//! Bytes to and from the server, in chunks and checked against their SHA-256.
use std::io::Cursor;
use std::path::{Path, PathBuf};

use guardsplat_engine::message::MAX_KEY_BYTES;
use guardsplat_proto::v1::download_artifact_response::Payload as Down;
use guardsplat_proto::v1::upload_output_request::Payload as Up;
use guardsplat_proto::v1::{
    Artifact, DownloadArtifactRequest, DownloadKeyRequest, OutputMetadata, UploadMetadata, UploadOutputRequest,
};
use sha2::{Digest, Sha256};
use tokio::fs::File;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWriteExt};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;

use super::direct;
use super::error::{Error, Result};
use super::lease::Lease;
use super::server::{Server, persist};

/// Bytes of a message; half of what the API allows.
const CHUNK: usize = 512 << 10;
/// Messages that wait for the network.
const WAITING: usize = 4;

fn damaged(what: &str, reason: String) -> Error {
    Error::Damaged {
        what: what.into(),
        reason,
    }
}

/// Fetches an artifact into a new file at `path`: from the store that has it where the server says where that is, else
/// through the server. A download that breaks off is taken up where it was.
///
/// # Errors
/// What the server answers, a file that can't be written, or [`Error::Damaged`] where the bytes are not those that were
/// announced.
pub async fn download(server: &Server, name: &str, path: &Path) -> Result<Artifact> {
    if let Some(artifact) = direct::download(server, name, path).await {
        return Ok(artifact);
    }
    let call = "download an artifact";
    let mut file = File::create(path).await.map_err(Error::io(path))?;
    let mut hash = Sha256::new();
    let mut have: i64 = 0;
    let mut announced: Option<Artifact> = None;
    persist(call, async || {
        let request = DownloadArtifactRequest {
            name: name.into(),
            offset: have,
        };
        let refused = |status| Error::of(call, &status);
        let stream = server.artifacts().download_artifact(request).await.map_err(refused)?;
        let mut stream = stream.into_inner();
        while let Some(message) = stream.message().await.map_err(refused)? {
            match message.payload {
                Some(Down::Artifact(artifact)) => announced = Some(artifact),
                Some(Down::Chunk(chunk)) => {
                    let size = announced.as_ref().map_or(0, |artifact| artifact.size_bytes);
                    have += chunk.len() as i64;
                    if have > size {
                        return Err(damaged(name, format!("more bytes than the {size} announced")));
                    }
                    hash.update(&chunk);
                    file.write_all(&chunk).await.map_err(Error::io(path))?;
                }
                None => {}
            }
        }
        Ok(())
    })
    .await?;
    file.flush().await.map_err(Error::io(path))?;
    let artifact = announced.ok_or_else(|| damaged(name, "nothing was sent".into()))?;
    if have != artifact.size_bytes {
        let size = artifact.size_bytes;
        return Err(damaged(name, format!("{have} bytes came of {size} announced")));
    }
    let found = hex::encode(hash.finalize());
    if !found.eq_ignore_ascii_case(&artifact.sha256) {
        let expected = &artifact.sha256;
        return Err(damaged(
            name,
            format!("its bytes have SHA-256 {found}, {expected} was announced"),
        ));
    }
    Ok(artifact)
}

/// Fetches the file of the key that the leased job needs. It stays in memory; the key's own id covers its bytes.
///
/// # Errors
/// What the server answers, or [`Error::Damaged`] when there is no end to it.
pub async fn download_key(server: &Server, lease: &Lease) -> Result<Vec<u8>> {
    let call = "fetch the key";
    persist(call, async || {
        let request = DownloadKeyRequest {
            job: lease.job.clone(),
            lease_token: lease.token.clone(),
        };
        let refused = |status| Error::of(call, &status);
        let mut stream = server
            .worker()
            .download_key(request)
            .await
            .map_err(refused)?
            .into_inner();
        let mut bytes = Vec::new();
        while let Some(message) = stream.message().await.map_err(refused)? {
            bytes.extend_from_slice(&message.chunk);
            if bytes.len() as u64 > MAX_KEY_BYTES {
                return Err(damaged("the key", format!("more than {MAX_KEY_BYTES} bytes")));
            }
        }
        Ok(bytes)
    })
    .await
}

/// What is uploaded.
pub enum Content {
    /// A file's bytes.
    File(PathBuf),
    /// These.
    Bytes(Vec<u8>),
}

impl Content {
    async fn open(&self) -> Result<Box<dyn AsyncRead + Send + Unpin + '_>> {
        Ok(match self {
            Self::File(path) => Box::new(File::open(path).await.map_err(Error::io(path))?),
            Self::Bytes(bytes) => Box::new(Cursor::new(bytes.as_slice())),
        })
    }

    fn path(&self) -> &Path {
        match self {
            Self::File(path) => path,
            Self::Bytes(_) => Path::new("memory"),
        }
    }

    /// Gives every chunk to `take` until it has enough.
    async fn chunks(&self, mut take: impl AsyncFnMut(Vec<u8>) -> bool) -> Result<()> {
        let mut source = self.open().await?;
        loop {
            let mut chunk = Vec::with_capacity(CHUNK);
            let mut limited = (&mut source).take(CHUNK as u64);
            limited.read_to_end(&mut chunk).await.map_err(Error::io(self.path()))?;
            if chunk.is_empty() || !take(chunk).await {
                return Ok(());
            }
        }
    }
}

/// Stores an output of the leased job and gives its name. With `secret` it is a key file, kept encrypted.
///
/// # Errors
/// What the server answers, or a file that can't be read.
pub async fn upload(server: &Server, lease: &Lease, name: &str, content: &Content, secret: bool) -> Result<String> {
    let mut hash = Sha256::new();
    let mut size = 0;
    content
        .chunks(async |chunk| {
            hash.update(&chunk);
            size += chunk.len() as i64;
            true
        })
        .await?;
    let metadata = OutputMetadata {
        job: lease.job.clone(),
        lease_token: lease.token.clone(),
        upload: Some(UploadMetadata {
            display_name: name.into(),
            size_bytes: size,
            sha256: hex::encode(hash.finalize()),
        }),
        secret,
    };
    let call = "store an output";
    persist(call, async || {
        let (sender, receiver) = mpsc::channel(WAITING);
        let message = |payload| UploadOutputRequest { payload: Some(payload) };
        let feed = async {
            let metadata = message(Up::Metadata(metadata.clone()));
            if sender.send(metadata).await.is_ok() {
                content
                    .chunks(async |chunk| sender.send(message(Up::Chunk(chunk))).await.is_ok())
                    .await?;
            }
            drop(sender);
            Ok(())
        };
        let mut client = server.worker();
        let answer = client.upload_output(ReceiverStream::new(receiver));
        tokio::pin!(answer);
        let answer = tokio::select! {
            answer = &mut answer => answer,
            fed = feed => {
                let fed: Result<()> = fed;
                fed?;
                answer.await
            }
        };
        let artifact = answer.map_err(|status| Error::of(call, &status))?.into_inner();
        Ok(artifact.name)
    })
    .await
}
