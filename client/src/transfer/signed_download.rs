//! Fetches artifacts from the store that has them, where the server gives an address for that. Whatever goes wrong on
//! this way, the one through the server is left.
use std::path::Path;
use std::time::Duration;

use guardsplat_proto::v1::artifact_service_client::ArtifactServiceClient;
use guardsplat_proto::v1::{Artifact, GetDownloadUrlRequest};
use http_body_util::Empty;
use hyper::body::Bytes;
use hyper::header::RANGE;
use hyper::{Request, StatusCode};
use tokio::time::timeout;

use super::destination::{Destination, size};
use super::signed_address::{connect, is_as_safe};
use crate::console::Unit;
use crate::context::Context;
use crate::error::Result;
use crate::http_client::Answer;

/// How often an artifact is asked for, each time from where the time before ended.
const TRIES: usize = 3;

/// Fetches the artifact called `name` into the file `path`; nothing where that does not work out.
///
/// # Errors
/// Only of the file: that can't be written in another way either.
pub async fn download(context: &Context, name: &str, path: &Path) -> Result<Option<Artifact>> {
    let mut file = Destination::new(path)?;
    for _ in 0..TRIES {
        let Some((artifact, url)) = address(context, name).await else {
            return Ok(None);
        };
        let before = file.written();
        if fetch(context, &url, &artifact, &mut file).await? {
            // Other bytes than the server's are as good as none.
            let whole = file.is(size(&artifact), &artifact.sha256);
            return match whole {
                true => file.finish(size(&artifact), &artifact.sha256).map(|_| Some(artifact)),
                false => Ok(None),
            };
        }
        if file.written() == before {
            return Ok(None);
        }
    }
    Ok(None)
}

/// The artifact, and where it is; nothing where there is no such address, or none that is as safe as the server's.
async fn address(context: &Context, name: &str) -> Option<(Artifact, String)> {
    let mut client = ArtifactServiceClient::new(context.server.channel().await.ok()?);
    let request = GetDownloadUrlRequest { name: name.to_owned() };
    let answer = context
        .in_time(client.get_download_url(request))
        .await
        .ok()?
        .into_inner();
    let safe = is_as_safe(&context.server.url, &answer.url);
    Some((answer.artifact?, answer.url)).filter(|_| safe)
}

/// Goes on with the file; whether all of it is there.
async fn fetch(context: &Context, url: &str, artifact: &Artifact, file: &mut Destination) -> Result<bool> {
    let limit = context.server.timeout;
    let Some(mut answer) = ask(url, file.written(), size(artifact), limit).await else {
        return Ok(false);
    };
    loop {
        // The address is a secret, and would be in what is said of an error.
        match answer.chunk(limit).await {
            Ok(Some(chunk)) => file.write(&chunk)?,
            Ok(None) => return Ok(file.written() == size(artifact)),
            Err(_) => return Ok(false),
        }
        if file.written() > size(artifact) {
            return Ok(false);
        }
        let console = &context.console;
        console.show("download", Unit::Bytes, file.written(), size(artifact), "");
    }
}

/// An answer that has the rest of the bytes.
async fn ask(url: &str, offset: u64, size: u64, limit: Duration) -> Option<Answer> {
    let (mut request, mut expected) = (Request::get(url), StatusCode::OK);
    if offset > 0 {
        request = request.header(RANGE, format!("bytes={offset}-"));
        expected = StatusCode::PARTIAL_CONTENT;
    }
    let request = request.body(Empty::<Bytes>::new()).ok()?;
    let answered = async { connect(request.uri(), limit).await?.send(request).await };
    let answer = timeout(limit, answered).await.ok()?.ok()?;
    let whole = answer.status() == expected && answer.length() == Some(size - offset);
    Some(answer).filter(|_| whole)
}
