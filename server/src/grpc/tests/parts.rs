//! Uploads that come in parts, with connections that break off in between.
use std::time::Duration;

use guardsplat_proto::v1::{AppendUploadRequest, Artifact, FinishUploadRequest, StartUploadRequest, UploadMetadata};
use tonic::{Code, Status};

use super::calls::asking;
use super::harness::{Server, invalid, metadata, not_found, refused, sha256};
use super::stores::{bytes, download, server};
use crate::access::Scope;
use crate::artifacts::tests::endpoint::Endpoint;
use crate::service::Limits;

const MEBIBYTE: usize = 1 << 20;

async fn start(server: &Server, metadata: UploadMetadata) -> Result<String, Status> {
    let request = StartUploadRequest {
        metadata: Some(metadata),
        in_parts: true,
    };
    let begun = server.artifacts.clone().start_upload(request).await?.into_inner();
    assert_eq!(begun.url, "");
    Ok(begun.upload)
}

fn part(upload: &str, offset: usize, chunk: &[u8]) -> AppendUploadRequest {
    AppendUploadRequest {
        upload: upload.into(),
        offset: offset as i64,
        chunk: chunk.into(),
    }
}

async fn append(server: &Server, upload: &str, offset: usize, chunk: &[u8]) -> Result<usize, Status> {
    let answer = server
        .artifacts
        .clone()
        .append_upload(part(upload, offset, chunk))
        .await?;
    Ok(answer.into_inner().received_bytes as usize)
}

async fn finish(server: &Server, upload: &str) -> Result<Artifact, Status> {
    let request = FinishUploadRequest { upload: upload.into() };
    Ok(server.artifacts.clone().finish_upload(request).await?.into_inner())
}

/// Sends what has not arrived.
async fn send(server: &Server, upload: &str, sent: &[u8]) {
    let mut at = append(server, upload, 0, &[]).await.unwrap();
    while at < sent.len() {
        let end = sent.len().min(at + MEBIBYTE);
        at = append(server, upload, at, &sent[at..end]).await.unwrap();
        assert_eq!(at, end);
    }
}

#[tokio::test]
async fn an_upload_goes_on_where_it_broke_off() {
    let endpoint = Endpoint::start().await;
    for server in [Server::start().await, server(&endpoint, Limits::default()).await] {
        let sent = bytes(6 * MEBIBYTE + 7, 1);
        let upload = start(&server, metadata("scène.ply", &sent)).await.unwrap();
        assert_eq!(append(&server, &upload, 0, &[]).await.unwrap(), 0);
        // Not what comes next.
        assert_eq!(append(&server, &upload, 5, &sent[5..10]).await.unwrap(), 0);
        for _ in 0..2 {
            // The answer was lost, and the part is sent again.
            assert_eq!(append(&server, &upload, 0, &sent[..MEBIBYTE]).await.unwrap(), MEBIBYTE);
        }
        assert_eq!(append(&server, &upload, 0, &[]).await.unwrap(), MEBIBYTE);
        let text = finish(&server, &upload).await.unwrap_err();
        assert!(text.message().contains("1048576 of 6291463 bytes"), "{text}");
        // Two at once, as when the caller gave up the first: one is taken.
        let next = &sent[MEBIBYTE..2 * MEBIBYTE];
        let both = tokio::join!(
            append(&server, &upload, MEBIBYTE, next),
            append(&server, &upload, MEBIBYTE, next)
        );
        assert_eq!((both.0.unwrap(), both.1.unwrap()), (2 * MEBIBYTE, 2 * MEBIBYTE));
        send(&server, &upload, &sent).await;
        let (one, other) = tokio::join!(finish(&server, &upload), finish(&server, &upload));
        let artifact = one.unwrap();
        assert_eq!(other.unwrap(), artifact);
        assert_eq!(
            (artifact.size_bytes, artifact.sha256.as_str()),
            (sent.len() as i64, sha256(&sent).as_str())
        );
        assert_eq!(artifact.display_name, "scène.ply");
        assert!(download(&server, &artifact.name).await.unwrap() == sent);
        // Said again, also when the connection broke off before the answer.
        assert_eq!(append(&server, &upload, 0, &[]).await.unwrap(), sent.len());
        assert_eq!(finish(&server, &upload).await.unwrap(), artifact);
    }
}

#[tokio::test]
async fn what_is_not_right_is_not_kept() {
    let server = Server::start().await;
    let sent = bytes(3000, 1);
    let mut wrong = metadata("scene.ply", &sent);
    wrong.sha256 = sha256(b"something else");
    let upload = start(&server, wrong).await.unwrap();
    send(&server, &upload, &sent).await;
    assert_eq!(invalid(finish(&server, &upload).await), ["metadata.sha256"]);
    let upload = start(&server, metadata("scene.ply", &sent)).await.unwrap();
    assert_eq!(invalid(append(&server, &upload, 0, &bytes(3001, 1)).await), ["chunk"]);
    assert_eq!(
        invalid(append(&server, &upload, 0, &bytes(MEBIBYTE + 1, 1)).await),
        ["chunk"]
    );
    // It begins again, and so it does after a pause that was too long.
    send(&server, &upload, &sent[..10]).await;
    server.api.arriving().end_paused(Duration::ZERO);
    assert_eq!(append(&server, &upload, 10, &sent[10..]).await.unwrap(), 0);
    send(&server, &upload, &sent).await;
    finish(&server, &upload).await.unwrap();
    assert_eq!(server.files().len(), 1);
    for bad in ["", "uploads/", "uploads/AAAA"] {
        assert!(append(&server, bad, 0, &sent).await.is_err(), "{bad}");
    }
    let too_late = Limits {
        abandoned_after: Duration::ZERO,
        ..Limits::default()
    };
    let server = server.restart(too_late).await;
    let upload = start(&server, metadata("scene.ply", &sent)).await.unwrap();
    refused(
        append(&server, &upload, 0, &sent).await,
        Code::Aborted,
        "UPLOAD_TOO_SLOW",
    );
}

#[tokio::test]
async fn a_caller_has_so_many_and_only_their_own() {
    let limits = Limits {
        max_transfers: 2,
        max_bytes_of_project: Some(7000),
        ..Limits::default()
    };
    let server = Server::with_tokens_and(limits).await;
    let token = server.token("studio", &[Scope::Embed]).await;
    let mut client = server.artifacts.clone();
    let mut uploads = Vec::new();
    for seed in 0..3 {
        let request = StartUploadRequest {
            metadata: Some(metadata("scene.ply", &bytes(2000, seed))),
            in_parts: true,
        };
        uploads.push(
            client
                .start_upload(asking(&token, request))
                .await
                .unwrap()
                .into_inner()
                .upload,
        );
    }
    let more = StartUploadRequest {
        metadata: Some(metadata("scene.ply", &bytes(2000, 3))),
        in_parts: true,
    };
    let more = client.start_upload(asking(&token, more)).await;
    refused(more, Code::ResourceExhausted, "QUOTA_USED_UP");
    for (at, upload) in uploads.iter().enumerate() {
        let some = bytes(2000, at);
        let answer = client
            .append_upload(asking(&token, part(upload, 0, &some[..1000])))
            .await;
        match at {
            2 => drop(refused(answer, Code::ResourceExhausted, "TOO_MANY_TRANSFERS")),
            _ => assert_eq!(answer.unwrap().into_inner().received_bytes, 1000),
        }
    }
    let other = server.token("other", &[Scope::Embed]).await;
    not_found(client.append_upload(asking(&other, part(&uploads[0], 0, &[]))).await);
    // One that is finished makes room.
    let rest = &bytes(2000, 0)[1000..];
    client
        .append_upload(asking(&token, part(&uploads[0], 1000, rest)))
        .await
        .unwrap();
    let finished = FinishUploadRequest {
        upload: uploads[0].clone(),
    };
    client.finish_upload(asking(&token, finished)).await.unwrap();
    client
        .append_upload(asking(&token, part(&uploads[2], 0, &bytes(2000, 2))))
        .await
        .unwrap();
}
