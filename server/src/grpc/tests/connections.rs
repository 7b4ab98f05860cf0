//! Connections that say nothing, or have nothing to say, and too many of them.
use std::net::SocketAddr;
use std::time::Duration;

use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::{ListJobsRequest, WatchJobRequest};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::{sleep, timeout};
use tonic::transport::Channel;

use super::harness::{Server, key_spec};
use crate::grpc::guard::Guard;
use crate::grpc::listener::{ConnectionLimits, ListenerOptions, Protocol, serve};

const SHORT: Duration = Duration::from_millis(200);
const LONG: Duration = Duration::from_secs(3600);
/// By then whatever is waited for has happened.
const SOON: Duration = Duration::from_secs(10);
/// What is sent first: the preface, and settings that say nothing.
const PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0";

/// Another listener of a server.
async fn door(server: &Server, total: usize, handshake: Duration, idle: Option<Duration>) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let options = ListenerOptions {
        guard: Guard::open(server.api.meter()),
        tls: None,
        protocol: Protocol::Grpc,
        connections: ConnectionLimits {
            total,
            of_one_address: total,
        },
        handshake,
        idle,
        api: server.api.clone(),
    };
    let routes = server.api.routes().unwrap();
    tokio::spawn(serve(routes, options, listener, std::future::pending()));
    address
}

fn jobs(address: SocketAddr) -> JobServiceClient<Channel> {
    let channel = Channel::from_shared(format!("http://{address}")).unwrap();
    JobServiceClient::new(channel.connect_lazy())
}

/// Reads until the other side has closed.
async fn closed(stream: &mut TcpStream) {
    let mut read = Vec::new();
    // Also if that is told as an error.
    let _ = timeout(SOON, stream.read_to_end(&mut read))
        .await
        .expect("it is still open");
}

#[tokio::test]
async fn a_connection_that_never_begins_is_closed() {
    let server = Server::start().await;
    let address = door(&server, 100, SHORT, None).await;
    for said in [&b""[..], &PREFACE[..10], b"GET / HTTP/1.1\r\nhost: x\r\n\r\n"] {
        let mut stream = TcpStream::connect(address).await.unwrap();
        stream.write_all(said).await.unwrap();
        closed(&mut stream).await;
    }
    // One that has begun stays.
    let mut stream = TcpStream::connect(address).await.unwrap();
    stream.write_all(PREFACE).await.unwrap();
    sleep(2 * SHORT).await;
    let mut read = [0; 9];
    stream.read_exact(&mut read).await.unwrap();
    let more = timeout(SHORT, async { while stream.read(&mut read).await.unwrap() > 0 {} });
    assert!(more.await.is_err(), "it was closed");
}

#[tokio::test]
async fn a_connection_without_calls_is_closed_and_one_with_a_call_is_not() {
    let server = Server::start().await;
    let address = door(&server, 100, LONG, Some(SHORT)).await;
    let mut idle = TcpStream::connect(address).await.unwrap();
    idle.write_all(PREFACE).await.unwrap();
    let job = server.create(key_spec(8)).await.name;
    let mut client = jobs(address);
    let request = WatchJobRequest {
        name: job,
        cursor: String::new(),
    };
    let mut watch = client.watch_job(request).await.unwrap().into_inner();
    watch.message().await.unwrap().unwrap();
    closed(&mut idle).await;
    sleep(4 * SHORT).await;
    // The watch goes on, and so does who watches.
    assert!(timeout(SHORT, watch.message()).await.is_err());
    client.list_jobs(ListJobsRequest::default()).await.unwrap();
    drop(watch);
    sleep(4 * SHORT).await;
    client.list_jobs(ListJobsRequest::default()).await.unwrap();
}

#[tokio::test]
async fn who_comes_when_there_are_too_many_takes_the_place_of_an_idle_one() {
    let server = Server::start().await;
    let address = door(&server, 3, LONG, None).await;
    let mut idle = Vec::new();
    for _ in 0..200 {
        let mut stream = TcpStream::connect(address).await.unwrap();
        stream.write_all(PREFACE).await.unwrap();
        idle.push(stream);
    }
    timeout(SOON, jobs(address).list_jobs(ListJobsRequest::default()))
        .await
        .unwrap()
        .unwrap();
    for stream in &mut idle[..197] {
        closed(stream).await;
    }
    // Connections with calls stay, and no more are taken then.
    let job = server.create(key_spec(8)).await.name;
    let mut watches = Vec::new();
    for _ in 0..3 {
        let request = WatchJobRequest {
            name: job.clone(),
            cursor: String::new(),
        };
        let mut client = jobs(address);
        let mut watch = client.watch_job(request).await.unwrap().into_inner();
        watch.message().await.unwrap().unwrap();
        watches.push((client, watch));
    }
    let mut refused = TcpStream::connect(address).await.unwrap();
    closed(&mut refused).await;
    for (_, watch) in &mut watches {
        assert!(timeout(SHORT, watch.message()).await.is_err());
    }
    drop(watches.pop());
    sleep(SHORT).await;
    jobs(address).list_jobs(ListJobsRequest::default()).await.unwrap();
}
