//! Messages to real receivers: a small HTTP server of the tests' own, with and without TLS.
use std::io;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use rcgen::{CertifiedKey, generate_simple_self_signed};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpListener;
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::ServerConfig;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::PrivateKeyDer;

use super::{PostError, Poster, Rules};

/// What a receiver was sent: the head as text, and the body.
#[derive(Clone, Debug)]
pub(crate) struct Received {
    pub(crate) head: String,
    pub(crate) body: Vec<u8>,
}

impl Received {
    pub(crate) fn header(&self, name: &str) -> String {
        let lines = self.head.lines().filter_map(|line| line.split_once(": "));
        let mut found = lines.filter(|(found, _)| found.eq_ignore_ascii_case(name));
        let (_, value) = found.next().unwrap_or_else(|| panic!("no {name} in {}", self.head));
        value.to_owned()
    }
}

/// A receiver that answers as it is told.
pub(crate) struct Receiver {
    pub(crate) address: SocketAddr,
    received: Arc<Mutex<Vec<Received>>>,
    answers: Arc<Mutex<Vec<String>>>,
}

impl Receiver {
    pub(crate) async fn start() -> Self {
        Self::with(None).await
    }

    async fn with(tls: Option<TlsAcceptor>) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let receiver = Self {
            address: listener.local_addr().unwrap(),
            received: Arc::default(),
            answers: Arc::default(),
        };
        let (received, answers) = (receiver.received.clone(), receiver.answers.clone());
        tokio::spawn(async move {
            loop {
                let (stream, _) = listener.accept().await.unwrap();
                let (received, answers, tls) = (received.clone(), answers.clone(), tls.clone());
                tokio::spawn(async move {
                    match tls {
                        None => serve(stream, received, answers).await,
                        Some(tls) => serve(tls.accept(stream).await?, received, answers).await,
                    }
                });
            }
        });
        receiver
    }

    /// What the next requests are answered with; those after them with 204.
    pub(crate) fn answer(&self, statuses: &[u16]) {
        let answers = statuses.iter().map(|status| answer(*status, ""));
        self.answers.lock().unwrap().extend(answers);
    }

    pub(crate) fn received(&self) -> Vec<Received> {
        self.received.lock().unwrap().clone()
    }
}

fn answer(status: u16, more: &str) -> String {
    format!("HTTP/1.1 {status} So\r\n{more}content-length: 0\r\n\r\n")
}

async fn serve(
    mut stream: impl AsyncRead + AsyncWrite + Unpin,
    received: Arc<Mutex<Vec<Received>>>,
    answers: Arc<Mutex<Vec<String>>>,
) -> io::Result<()> {
    let mut bytes = Vec::new();
    let end = loop {
        if let Some(end) = bytes.windows(4).position(|window| window == b"\r\n\r\n") {
            break end;
        }
        if stream.read_buf(&mut bytes).await? == 0 {
            return Ok(());
        }
    };
    let head = String::from_utf8(bytes[..end].to_vec()).unwrap();
    let mut one = Received { head, body: Vec::new() };
    let length: usize = one.header("content-length").parse().unwrap();
    one.body = bytes.split_off(end + 4);
    while one.body.len() < length {
        stream.read_buf(&mut one.body).await?;
    }
    received.lock().unwrap().push(one);
    let next = {
        let mut answers = answers.lock().unwrap();
        if answers.is_empty() {
            answer(204, "")
        } else {
            answers.remove(0)
        }
    };
    stream.write_all(next.as_bytes()).await?;
    stream.shutdown().await
}

/// What lets the tests' receivers be called.
pub(crate) fn loose() -> Rules {
    Rules {
        allow_http: true,
        allow_private: true,
        ..Rules::default()
    }
}

pub(crate) fn poster(rules: Rules) -> Poster {
    Poster::new(rules, None).unwrap()
}

async fn post(poster: &Poster, url: &str) -> Result<(), PostError> {
    poster.post(url, &[("webhook-id", "7".into())], b"{}".to_vec()).await
}

#[tokio::test]
async fn a_message_arrives_whole_and_is_acknowledged() {
    let receiver = Receiver::start().await;
    receiver.answer(&[200, 299]);
    let url = format!("http://{}/a/hook?b=c%20d", receiver.address);
    for _ in 0..2 {
        post(&poster(loose()), &url).await.unwrap();
    }
    let received = receiver.received();
    assert_eq!(received.len(), 2);
    assert!(
        received[0].head.starts_with("POST /a/hook?b=c%20d HTTP/1.1\r\n"),
        "{}",
        received[0].head
    );
    assert_eq!(received[0].header("host"), receiver.address.to_string());
    assert_eq!(
        (received[0].header("webhook-id").as_str(), received[0].body.as_slice()),
        ("7", &b"{}"[..])
    );
}

#[tokio::test]
async fn other_answers_are_none() {
    let receiver = Receiver::start().await;
    let url = format!("http://{}/", receiver.address);
    for status in [300, 400, 404, 410, 429, 500, 503] {
        receiver.answer(&[status]);
        let error = post(&poster(loose()), &url).await.unwrap_err();
        assert!(
            matches!(error, PostError::Status { status: found } if found == status),
            "{error}"
        );
    }
    // A redirect leads nowhere, wherever it points.
    let other = Receiver::start().await;
    let elsewhere = answer(307, &format!("location: http://{}/\r\n", other.address));
    receiver.answers.lock().unwrap().push(elsewhere);
    let error = post(&poster(loose()), &url).await.unwrap_err();
    assert_eq!(error.to_string(), "answered 307, and redirects are not followed");
    assert!(other.received().is_empty());
    // What is no HTTP, and a head without end.
    for nonsense in ["nonsense\r\n\r\n".to_owned(), answer(200, &"a: b\r\n".repeat(10_000))] {
        receiver.answers.lock().unwrap().push(nonsense);
        let error = post(&poster(loose()), &url).await.unwrap_err();
        assert!(matches!(error, PostError::Http(_)), "{error}");
    }
}

#[tokio::test]
async fn what_is_not_public_is_not_called_unless_that_is_allowed() {
    let receiver = Receiver::start().await;
    let strict = Rules {
        allow_private: false,
        ..loose()
    };
    let port = receiver.address.port();
    for host in ["127.0.0.1", "[::ffff:127.0.0.1]", "2130706433"] {
        let url = format!("http://{host}:{port}/");
        let error = post(&poster(strict.clone()), &url).await.unwrap_err();
        assert!(matches!(error, PostError::Url(_)), "{host}: {error}");
    }
    // Names are looked up, with the system's own means.
    let url = format!("http://localhost:{port}/");
    let error = post(&poster(strict.clone()), &url).await.unwrap_err();
    assert!(matches!(error, PostError::Refused { .. }), "{error}");
    assert!(error.to_string().contains("not public"), "{error}");
    // One bad address among good ones is enough.
    let mixed = poster(strict.clone()).with_lookup(Arc::new(move |_, port| {
        let addresses = ["8.8.8.8", "10.0.0.1"].map(|ip| SocketAddr::new(ip.parse().unwrap(), port));
        Box::pin(async move { Ok(addresses.to_vec()) })
    }));
    let error = post(&mixed, "http://shop.example/").await.unwrap_err();
    assert!(
        matches!(error, PostError::Refused { address, .. } if address.to_string() == "10.0.0.1"),
        "{error}"
    );
    assert!(receiver.received().is_empty());
    let plain = Rules {
        allow_http: false,
        ..loose()
    };
    let url = format!("http://{}/", receiver.address);
    assert!(matches!(post(&poster(plain), &url).await, Err(PostError::Url(_))));
}

/// A name that leads to an allowed address when it is looked at, and elsewhere when it is called, gets the first.
#[tokio::test]
async fn a_name_is_looked_up_once() {
    let good = Receiver::start().await;
    let count = Arc::new(AtomicUsize::new(0));
    let (address, counted) = (good.address, count.clone());
    let poster = poster(loose()).with_lookup(Arc::new(move |host, _| {
        assert_eq!(host, "shop.example");
        let first = counted.fetch_add(1, Ordering::SeqCst) == 0;
        let found = if first { address } else { "127.0.0.9:9".parse().unwrap() };
        Box::pin(async move { Ok(vec![found]) })
    }));
    post(&poster, "http://shop.example/").await.unwrap();
    assert_eq!(count.load(Ordering::SeqCst), 1);
    assert_eq!(good.received()[0].header("host"), "shop.example");
    let nowhere = poster.with_lookup(Arc::new(|_, _| {
        Box::pin(async { Err(io::Error::other("no such name")) })
    }));
    let error = post(&nowhere, "http://shop.example/").await.unwrap_err();
    assert!(error.to_string().contains("no such name"), "{error}");
}

#[tokio::test]
async fn a_receiver_proves_who_it_is() {
    let CertifiedKey { cert, signing_key } = generate_simple_self_signed(["shop.example".to_owned()]).unwrap();
    let key = PrivateKeyDer::try_from(signing_key.serialize_der()).unwrap();
    let config = ServerConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_no_client_auth()
        .with_single_cert(vec![cert.der().clone()], key)
        .unwrap();
    let receiver = Receiver::with(Some(TlsAcceptor::from(Arc::new(config)))).await;
    let address = receiver.address;
    let with = |ca: Option<&[u8]>| {
        let poster = Poster::new(loose(), ca).unwrap();
        poster.with_lookup(Arc::new(move |_, _| Box::pin(async move { Ok(vec![address]) })))
    };
    let pem = cert.pem();
    post(&with(Some(pem.as_bytes())), "https://shop.example/hook")
        .await
        .unwrap();
    assert_eq!(receiver.received().len(), 1);
    for (ca, url) in [
        (None, "https://shop.example/hook"),
        (Some(pem.as_bytes()), "https://another.example/hook"),
        (Some(pem.as_bytes()), "https://127.0.0.1/hook"),
    ] {
        let url = url.replace("127.0.0.1", &address.to_string());
        let error = post(&with(ca), &url).await.unwrap_err();
        assert!(matches!(error, PostError::Tls(_)), "{url}: {error}");
    }
    assert_eq!(receiver.received().len(), 1);
    assert!(Poster::new(loose(), Some(b"no certificate")).is_err());
}
