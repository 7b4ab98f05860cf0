//! The command's own span: what a collector is sent, and that one which is away breaks nothing.
use std::net::{SocketAddr, TcpListener};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use opentelemetry_proto::tonic::collector::trace::v1::trace_service_server::{TraceService, TraceServiceServer};
use opentelemetry_proto::tonic::collector::trace::v1::{ExportTraceServiceRequest, ExportTraceServiceResponse};
use opentelemetry_proto::tonic::common::v1::{KeyValue, any_value::Value};
use opentelemetry_proto::tonic::trace::v1::Span;
use opentelemetry_proto::tonic::trace::v1::status::StatusCode;
use tonic::transport::Server;
use tonic::transport::server::TcpIncoming;
use tonic::{Request, Response, Status};

use super::run::{PICTURE, Ran, TestEnvironment, finish};

const TRACE: &str = "0af7651916cd43dd8448eb211c80319c";
const CALLER: &str = "b7ad6b7169203331";

/// Keeps what it is sent.
#[derive(Clone, Default)]
struct Collector(Arc<Mutex<Vec<ExportTraceServiceRequest>>>);

#[tonic::async_trait]
impl TraceService for Collector {
    async fn export(
        &self,
        request: Request<ExportTraceServiceRequest>,
    ) -> Result<Response<ExportTraceServiceResponse>, Status> {
        self.0.lock().unwrap().push(request.into_inner());
        Ok(Response::new(ExportTraceServiceResponse::default()))
    }
}

impl Collector {
    /// On a thread of its own.
    fn start(&self) -> SocketAddr {
        let (sender, receiver) = std::sync::mpsc::channel();
        let service = TraceServiceServer::new(self.clone());
        std::thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_current_thread()
                .enable_all()
                .build()
                .unwrap();
            runtime.block_on(async {
                let incoming = TcpIncoming::bind("127.0.0.1:0".parse().unwrap()).unwrap();
                sender.send(incoming.local_addr().unwrap()).unwrap();
                let server = Server::builder().add_service(service);
                server.serve_with_incoming(incoming).await.unwrap();
            });
        });
        receiver.recv().unwrap()
    }

    /// The one span that it was sent since it was last asked, and all that came with it, as text.
    fn span(&self) -> (Span, String) {
        let sent = std::mem::take(&mut *self.0.lock().unwrap());
        let text = format!("{sent:?}");
        let resources = sent.into_iter().flat_map(|request| request.resource_spans);
        let scopes = resources.flat_map(|resource| resource.scope_spans);
        let mut spans: Vec<Span> = scopes.flat_map(|scope| scope.spans).collect();
        assert_eq!(spans.len(), 1, "{text}");
        (spans.remove(0), text)
    }
}

fn run(environment: &TestEnvironment, line: &str, collector: SocketAddr, parent: &str) -> Ran {
    let child = environment
        .command(line)
        .env("GUARDSPLAT_SERVER", environment.fake.url())
        .env("GUARDSPLAT_TOKEN", "gst_0_5ec2e75ec2e7")
        .env("OTEL_EXPORTER_OTLP_ENDPOINT", format!("http://{collector}"))
        .env("TRACEPARENT", parent)
        .spawn();
    finish(child.unwrap())
}

fn attribute<'a>(attributes: &'a [KeyValue], key: &str) -> Option<&'a Value> {
    let found = attributes.iter().find(|attribute| attribute.key == key)?;
    found.value.as_ref()?.value.as_ref()
}

#[test]
fn a_command_is_a_span_that_its_calls_are_below() {
    let collector = Collector::default();
    let address = collector.start();
    let environment = TestEnvironment::new();
    let ran = run(&environment, "key list", address, &format!("00-{TRACE}-{CALLER}-01"));
    assert_eq!(ran.code, 0, "{}", ran.err);
    let (span, text) = collector.span();
    assert_eq!(span.name, "guardsplat key list");
    assert_eq!(hex::encode(&span.trace_id), TRACE);
    assert_eq!(hex::encode(&span.parent_span_id), CALLER);
    assert!(span.end_time_unix_nano >= span.start_time_unix_nano);
    assert_eq!(
        attribute(&span.attributes, "process.exit.code"),
        Some(&Value::IntValue(0))
    );
    assert_eq!(attribute(&span.attributes, "error.type"), None);
    assert!(
        text.contains("\"service.name\"") && text.contains("\"guardsplat\""),
        "{text}"
    );
    let said = format!("00-{TRACE}-{}-01", hex::encode(&span.span_id));
    let traced = std::mem::take(&mut environment.fake.state().traced);
    assert_eq!(traced, [Some(said)]);

    // Nobody above: a trace of its own. It fails, and nothing that it was given is told.
    environment.file("in.png", PICTURE);
    let ran = run(
        &environment,
        "verify in.png --key secretkey --message c0ffee42",
        address,
        "",
    );
    assert_eq!(ran.code, 1, "{}", ran.err);
    let (span, text) = collector.span();
    assert_eq!(span.name, "guardsplat verify");
    assert!(span.parent_span_id.is_empty());
    assert_ne!(hex::encode(&span.trace_id), TRACE);
    assert_eq!(
        attribute(&span.attributes, "process.exit.code"),
        Some(&Value::IntValue(1))
    );
    assert!(attribute(&span.attributes, "error.type").is_some(), "{text}");
    assert_eq!(span.status.unwrap().code(), StatusCode::Error);
    for given in ["c0ffee42", "secretkey", "in.png", "5ec2e7"] {
        assert!(!text.contains(given), "{given} is in {text}");
    }
}

#[test]
fn who_is_not_sampled_sends_nothing_and_says_so() {
    let collector = Collector::default();
    let address = collector.start();
    let environment = TestEnvironment::new();
    let ran = run(&environment, "key list", address, &format!("00-{TRACE}-{CALLER}-00"));
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert!(collector.0.lock().unwrap().is_empty());
    let said = environment.fake.state().traced[0].clone().unwrap();
    assert!(
        said.starts_with(&format!("00-{TRACE}-")) && said.ends_with("-00"),
        "{said}"
    );
}

#[test]
fn a_collector_that_is_away_breaks_nothing() {
    let environment = TestEnvironment::new();
    // One that takes connections and says nothing, and one that is not there.
    let silent = TcpListener::bind("127.0.0.1:0").unwrap();
    let gone = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    for collector in [silent.local_addr().unwrap(), gone] {
        let begun = Instant::now();
        let ran = run(&environment, "key list --json", collector, "");
        assert_eq!(ran.code, 0, "{}", ran.err);
        assert!(ran.json().is_object() || ran.json().is_array());
        assert_eq!(ran.err, "");
        // Far below the ten seconds that an exporter waits by itself.
        assert!(begun.elapsed() < Duration::from_secs(8), "{:?}", begun.elapsed());
    }
}

#[test]
fn what_it_is_a_part_of_is_passed_on_without_a_collector() {
    let environment = TestEnvironment::new();
    let parent = format!("00-{TRACE}-{CALLER}-01");
    let mut traced = Vec::new();
    for given in [parent.as_str(), "00-nonsense"] {
        let child = environment
            .command("key list")
            .env("GUARDSPLAT_SERVER", environment.fake.url())
            .env_remove("OTEL_EXPORTER_OTLP_ENDPOINT")
            .env("TRACEPARENT", given)
            .spawn();
        assert_eq!(finish(child.unwrap()).code, 0);
        traced.append(&mut environment.fake.state().traced);
    }
    assert_eq!(traced, [Some(parent), None]);
}
