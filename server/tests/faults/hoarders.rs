//! Clients that hold what they do not use, from many addresses: downloads that nobody reads, connections that say nothing,
//! uploads that stop half-way. The server's memory stays bounded, and others are served as before.
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::Arc;

use futures::StreamExt as _;
use guardsplat_proto::v1::upload_artifact_request::Payload;
use guardsplat_proto::v1::{DownloadArtifactRequest, DownloadArtifactResponse, UploadArtifactRequest, UploadMetadata};
use tokio::io::AsyncWriteExt as _;
use tokio::net::{TcpSocket, TcpStream};
use tokio::task::JoinHandle;
use tokio::time::{Duration, Instant, sleep, timeout};
use tonic::Streaming;

use crate::caller::Caller;
use crate::laggards::healthy;
use crate::load::peak;
use crate::place::{Place, short_or_full};
use crate::support::Server;
use crate::support::s3::Endpoint;

/// Files that the server may have open: what most systems give.
const FILES: u64 = 1024;
/// More than that.
const IDLE: u32 = 1100;
/// Connections of one address that have begun to speak HTTP/2.
const OF_ONE_ADDRESS: u32 = 50;
/// What is downloaded: more than is ever on the way.
const READ: usize = 6 << 20;
/// What is announced, half of which is sent.
const BYTES: usize = 8 << 20;
/// Downloads and uploads of one address.
const STREAMS: usize = 50;
/// Bytes that may be on the way to a reader.
const WINDOW: u32 = 64 << 10;
/// Mebibytes that the server may have in memory: 256 megabytes.
const MOST: u64 = 244;
/// What is sent first on a connection of HTTP/2: the preface, and settings that say nothing.
const PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0";

/// An address of this machine that calls like another one.
fn address(group: u8, number: usize) -> IpAddr {
    let number = u8::try_from(number + 1).unwrap();
    Ipv4Addr::new(127, 0, group, number).into()
}

/// A download that is begun, and read for its first message.
async fn reading(caller: &Caller, name: &str) -> Streaming<DownloadArtifactResponse> {
    let request = DownloadArtifactRequest {
        name: name.to_owned(),
        ..DownloadArtifactRequest::default()
    };
    let answer = caller.artifacts.clone().download_artifact(request).await;
    let mut stream = answer.unwrap().into_inner();
    stream.message().await.unwrap().unwrap();
    stream
}

/// An upload of which half is sent.
fn uploading(caller: Caller) -> JoinHandle<()> {
    tokio::spawn(async move {
        let metadata = UploadMetadata {
            display_name: "half.ply".into(),
            size_bytes: BYTES as i64,
            sha256: "ab".repeat(32),
        };
        let chunks = (0..BYTES >> 20).map(|_| Payload::Chunk(vec![7; 512 << 10]));
        let said = std::iter::once(Payload::Metadata(metadata)).chain(chunks);
        let said: Vec<_> = said
            .map(|payload| UploadArtifactRequest { payload: Some(payload) })
            .collect();
        let messages = tokio_stream::iter(said).chain(futures::stream::pending());
        let _ = caller.artifacts.clone().upload_artifact(messages).await;
    })
}

/// A connection that sends this and then nothing; none where it is not taken.
async fn idle(to: SocketAddr, from: IpAddr, said: &[u8]) -> Option<TcpStream> {
    let socket = TcpSocket::new_v4().unwrap();
    socket.bind((from, 0).into()).unwrap();
    let connected = timeout(Duration::from_secs(2), socket.connect(to)).await;
    let mut stream = connected.ok()?.ok()?;
    stream.write_all(said).await.ok()?;
    Some(stream)
}

/// Seconds of a core that the server has taken.
fn computed(server: &Server) -> f64 {
    let stat = std::fs::read_to_string(format!("/proc/{}/stat", server.pid())).unwrap();
    let fields: Vec<_> = stat.rsplit(')').next().unwrap().split_ascii_whitespace().collect();
    let ticks: f64 = [11, 12].map(|i| fields[i].parse::<f64>().unwrap()).iter().sum();
    ticks / 100.0 // ticks a second, on every Linux
}

/// An S3 server with threads of its own: what it computes is not to hold up the callers that are timed.
fn service() -> Endpoint {
    let (give, take) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let runtime = tokio::runtime::Runtime::new().unwrap();
        runtime.block_on(async {
            give.send(Endpoint::start().await).unwrap();
            // For as long as this process.
            std::future::pending::<()>().await;
        });
    });
    take.recv().unwrap()
}

pub async fn of_a_folder(place: Place) {
    do_not_use_it_up(place, "a folder", IDLE).await;
}

pub async fn of_a_bucket(mut place: Place) {
    let endpoint = service();
    place.keeps_artifacts_in(&endpoint);
    do_not_use_it_up(place, "S3", IDLE).await;
}

/// Without idle connections, which are another thing than memory.
pub async fn of_memory(mut place: Place) {
    let endpoint = service();
    place.keeps_artifacts_in(&endpoint);
    do_not_use_it_up(place, "S3", 0).await;
}

async fn do_not_use_it_up(mut place: Place, store: &str, idle_connections: u32) {
    let (readers, uploads) = short_or_full((50, 20), (256, 100));
    let long = short_or_full(Duration::from_secs(2), Duration::from_secs(20));
    place.bench.may_open(FILES);
    let server = place.start(&[]).await;
    let caller = place.caller();
    let inputs = Arc::new(caller.inputs().await);
    let scene = caller.upload("large.ply", &vec![7; READ]).await.unwrap().name;
    let before = healthy(&place, &inputs, long).await;
    let at_rest = peak(&server);

    let mut unread = Vec::new();
    for at in (0..readers).step_by(STREAMS) {
        let caller = Caller::at(&place.url(), address(1, at / STREAMS), WINDOW);
        for _ in at..readers.min(at + STREAMS) {
            unread.push(reading(&caller, &scene).await);
        }
    }
    // Some are slow and not silent.
    let slow: Vec<_> = unread
        .split_off(readers / 2)
        .into_iter()
        .map(|mut stream| {
            tokio::spawn(async move {
                while let Ok(Some(_)) = stream.message().await {
                    sleep(Duration::from_millis(700)).await;
                }
            })
        })
        .collect();
    let halves: Vec<_> = (0..uploads)
        .map(|i| uploading(Caller::at(&place.url(), address(2, i / STREAMS), WINDOW)))
        .collect();
    let to: SocketAddr = server.address().parse().unwrap();
    let mut connections = Vec::new();
    for i in 0..idle_connections {
        // Every other one begins to speak.
        let (from, said) = match i % 2 {
            0 => (address(3, 0), &b""[..]),
            _ => (address(4, (i / 2 / OF_ONE_ADDRESS) as usize), PREFACE),
        };
        connections.push(idle(to, from, said).await);
    }
    let (began, computing) = (Instant::now(), computed(&server));
    // On connections of their own, as whoever comes now.
    let during = timeout(3 * long, healthy(&place, &inputs, long)).await;
    let during = during.expect("others are not served");
    let cores = (computed(&server) - computing) / began.elapsed().as_secs_f64();
    let other = place.caller();
    let moved = timeout(10 * long, async {
        let sent = other.upload("other.ply", &vec![9; BYTES]).await.unwrap();
        other.download(&sent.name).await.unwrap()
    });
    let begun = Instant::now();
    assert!(moved.await.expect("others can't send and fetch") == vec![9; BYTES]);
    let moved = begun.elapsed();
    let most = peak(&server);
    place.figure(&format!(
        "artifacts in {store}, {readers} downloads that are not read or slowly, {idle_connections} idle connections, {uploads} uploads \
         that stop half-way, {FILES} files: the server had {most} MiB at most ({at_rest} before); others' calls {before}; \
         with them {during}, {cores:.2} cores; 8 MiB sent and fetched in {:.1} s",
        moved.as_secs_f64()
    ));
    assert!(most < MOST, "{most} MiB");
    for task in slow.into_iter().chain(halves) {
        task.abort();
    }
    drop((unread, connections));
    server.stop().await;
}
