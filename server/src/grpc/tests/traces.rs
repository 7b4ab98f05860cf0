//! A trace, from the request through attempts and stages to what the worker is told; with a collector that listens.
use std::sync::{Arc, Mutex};

use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::progress::Stage;
use guardsplat_proto::v1::{CreateJobRequest, Job, LeaseJobRequest, Progress, ReportJobRequest};
use opentelemetry_proto::tonic::collector::trace::v1::trace_service_server::{TraceService, TraceServiceServer};
use opentelemetry_proto::tonic::collector::trace::v1::{ExportTraceServiceRequest, ExportTraceServiceResponse};
use opentelemetry_proto::tonic::trace::v1::Span;
use tokio::net::TcpListener;
use tonic::transport::server::TcpIncoming;
use tonic::{Request, Response, Status};

use super::harness::{Server, key_output, key_spec};
use crate::service::Limits;
use crate::traces::Traces;

const TRACE: &str = "0af7651916cd43dd8448eb211c80319c";
const CALLER: &str = "b7ad6b7169203331";

/// Keeps the spans that it is sent.
#[derive(Clone, Default)]
struct Collector(Arc<Mutex<Vec<Span>>>);

#[tonic::async_trait]
impl TraceService for Collector {
    async fn export(
        &self,
        request: Request<ExportTraceServiceRequest>,
    ) -> Result<Response<ExportTraceServiceResponse>, Status> {
        let scopes = request
            .into_inner()
            .resource_spans
            .into_iter()
            .flat_map(|r| r.scope_spans);
        self.0.lock().unwrap().extend(scopes.flat_map(|scope| scope.spans));
        Ok(Response::new(ExportTraceServiceResponse::default()))
    }
}

async fn create(server: &Server, trace_parent: Option<&str>) -> Job {
    let mut request = Request::new(CreateJobRequest {
        job: Some(Job {
            spec: Some(key_spec(8)),
            ..Job::default()
        }),
        request_id: String::new(),
    });
    if let Some(text) = trace_parent {
        request.metadata_mut().insert("traceparent", text.parse().unwrap());
    }
    let made = JobServiceClient::new(server.channel.clone()).create_job(request).await;
    made.unwrap().into_inner()
}

async fn lease(server: &Server) -> (String, String, String) {
    let request = LeaseJobRequest {
        worker: "test".into(),
        ..LeaseJobRequest::default()
    };
    let lease = server.worker.clone().lease_job(request).await.unwrap().into_inner();
    (lease.job.unwrap().name, lease.lease_token, lease.trace_parent)
}

#[tokio::test]
async fn what_a_caller_is_a_part_of_is_passed_on_without_a_collector() {
    let server = Server::start().await;
    let said = format!("00-{TRACE}-{CALLER}-01");
    for (given, told) in [
        (Some(said.as_str()), said.as_str()),
        (None, ""),
        (Some("00-nonsense"), ""),
    ] {
        let job = create(&server, given).await;
        let (name, _, trace_parent) = lease(&server).await;
        assert_eq!((name, trace_parent.as_str()), (job.name, told));
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_trace_goes_from_the_request_to_every_stage() {
    let collector = Collector::default();
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let endpoint = format!("http://{}", listener.local_addr().unwrap());
    let service = TraceServiceServer::new(collector.clone());
    tokio::spawn(
        tonic::transport::Server::builder()
            .add_service(service)
            .serve_with_incoming(TcpIncoming::from(listener)),
    );
    let traces = Traces::open(Some(&endpoint)).unwrap();
    let server = Server::traced(Limits::default(), traces.clone()).await;
    let job = create(&server, Some(&format!("00-{TRACE}-{CALLER}-01"))).await;
    let (name, token, trace_parent) = lease(&server).await;
    assert_eq!(name, job.name);
    for stage in [Stage::Preparing, Stage::Optimising] {
        let request = ReportJobRequest {
            name: name.clone(),
            lease_token: token.clone(),
            progress: Some(Progress {
                stage: stage.into(),
                ..Progress::default()
            }),
        };
        server.worker.clone().report_job(request).await.unwrap();
    }
    let file = server.stored(&name, &token, b"the key file", true).await;
    let result = Output::KeyOutput(key_output(8, &file));
    server.complete(&name, &token, result).await.unwrap();
    traces.close().await;

    let spans = collector.0.lock().unwrap().clone();
    let names: Vec<&str> = spans.iter().map(|span| span.name.as_str()).collect();
    let span = |name: &str| {
        let found = spans.iter().find(|span| span.name == name);
        found.unwrap_or_else(|| panic!("{name} is not in {names:?}"))
    };
    assert!(
        spans.iter().all(|span| hex::encode(&span.trace_id) == TRACE),
        "{names:?}"
    );
    let call = span("guardsplat.v1.JobService/CreateJob");
    assert_eq!(hex::encode(&call.parent_span_id), CALLER);
    let attempt = span("create key");
    for below in [attempt, span("wait in queue")] {
        assert_eq!(below.parent_span_id, call.span_id);
    }
    for stage in ["preparing", "optimising"] {
        assert_eq!(span(stage).parent_span_id, attempt.span_id);
        assert!(span(stage).start_time_unix_nano <= span(stage).end_time_unix_nano);
    }
    assert_eq!(trace_parent, format!("00-{TRACE}-{}-01", hex::encode(&attempt.span_id)));
    // Workers' calls and what they send make no spans of their own.
    assert_eq!(spans.len(), 5, "{names:?}");
    let all = format!("{spans:?}");
    assert!(!all.contains(&token) && !all.contains("the key file"));
}
