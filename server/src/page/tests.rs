//! The page over HTTP: what it gives to anybody, and that nothing else is to be had without a token.
use std::collections::BTreeSet;
use std::time::Duration;

use futures::StreamExt as _;
use http_body_util::{BodyExt as _, Full, StreamBody};
use hyper::body::{Bytes, Frame};
use reqwest::{Client, Method, Response, StatusCode};
use tokio::net::TcpListener;
use tonic::body::Body;
use tonic::{Code, Status};

use super::files::FILES;
use super::{HEADERS, SERVICES, timely};
use crate::access::{self, Need, Scope};
use crate::grpc::guard::Guard;
use crate::grpc::listener::{ConnectionLimits, HANDSHAKE, ListenerOptions, Protocol, serve};
use crate::grpc::tests::calls::paths;
use crate::grpc::tests::credentials::{SIDECAR, VALUES, delete, marked, raw_spec};
use crate::grpc::tests::harness::Server;
use crate::settings::Settings;

const WEB: &str = "application/grpc-web+proto";

/// Where a page over a server's service is.
async fn page(server: &Server) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    let door = ListenerOptions {
        guard: Guard::tokens(server.api.meter(), server.ledger(), None),
        tls: None,
        protocol: Protocol::Page,
        connections: ConnectionLimits::default(),
        handshake: HANDSHAKE,
        idle: None,
        api: server.api.clone(),
    };
    let routes = server.api.routes().unwrap();
    tokio::spawn(serve(routes, door, listener, std::future::pending()));
    url
}

/// A client that knows nothing but HTTP. It takes the process's provider of cryptography, though nothing here is encrypted.
fn client() -> Client {
    let _ = rustls::crypto::ring::default_provider().install_default();
    Client::new()
}

/// Makes a call with an empty message.
async fn call(client: &Client, url: &str, kind: &str, token: Option<&str>) -> Response {
    let mut request = client.post(url).header("content-type", kind).body(vec![0; 5]);
    if let Some(token) = token {
        request = request.header("authorization", format!("Bearer {token}"));
    }
    request.send().await.unwrap()
}

/// Its code, which stands in the headers where a call is refused.
fn code(answer: &Response) -> Option<&str> {
    let code = answer.headers().get("grpc-status")?;
    Some(code.to_str().unwrap())
}

fn text<'a>(answer: &'a Response, header: &str) -> Option<&'a str> {
    answer.headers().get(header).map(|value| value.to_str().unwrap())
}

#[test]
fn nothing_listens_for_browsers_by_itself() {
    assert_eq!(Settings::default().page_listen, None);
}

#[tokio::test]
async fn every_call_is_denied_without_a_token_that_is_good_for_it() {
    let server = Server::with_tokens().await;
    let (url, client) = (page(&server).await, client());
    let expired = server.token_until("studio", &Scope::ALL, Some(1)).await;
    let mut tried = 0;
    for path in paths() {
        let at = format!("{url}{path}");
        if !SERVICES.iter().any(|service| path.starts_with(service)) {
            // Not even with one.
            let token = server.token("studio", &Scope::ALL).await;
            let answer = call(&client, &at, WEB, Some(&token)).await;
            assert_eq!(answer.status(), StatusCode::NOT_FOUND, "{path}");
            continue;
        }
        for token in [None, Some("gst_0_0"), Some(""), Some(expired.as_str())] {
            let answer = call(&client, &at, WEB, token).await;
            assert_eq!(code(&answer), Some("16"), "{path} with {token:?}");
            assert_eq!(answer.bytes().await.unwrap().len(), 0, "{path}");
        }
        // What is no call of gRPC-Web goes no further, so a page of somebody else can make none without asking first.
        let good = server.token("studio", &Scope::ALL).await;
        for kind in [
            "text/plain",
            "application/x-www-form-urlencoded",
            "multipart/form-data",
            "application/grpc",
        ] {
            let answer = call(&client, &at, kind, Some(&good)).await;
            assert_eq!(answer.status(), StatusCode::BAD_REQUEST, "{path} as {kind}");
        }
        let scopes = match access::need(&path) {
            Some(Need::AnyOf(enough)) => enough,
            _ => &[],
        };
        let others: Vec<Scope> = Scope::ALL.into_iter().filter(|scope| !scopes.contains(scope)).collect();
        if !scopes.is_empty() && !others.is_empty() {
            let token = server.token("studio", &others).await;
            let answer = call(&client, &at, WEB, Some(&token)).await;
            assert_eq!(code(&answer), Some("7"), "{path}");
        }
        tried += 1;
    }
    assert!(tried > 25, "{tried}");
    let token = server.token("studio", &[Scope::Verify]).await;
    let answer = call(
        &client,
        &format!("{url}/guardsplat.v1.JobService/ListJobs"),
        WEB,
        Some(&token),
    )
    .await;
    assert_eq!((answer.status(), code(&answer)), (StatusCode::OK, None));
    assert_eq!(text(&answer, "cache-control"), Some("no-store"));
    let answer = answer.bytes().await.unwrap();
    assert!(String::from_utf8_lossy(&answer).contains("grpc-status:0"), "{answer:?}");
}

#[tokio::test]
async fn other_origins_are_told_nothing() {
    let server = Server::with_tokens().await;
    let (url, client) = (page(&server).await, client());
    for path in ["/", "/guardsplat.v1.JobService/ListJobs"] {
        let asked = client
            .request(Method::OPTIONS, format!("{url}{path}"))
            .header("origin", "https://elsewhere.example")
            .header("access-control-request-method", "POST")
            .header("access-control-request-headers", "authorization,content-type");
        let answer = asked.send().await.unwrap();
        assert!(answer.status().is_client_error(), "{path}: {}", answer.status());
        let headers = answer.headers().keys();
        assert!(
            !headers
                .into_iter()
                .any(|name| name.as_str().starts_with("access-control")),
            "{path}"
        );
    }
}

#[tokio::test]
async fn files_come_with_their_headers_and_nothing_else_is_there() {
    let server = Server::with_tokens().await;
    let (url, client) = (page(&server).await, client());
    for file in FILES {
        let at = format!("{url}{}", file.path);
        let answer = client.get(&at).send().await.unwrap();
        assert_eq!(answer.status(), StatusCode::OK);
        assert_eq!(text(&answer, "content-type"), Some(file.kind));
        for (name, value) in HEADERS {
            assert_eq!(text(&answer, name), Some(value), "{}", file.path);
        }
        let tag = text(&answer, "etag").unwrap().to_owned();
        assert_eq!(answer.bytes().await.unwrap(), file.bytes);
        let again = client.get(&at).header("if-none-match", &tag).send().await.unwrap();
        assert_eq!(again.status(), StatusCode::NOT_MODIFIED);
        let sent = client.post(&at).send().await.unwrap();
        assert_eq!(sent.status(), StatusCode::METHOD_NOT_ALLOWED);
    }
    for path in [
        "/index.html",
        "/vendor",
        "/vendor/",
        "/metrics",
        "//",
        "/style.css/",
        "/%2e%2e/Cargo.toml",
        "/a",
    ] {
        let answer = client.get(format!("{url}{path}")).send().await.unwrap();
        assert_eq!(answer.status(), StatusCode::NOT_FOUND, "{path}");
        assert!(text(&answer, "content-security-policy").is_some());
    }
    let policy = HEADERS[0].1;
    assert!(policy.starts_with("default-src 'none';"));
    assert!(!policy.contains("unsafe-inline") && !policy.contains("'unsafe-eval'") && !policy.contains("http"));
}

#[tokio::test]
async fn a_request_that_stands_still_ends() {
    let part = futures::stream::once(std::future::ready(Ok::<_, Status>(Frame::data(Bytes::from_static(
        b"some",
    )))));
    let still = Body::new(StreamBody::new(part.chain(futures::stream::pending())));
    let status = timely(still, Duration::from_millis(50)).collect().await.unwrap_err();
    assert_eq!(status.code(), Code::Aborted);
    let whole = Body::new(Full::new(Bytes::from_static(b"all")));
    let whole = timely(whole, Duration::from_secs(60))
        .collect()
        .await
        .unwrap()
        .to_bytes();
    assert_eq!(whole, "all");
}

/// What the policy would refuse is not even there, and what the files name is.
#[test]
fn the_page_has_no_inline_script_and_asks_nobody_else() {
    let names: BTreeSet<&str> = FILES.iter().map(|file| file.path).collect();
    for file in FILES.iter().filter(|file| !file.path.starts_with("/vendor/")) {
        let text = std::str::from_utf8(file.bytes).unwrap();
        for word in [
            "http://",
            "https://",
            "//cdn",
            "localStorage",
            "innerHTML",
            "document.write",
            "eval(",
        ] {
            let there = text.matches(word).count();
            // The name of a format, which nobody fetches.
            let allowed = text.matches("http://www.w3.org/2000/svg").count();
            assert!(
                there == 0 || (word == "http://" && there == allowed),
                "{}: {word}",
                file.path
            );
        }
        if file.path == "/" {
            for word in ["<style", "style=", "<script>", " onclick", " onload", "javascript:"] {
                assert!(!text.contains(word), "{word}");
            }
        }
        let quoted = text
            .split(['"', '\''])
            .filter(|text| text.starts_with("./") || text.starts_with('/'));
        for name in quoted.filter(|name| name.ends_with(".js") || name.ends_with(".css") || name.ends_with(".svg")) {
            assert!(
                names.contains(name.trim_start_matches('.')),
                "{} names {name}",
                file.path
            );
        }
    }
}

/// Status and body of a question.
async fn asked(request: reqwest::RequestBuilder, token: Option<&str>) -> (StatusCode, Bytes) {
    let request = match token {
        Some(token) => request.header("authorization", format!("Bearer {token}")),
        None => request,
    };
    let answer = request.send().await.unwrap();
    assert_eq!(text(&answer, "cache-control"), Some("no-store"));
    assert_eq!(
        answer.status() == StatusCode::UNAUTHORIZED,
        text(&answer, "www-authenticate").is_some()
    );
    (answer.status(), answer.bytes().await.unwrap())
}

fn manifests(answer: (StatusCode, Bytes)) -> Vec<String> {
    assert_eq!(answer.0, StatusCode::OK, "{answer:?}");
    let told: serde_json::Value = serde_json::from_slice(&answer.1).unwrap();
    let matches = told["matches"].as_array().unwrap();
    let id = |found: &serde_json::Value| found["manifestId"].as_str().unwrap().to_owned();
    matches.iter().map(id).collect()
}

#[tokio::test]
async fn credentials_are_resolved_for_their_project_and_nobody_else() {
    // Workers and jobs come by an open door; the page has one of its own.
    let server = Server::start().await;
    let spec = raw_spec(&server).await;
    let first = marked(&server, spec("c0ffee42"), "urn:c2pa:1").await;
    marked(&server, spec("c0ffee42"), "urn:c2pa:2").await;
    let (url, client) = (page(&server).await, client());
    let own = server.token(access::DEFAULT_PROJECT, &[Scope::Verify]).await;
    let other = server.token("other", &[Scope::Embed, Scope::Verify]).await;
    let value = VALUES[0].replace('/', "%2F");
    let by_binding = format!("{url}/matches/byBinding?alg=org.guardsplat.sh.1&value={value}");
    let get = |at: &str, token| asked(client.get(at), token);
    let post = |body: String, token| asked(client.post(format!("{url}/matches/byBinding")).body(body), token);
    let question = |value| format!(r#"{{"alg": "org.guardsplat.sh.1", "value": "{value}"}}"#);

    assert_eq!(
        manifests(get(&by_binding, Some(&own)).await),
        ["urn:c2pa:2", "urn:c2pa:1"]
    );
    let one = format!("{by_binding}&maxResults=1");
    assert_eq!(manifests(get(&one, Some(&own)).await), ["urn:c2pa:2"]);
    assert_eq!(manifests(post(question(VALUES[0]), Some(&own)).await).len(), 2);
    assert_eq!(manifests(post(question(VALUES[1]), Some(&own)).await).len(), 0);
    let foreign = r#"{"alg": "com.example", "value": "x"}"#.to_owned();
    assert_eq!(manifests(post(foreign, Some(&own)).await).len(), 0);
    let manifest = format!("{url}/manifests/urn:c2pa:1");
    let (status, bytes) = get(&manifest, Some(&own)).await;
    assert_eq!((status, &bytes[..]), (StatusCode::OK, SIDECAR));

    // Another project has none of it, and without a token that is good for it nobody has.
    assert_eq!(manifests(get(&by_binding, Some(&other)).await).len(), 0);
    assert_eq!(get(&manifest, Some(&other)).await.0, StatusCode::NOT_FOUND);
    let expired = server
        .token_until(access::DEFAULT_PROJECT, &[Scope::Verify], Some(1))
        .await;
    let others = server
        .token(access::DEFAULT_PROJECT, &[Scope::Worker, Scope::Admin])
        .await;
    let mut tried = 0;
    for (path, need) in access::RESOLUTION {
        let at = format!("{url}{path}{}", if path.ends_with('/') { "urn:c2pa:1" } else { "" });
        for method in [Method::GET, Method::POST] {
            for token in [None, Some("gst_0_0"), Some(expired.as_str()), Some(others.as_str())] {
                let (status, body) = asked(client.request(method.clone(), &at), token).await;
                let expected = match (need, token) {
                    (Need::Nothing, _) if method == Method::GET => StatusCode::OK,
                    (Need::Nothing, _) => StatusCode::METHOD_NOT_ALLOWED,
                    (_, Some(token)) if token == others => StatusCode::FORBIDDEN,
                    _ => StatusCode::UNAUTHORIZED,
                };
                assert_eq!(status, expected, "{method} {at} with {token:?}: {body:?}");
                tried += 1;
            }
        }
    }
    assert!(tried >= 32, "{tried}");
    // Wrong questions are told.
    for (request, status) in [
        (client.get(format!("{url}/matches/byBinding?alg=a")), 400),
        (
            client.post(format!("{url}/matches/byContent")).body(vec![7; 1 << 20]),
            501,
        ),
        (
            client
                .post(format!("{url}/matches/byBinding"))
                .body(vec![b' '; 1 << 17]),
            413,
        ),
        (client.get(format!("{url}/manifests/urn:c2pa:3")), 404),
        (client.delete(&manifest), 405),
    ] {
        assert_eq!(asked(request, Some(&own)).await.0.as_u16(), status);
    }
    // What is deleted is not found any more.
    delete(&server, &first.artifact).await;
    assert_eq!(manifests(get(&by_binding, Some(&own)).await), ["urn:c2pa:2"]);
    assert_eq!(get(&manifest, Some(&own)).await.0, StatusCode::NOT_FOUND);
}
