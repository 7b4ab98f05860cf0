//! What plain HTTP answers to strangers: three pages that name no project and nothing that is in one, whatever is asked and
//! with whatever token.
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::{CreateJobRequest, Job};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;

use super::calls::{asking, paths};
use super::harness::{Server, key_spec};
use crate::access::Scope;
use crate::metrics::{Page, serve};
use crate::run::Readiness;

const PAGES: [&str; 3] = ["/metrics", "/livez", "/readyz"];
const PROJECT: &str = "studio-of-secrets";
const TITLE: &str = "a job of somebody";

#[tokio::test]
async fn plain_http_tells_nothing_of_projects() {
    let server = Server::with_tokens().await;
    let token = server.token(PROJECT, &Scope::ALL).await;
    let request = CreateJobRequest {
        job: Some(Job {
            display_name: TITLE.into(),
            spec: Some(key_spec(8)),
            ..Job::default()
        }),
        ..CreateJobRequest::default()
    };
    let mut jobs = JobServiceClient::new(server.channel.clone());
    let job = jobs.create_job(asking(&token, request)).await.unwrap().into_inner();
    let id = job.name.trim_start_matches("jobs/");

    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let (_ready, readiness) = watch::channel(Readiness::default());
    tokio::spawn(serve(
        listener,
        Page {
            metrics: server.api.metrics(),
            ledger: server.ledger(),
            readiness,
        },
    ));
    let others = [
        "/",
        "/metrics/",
        "/metrics/..",
        "//metrics",
        "/readyz/worker",
        "/artifacts",
        "/%6detrics",
    ];
    let all = paths().into_iter().chain(others.map(str::to_owned));
    for path in all.chain(PAGES.map(str::to_owned)) {
        let page = PAGES.contains(&path.as_str());
        for method in ["GET", "HEAD", "POST", "DELETE"] {
            for token in [None, Some(token.as_str())] {
                let text = ask(&address, method, &path, token).await;
                let expected: &[&str] = match (method, page) {
                    ("POST" | "DELETE", _) => &["405"],
                    (_, true) => &["200", "503"],
                    (_, false) => &["404"],
                };
                let status = text.split(' ').nth(1).unwrap();
                assert!(expected.contains(&status), "{method} {path}: {text}");
                for secret in [PROJECT, TITLE, id].into_iter().chain(token) {
                    assert!(!text.contains(secret), "{method} {path} tells {secret}");
                }
            }
        }
    }
}

/// The whole answer.
async fn ask(address: &str, method: &str, path: &str, token: Option<&str>) -> String {
    let token = token.map_or_else(String::new, |token| format!("authorization: Bearer {token}\r\n"));
    let request = format!("{method} {path} HTTP/1.1\r\nhost: {address}\r\n{token}connection: close\r\n\r\n");
    let mut stream = TcpStream::connect(address).await.unwrap();
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    answer
}
