//! Sends files to the store that will have them, where the server gives an address for that. Whatever goes wrong on this
//! way, the one through the server is left.
use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::task::{Context as Task, Poll, ready};
use std::time::Duration;

use guardsplat_proto::v1::artifact_service_client::ArtifactServiceClient;
use guardsplat_proto::v1::{Artifact, FinishUploadRequest, StartUploadRequest, StartUploadResponse};
use hyper::Request;
use hyper::body::{Body, Bytes, Frame, SizeHint};
use tokio::fs::File;
use tokio::io::AsyncReadExt;
use tokio::sync::mpsc;
use tokio::time::{Instant, timeout};

use super::signed_address::{connect, is_as_safe};
use super::source::{AHEAD, CHUNK, LOOK, Source};
use crate::console::Unit;
use crate::context::Context;
use crate::error::{Error, Result};
use crate::server::is_lost;

const FINISHING: &str = "finishing the upload";
/// Bytes a second at which the server reads what was sent, at least.
const LEAST_SPEED: u64 = 8 << 20;

/// Sends a file; nothing where that does not work out. `before` of `total` bytes went with other files.
///
/// # Errors
/// Of the file, and of a server that is lost while it has all: that can't be sent in another way either.
pub async fn upload(context: &Context, source: &Source, before: u64, total: u64) -> Result<Option<Artifact>> {
    let Some(begun) = begin(context, source).await else {
        return Ok(None);
    };
    match send(context, &begun, source, before, total).await? {
        true => finish(context, begun.upload, source.size).await,
        false => Ok(None),
    }
}

/// Where to send it; nothing where there is no such address, or none that is as safe as the server's. What the server
/// refuses here it refuses on the other way too, and tells why.
async fn begin(context: &Context, source: &Source) -> Option<StartUploadResponse> {
    let mut client = ArtifactServiceClient::new(context.server.channel().await.ok()?);
    let request = StartUploadRequest {
        metadata: Some(source.metadata()),
        in_parts: false,
    };
    let answer = context.in_time(client.start_upload(context.request(request))).await;
    let begun = answer.ok()?.into_inner();
    is_as_safe(&context.server.url, &begun.url).then_some(begun)
}

/// Sends all of it in one request; whether the store has it. The address is a secret, and is in what is said of errors,
/// so nothing is said of them.
async fn send(
    context: &Context,
    begun: &StartUploadResponse,
    source: &Source,
    before: u64,
    total: u64,
) -> Result<bool> {
    let limit = context.server.timeout;
    let file = File::open(&source.path).await.map_err(Error::io(&source.path))?;
    let sent = Arc::new(AtomicU64::new(0));
    let (sender, chunks) = mpsc::channel(AHEAD);
    let reading = tokio::spawn(read(file, source.size, sender, Arc::clone(&sent)));
    let mut request = Request::put(&begun.url);
    for header in &begun.headers {
        request = request.header(&header.name, &header.value);
    }
    let Ok(request) = request.body(Sending {
        chunks,
        left: source.size,
    }) else {
        return Ok(false);
    };
    let answer = async { connect(request.uri(), limit).await?.send(request).await };
    tokio::pin!(answer);
    let mut look = tokio::time::interval(LOOK);
    let (mut last, mut moved) = (0, Instant::now());
    let taken = loop {
        tokio::select! {
            answer = &mut answer => break answer.is_ok_and(|answer| answer.status().is_success()),
            _ = look.tick() => {
                let now = sent.load(Ordering::Relaxed);
                context.console.show("upload", Unit::Bytes, before + now, total, "");
                if now != last {
                    (last, moved) = (now, Instant::now());
                } else if moved.elapsed() > limit {
                    break false;
                }
            }
        }
    };
    if taken {
        context
            .console
            .show("upload", Unit::Bytes, before + source.size, total, "");
        return Ok(true);
    }
    reading.abort();
    match reading.await {
        // The file, not the store, is why it was cut short.
        Ok(Err(error)) => Err(Error::io(&source.path)(error)),
        _ => Ok(false),
    }
}

/// Has the server take what the store has. It reads all of it, and is silent meanwhile; that it is there at all the
/// connection tells.
async fn finish(context: &Context, upload: String, size: u64) -> Result<Option<Artifact>> {
    let limit = context.server.timeout + Duration::from_secs(size / LEAST_SPEED);
    let mut client = ArtifactServiceClient::new(context.server.channel().await?);
    let mut backoff = context.backoff();
    loop {
        let request = context.request(FinishUploadRequest { upload: upload.clone() });
        match timeout(limit, client.finish_upload(request)).await {
            Ok(Ok(artifact)) => return Ok(Some(artifact.into_inner())),
            Ok(Err(status)) if is_lost(&status) => context.pause(&mut backoff, FINISHING, &status, "").await?,
            Ok(Err(_)) | Err(_) => return Ok(None),
        }
    }
}

async fn read(file: File, size: u64, sender: mpsc::Sender<Vec<u8>>, sent: Arc<AtomicU64>) -> io::Result<()> {
    // No more than was announced, also of a file that grows.
    let mut file = file.take(size);
    loop {
        let mut chunk = Vec::with_capacity(CHUNK);
        (&mut file).take(CHUNK as u64).read_to_end(&mut chunk).await?;
        let length = chunk.len() as u64;
        // Nobody receives any more when the store has answered.
        if length == 0 || sender.send(chunk).await.is_err() {
            return Ok(());
        }
        sent.fetch_add(length, Ordering::Relaxed);
    }
}

/// A file on its way, with its length at the head: stores take no other.
struct Sending {
    chunks: mpsc::Receiver<Vec<u8>>,
    left: u64,
}

impl Body for Sending {
    type Data = Bytes;
    type Error = io::Error;

    fn poll_frame(mut self: Pin<&mut Self>, task: &mut Task<'_>) -> Poll<Option<io::Result<Frame<Bytes>>>> {
        Poll::Ready(match ready!(self.chunks.poll_recv(task)) {
            Some(chunk) => {
                self.left = self.left.saturating_sub(chunk.len() as u64);
                Some(Ok(Frame::data(chunk.into())))
            }
            None if self.left == 0 => None,
            // The file is shorter than it was, or could not be read.
            None => Some(Err(io::ErrorKind::UnexpectedEof.into())),
        })
    }

    fn is_end_stream(&self) -> bool {
        self.left == 0
    }

    fn size_hint(&self) -> SizeHint {
        SizeHint::with_exact(self.left)
    }
}
