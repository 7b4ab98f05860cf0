//! What those who look after a server see of it: metrics, life, readiness; and logs that keep secrets, whatever is logged.
use guardsplat_proto::v1::token_service_client::TokenServiceClient;
use guardsplat_proto::v1::worker_service_client::WorkerServiceClient;
use guardsplat_proto::v1::{CreateTokenRequest, LeaseJobRequest, ListTokensRequest, Token, token};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tonic::Request;

use super::support::{Bench, Server, until};

/// Asks over HTTP/1.1: status, and the whole answer.
pub async fn get(address: &str, path: &str) -> (u16, String) {
    ask(address, "GET", path).await
}

async fn ask(address: &str, method: &str, path: &str) -> (u16, String) {
    let mut stream = TcpStream::connect(address).await.unwrap();
    let request = format!("{method} {path} HTTP/1.1\r\nhost: {address}\r\nconnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    let status = answer.split(' ').nth(1).unwrap().parse().unwrap();
    (status, answer)
}

/// A server that tells metrics, and where.
pub async fn start(bench: &mut Bench) -> (Server, String) {
    bench.variable("GUARDSPLAT_METRICS_LISTEN", "127.0.0.1:0");
    let server = bench.start().await;
    let log = until(|| bench.server_log(), |log| log.contains("metrics are at http://")).await;
    let rest = log.split("metrics are at http://").nth(1).unwrap();
    let address = rest.split("/metrics").next().unwrap().to_owned();
    (server, address)
}

#[tokio::test]
async fn metrics_and_readiness_have_an_address_of_their_own() {
    let mut bench = Bench::new();
    let (server, address) = start(&mut bench).await;
    assert_eq!(get(&address, "/livez").await.0, 200);
    // Nobody works yet, and that is what is told.
    let (status, text) = get(&address, "/readyz").await;
    assert_eq!(status, 503, "{text}");
    for line in ["[+] ledger: well", "[+] artifacts: well", "[-] worker: not well"] {
        assert!(text.contains(line), "{text}");
    }
    let (status, text) = get(&address, "/readyz?exclude=worker").await;
    assert!(status == 200 && text.contains("[~] worker: left out"), "{text}");
    let (status, text) = get(&address, "/metrics").await;
    assert!(status == 200 && text.ends_with("# EOF\n"), "{text}");
    assert!(text.contains("content-type: application/openmetrics-text"), "{text}");
    for line in [
        r#"guardsplat_ready{part="ledger"} 1"#,
        r#"guardsplat_ready{part="worker"} 0"#,
        r#"guardsplat_queued_jobs{kind="embed"} 0"#,
    ] {
        assert!(text.contains(line), "{line} is not in\n{text}");
    }
    assert_eq!(get(&address, "/").await.0, 404);
    assert_eq!(ask(&address, "POST", "/metrics").await.0, 405);
    // A worker waits for a job.
    let mut worker = WorkerServiceClient::new(server.channel().await);
    let wait = Some(prost_types::Duration { seconds: 30, nanos: 0 });
    let waiting = tokio::spawn(async move {
        let request = LeaseJobRequest {
            worker: "stub".into(),
            device: "cpu".into(),
            memory_bytes: 5 << 30,
            wait,
            ..LeaseJobRequest::default()
        };
        worker.lease_job(request).await
    });
    for _ in 0..200 {
        if get(&address, "/readyz").await.0 == 200 {
            break;
        }
        tokio::time::sleep(std::time::Duration::from_millis(50)).await;
    }
    assert_eq!(get(&address, "/readyz").await.0, 200);
    let (_, text) = get(&address, "/metrics").await;
    let memory = format!(r#"guardsplat_worker_memory_bytes{{device="cpu"}} {}"#, 5_u64 << 30);
    assert!(text.contains(&memory), "{memory} is not in\n{text}");
    assert_eq!(server.stop().await.code(), Some(0));
    assert!(waiting.await.unwrap().is_err());
}

/// A flow with every kind of secret there is, at the level at which most is logged.
#[tokio::test]
async fn logs_hold_no_secrets_whatever_is_logged() {
    let master = "5ec2e75ec2e75ec2e75ec2e75ec2e75ec2e75ec2e75ec2e75ec2e75ec2e75ec2";
    let mut bench = Bench::new();
    bench.variable("GUARDSPLAT_MASTER_KEY", master);
    bench.variable("GUARDSPLAT_LOG_FILTER", "trace");
    bench.variable("GUARDSPLAT_LOG_FORMAT", "json");
    bench.variable("GUARDSPLAT_ACCESS", "tokens");
    // Traces are sent nowhere, but everything on the way there is done.
    bench.variable("OTEL_EXPORTER_OTLP_ENDPOINT", "http://127.0.0.1:1");
    bench.variable("OTEL_EXPORTER_OTLP_HEADERS", "api-key=0f0e5ec2e7");
    let mut tokens = Vec::new();
    for scopes in [&["embed", "verify", "admin"][..], &["worker"]] {
        let mut arguments = vec!["token", "create"];
        for scope in scopes {
            arguments.extend(["--scope", scope]);
        }
        tokens.push(bench.says(&arguments).await.1.trim().to_owned());
    }
    let (server, address) = start(&mut bench).await;
    let channel = server.channel().await;
    let asking = |n: usize| {
        let header: tonic::metadata::MetadataValue<_> = format!("Bearer {}", tokens[n]).parse().unwrap();
        move |mut request: Request<()>| {
            request.metadata_mut().insert("authorization", header.clone());
            let parent = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01"
                .parse()
                .unwrap();
            request.metadata_mut().insert("traceparent", parent);
            Ok(request)
        }
    };
    let flow = super::flow::carry_out(&channel, asking(0), asking(1)).await;
    let mut admin = TokenServiceClient::with_interceptor(channel.clone(), asking(0));
    let request = CreateTokenRequest {
        token: Some(Token {
            scopes: vec![token::Scope::Embed.into()],
            ..Token::default()
        }),
    };
    let made = admin.create_token(request).await.unwrap().into_inner().secret;
    let wrong = Request::new(ListTokensRequest::default());
    let mut stranger = TokenServiceClient::with_interceptor(channel, move |mut request: Request<()>| {
        let header = "Bearer gst_wrong_0badc0ffee0ddf00d".parse().unwrap();
        request.metadata_mut().insert("authorization", header);
        Ok(request)
    });
    stranger.list_tokens(wrong).await.unwrap_err();
    get(&address, "/metrics").await;
    assert_eq!(server.stop().await.code(), Some(0));

    let log = bench.server_log();
    assert!(
        log.contains("job given to a worker") && log.lines().count() > 100,
        "{log}"
    );
    // Lines can be found by the trace that they belong to.
    assert!(log.contains(r#""trace":"0af7651916cd43dd8448eb211c80319c""#));
    let digits = |token: &str| token.rsplit('_').next().unwrap().to_owned();
    let mut secrets = vec![
        ("the master key", "5ec2e7".to_owned()),
        ("a token that was made", digits(&made)),
        ("a token that is wrong", "0badc0ffee0ddf00d".to_owned()),
        ("a scene", flow.scene),
        ("a key file", flow.key_file),
        ("a lease", flow.lease_token),
        ("a message", flow.message),
    ];
    secrets.extend(tokens.iter().map(|token| ("a token", digits(token))));
    for (what, secret) in secrets {
        let found = log.lines().find(|line| holds(line, &secret));
        assert!(found.is_none(), "{what} is in the log: {found:?}");
    }
}

/// Whether a line has a text, as it is, in hexadecimal, or as a list of bytes.
fn holds(line: &str, secret: &str) -> bool {
    let bytes = secret.as_bytes();
    let list: Vec<String> = bytes.iter().map(u8::to_string).collect();
    line.contains(secret) || line.contains(&hex::encode(bytes)) || line.contains(&list.join(", "))
}
