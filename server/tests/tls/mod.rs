//! TLS and certificates of clients, against a real server, through what clients and workers connect with.
use std::path::PathBuf;
use std::sync::Arc;

use guardsplat_proto::connect::{Target, Token};
use guardsplat_proto::v1::ListJobsRequest;
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use rcgen::{BasicConstraints, CertificateParams, CertifiedIssuer, IsCa, KeyPair};
use rustls::crypto::ring;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, ServerName};
use rustls::{ClientConfig, RootCertStore};
use tempfile::TempDir;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;
use tonic::{Code, Status};

use super::support::{Bench, until};

/// A CA, and the files of what it signed.
struct Authority {
    folder: TempDir,
    issuer: CertifiedIssuer<'static, KeyPair>,
}

impl Authority {
    fn new() -> Self {
        let mut params = CertificateParams::new(Vec::new()).unwrap();
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        let issuer = CertifiedIssuer::self_signed(params, KeyPair::generate().unwrap()).unwrap();
        let folder = TempDir::new().unwrap();
        std::fs::write(folder.path().join("ca.pem"), issuer.pem()).unwrap();
        Self { folder, issuer }
    }

    fn ca(&self) -> PathBuf {
        self.folder.path().join("ca.pem")
    }

    /// Certificate and key for a name.
    fn signs(&self, name: &str) -> (PathBuf, PathBuf) {
        let key = KeyPair::generate().unwrap();
        let params = CertificateParams::new([name.to_owned()]).unwrap();
        let certificate = params.signed_by(&key, &self.issuer).unwrap();
        let path = |end: &str| self.folder.path().join(format!("{name}.{end}"));
        std::fs::write(path("pem"), certificate.pem()).unwrap();
        std::fs::write(path("key"), key.serialize_pem()).unwrap();
        (path("pem"), path("key"))
    }
}

fn serve_tls(bench: &mut Bench, authority: &Authority, clients: Option<&Authority>) {
    let (certificate, key) = authority.signs("localhost");
    bench.variable("GUARDSPLAT_TLS_CERTIFICATE", certificate.to_str().unwrap());
    bench.variable("GUARDSPLAT_TLS_KEY", key.to_str().unwrap());
    if let Some(clients) = clients {
        bench.variable("GUARDSPLAT_TLS_CLIENT_CA", clients.ca().to_str().unwrap());
    }
}

/// Calls once; an error of the connection is one too.
async fn list(target: &Target) -> Result<(), Status> {
    let connected = target.endpoint().unwrap().connect().await;
    let channel = connected.map_err(|error| Status::from_error(error.into()))?;
    let mut jobs = JobServiceClient::new(target.authorised(channel));
    jobs.list_jobs(ListJobsRequest::default()).await.map(|_| ())
}

fn at(url: String, authority: &Authority) -> Target {
    Target {
        url,
        ca: Some(authority.ca()),
        ..Target::default()
    }
}

#[tokio::test]
async fn with_tls_nothing_else_is_spoken() {
    let (ours, others) = (Authority::new(), Authority::new());
    let mut bench = Bench::new();
    serve_tls(&mut bench, &ours, None);
    let server = bench.start().await;
    let port = server.address().rsplit(':').next().unwrap().to_owned();
    let https = format!("https://localhost:{port}");
    list(&at(https.clone(), &ours)).await.unwrap();

    let plain = Target {
        url: format!("http://localhost:{port}"),
        ..Target::default()
    };
    list(&plain).await.expect_err("plaintext was served");
    list(&at(https.clone(), &others))
        .await
        .expect_err("a stranger's CA was believed");
    let public = Target {
        url: https,
        ..Target::default()
    };
    list(&public).await.expect_err("a certificate of nobody's was believed");
    // The certificate is for localhost.
    let other_name = at(format!("https://127.0.0.1:{port}"), &ours);
    list(&other_name).await.expect_err("another name was believed");
    server.stop().await;
}

#[tokio::test]
async fn with_mtls_nobody_comes_in_without_a_certificate() {
    let (ours, clients, others) = (Authority::new(), Authority::new(), Authority::new());
    let mut bench = Bench::new();
    serve_tls(&mut bench, &ours, Some(&clients));
    bench.variable("GUARDSPLAT_ACCESS", "tokens");
    let (_, token, _) = bench.says(&["token", "create", "--scope", "verify"]).await;
    let server = bench.start().await;
    let port = server.address().rsplit(':').next().unwrap();
    let with = |identity: Option<(PathBuf, PathBuf)>, token: Option<&str>| {
        let (certificate, certificate_key) = identity.unzip();
        Target {
            certificate,
            certificate_key,
            token: token.map(|token| Token::new(token, "here").unwrap()),
            ..at(format!("https://localhost:{port}"), &ours)
        }
    };
    let right = Some(clients.signs("shop"));
    list(&with(right.clone(), Some(&token))).await.unwrap();
    list(&with(None, Some(&token)))
        .await
        .expect_err("no certificate was asked for");
    let wrong = Some(others.signs("shop"));
    list(&with(wrong, Some(&token)))
        .await
        .expect_err("a stranger's certificate was believed");
    // A certificate is no token.
    assert_eq!(
        list(&with(right, None)).await.unwrap_err().code(),
        Code::Unauthenticated
    );
    server.stop().await;
}

#[tokio::test]
async fn files_that_are_no_certificates_are_told_at_the_start() {
    let ours = Authority::new();
    let (certificate, key) = ours.signs("localhost");
    let bench = Bench::new();
    let (certificate, key) = (certificate.to_str().unwrap(), key.to_str().unwrap());
    for (pem, key, told) in [
        (certificate, "/nowhere.key", "tls_key /nowhere.key: No such file"),
        ("/nowhere.pem", key, "tls_certificate /nowhere.pem: No such file"),
        (key, key, "TLS can't be set up"),
        (certificate, certificate, "TLS can't be set up"),
    ] {
        let (status, text) = bench.fails(&["--tls-certificate", pem, "--tls-key", key]).await;
        assert_eq!(status.code(), Some(1), "{text}");
        assert!(text.contains(told), "{text}");
    }
}

/// The server's own worker comes in by a listener of its own, where nobody else does.
#[tokio::test]
async fn the_own_worker_has_a_door_of_its_own() {
    let ours = Authority::new();
    let mut bench = Bench::new();
    serve_tls(&mut bench, &ours, None);
    let server = bench
        .start_with_worker("echo \"$GUARDSPLAT_TOKEN\" > $LOG; echo \"$3\" >> $LOG; exec sleep 60")
        .await;
    let log = until(|| bench.log(), |log| log.lines().count() == 2).await;
    let (token, url) = log.trim().split_once('\n').unwrap();
    assert!(
        url.starts_with("http://127.0.0.1:") && !url.ends_with(server.address().rsplit(':').next().unwrap()),
        "{url}"
    );
    let target = |token: Option<&str>| Target {
        url: url.to_owned(),
        token: token.map(|token| Token::new(token, "here").unwrap()),
        ..Target::default()
    };
    // Listing jobs is not a worker's; without the token one does not get so far.
    assert_eq!(
        list(&target(Some(token))).await.unwrap_err().code(),
        Code::PermissionDenied
    );
    for stranger in [None, Some("gst_0_0")] {
        assert_eq!(list(&target(stranger)).await.unwrap_err().code(), Code::Unauthenticated);
    }
    assert_eq!(server.stop().await.code(), Some(0));
}

#[tokio::test]
async fn browsers_are_shown_the_same_certificate() {
    let ours = Authority::new();
    let mut bench = Bench::new();
    serve_tls(&mut bench, &ours, None);
    bench.variable("GUARDSPLAT_ACCESS", "tokens");
    // Nothing listens for them by itself.
    let server = bench.start().await;
    assert!(!bench.server_log().contains("the page is at"));
    drop(server);
    bench.variable("GUARDSPLAT_PAGE_LISTEN", "127.0.0.1:0");
    let _server = bench.start().await;
    let log = bench.server_log();
    let (_, rest) = log.split_once("the page is at https://").expect("the log says where");
    let stream = TcpStream::connect(rest.split('/').next().unwrap()).await.unwrap();

    let mut roots = RootCertStore::empty();
    roots.add(CertificateDer::from_pem_file(ours.ca()).unwrap()).unwrap();
    let config = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .unwrap();
    let mut config = config.with_root_certificates(roots).with_no_client_auth();
    config.alpn_protocols = vec![b"h2".to_vec(), b"http/1.1".to_vec()];
    let name = ServerName::try_from("localhost").unwrap();
    let connected = TlsConnector::from(Arc::new(config)).connect(name, stream).await;
    let mut stream = connected.unwrap();
    assert_eq!(stream.get_ref().1.alpn_protocol(), Some(&b"http/1.1"[..]));
    let request = "GET / HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n";
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).await.unwrap();
    assert!(answer.starts_with("HTTP/1.1 200 OK\r\n"), "{answer}");
    assert!(
        answer.contains("content-security-policy: default-src 'none';"),
        "{answer}"
    );
}
