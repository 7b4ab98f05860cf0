//! What is around the services: deadlines, and reflection for clients that have nothing of ours.
use std::time::{Duration, Instant};

use guardsplat_proto::v1::GetArtifactRequest;
use tokio_stream::StreamExt;
use tonic::body::Body;
use tonic::codegen::http::{Request, Response};
use tonic::{Code, Status};
use tonic_reflection::pb::v1::server_reflection_client::ServerReflectionClient;
use tonic_reflection::pb::v1::server_reflection_request::MessageRequest;
use tonic_reflection::pb::v1::server_reflection_response::MessageResponse;
use tonic_reflection::pb::v1::{ServerReflectionRequest, ServerReflectionResponse};
use tower::{Layer, ServiceExt, service_fn};

use super::harness::{Server, chunk, first, metadata, refused};
use crate::grpc::deadline::Deadlines;

#[tokio::test]
async fn a_call_ends_at_its_deadline() {
    let never =
        service_fn(|_: Request<Body>| std::future::pending::<Result<Response<Body>, std::convert::Infallible>>());
    let request = Request::builder()
        .header("grpc-timeout", "50m")
        .body(Body::empty())
        .unwrap();
    let began = Instant::now();
    let answer = Deadlines.layer(never).oneshot(request).await.unwrap();
    assert!(
        (45..2000).contains(&began.elapsed().as_millis()),
        "{:?}",
        began.elapsed()
    );
    let status = Status::from_header_map(answer.headers()).unwrap();
    refused(Err::<(), _>(status), Code::DeadlineExceeded, "DEADLINE_EXCEEDED");
}

#[tokio::test]
async fn a_call_in_time_is_answered() {
    let at_once = service_fn(|_: Request<Body>| async {
        Ok::<_, std::convert::Infallible>(
            Response::builder()
                .header("x-answer", "yes")
                .body(Body::empty())
                .unwrap(),
        )
    });
    let request = Request::builder()
        .header("grpc-timeout", "10S")
        .body(Body::empty())
        .unwrap();
    let answer = Deadlines.layer(at_once).oneshot(request).await.unwrap();
    assert_eq!(answer.headers()["x-answer"], "yes");
}

#[tokio::test]
async fn a_deadline_that_has_passed_leaves_the_server_well() {
    let server = Server::start().await;
    let wait = Some(prost_types::Duration { seconds: 30, nanos: 0 });
    let mut request = tonic::Request::new(guardsplat_proto::v1::LeaseJobRequest {
        worker: "w".into(),
        wait,
        ..guardsplat_proto::v1::LeaseJobRequest::default()
    });
    request.set_timeout(Duration::from_millis(100));
    let began = Instant::now();
    let status = server.worker.clone().lease_job(request).await.unwrap_err();
    // tonic's client has a clock of its own, and calls it cancelled when that is first.
    assert!(
        matches!(status.code(), Code::DeadlineExceeded | Code::Cancelled),
        "{status:?}"
    );
    assert!(began.elapsed() < Duration::from_secs(5));
    server.create(super::harness::key_spec(8)).await;
    server.take().await;
}

#[tokio::test]
async fn errors_from_below_the_services_have_details_too() {
    let server = Server::start().await;
    let upload = [first(metadata("x.ply", &[7; 9])), chunk(&vec![7; 5 << 20])];
    let answer = server
        .artifacts
        .clone()
        .upload_artifact(tokio_stream::iter(upload))
        .await;
    refused(answer, Code::OutOfRange, "MESSAGE_TOO_LARGE");
    let long = GetArtifactRequest {
        name: "x".repeat(5 << 20),
    };
    refused(
        server.artifacts.clone().get_artifact(long).await,
        Code::OutOfRange,
        "MESSAGE_TOO_LARGE",
    );
    let call = async |path: &str| {
        // A frame of three bytes that are no message.
        let body = Body::new("\0\0\0\0\u{3}???".to_owned());
        let request = Request::post(path)
            .header("content-type", "application/grpc")
            .body(body);
        let answer = server.channel.clone().oneshot(request.unwrap()).await.unwrap();
        Status::from_header_map(answer.headers()).map_or(Ok(()), Err)
    };
    let answer = call("/guardsplat.v1.JobService/EndJob").await;
    refused(answer, Code::Unimplemented, "UNIMPLEMENTED");
    let answer = call("/guardsplat.v1.JobService/CreateJob").await;
    refused(answer, Code::Internal, "BAD_MESSAGE");
}

#[tokio::test]
async fn reflection_knows_every_service() {
    let server = Server::start().await;
    let ask = async |message_request| {
        let request = ServerReflectionRequest {
            host: String::new(),
            message_request: Some(message_request),
        };
        let mut client = ServerReflectionClient::new(server.channel.clone());
        let requests = tokio_stream::iter([request]);
        let mut answers = client.server_reflection_info(requests).await.unwrap().into_inner();
        let ServerReflectionResponse { message_response, .. } = answers.next().await.unwrap().unwrap();
        message_response.unwrap()
    };
    let MessageResponse::ListServicesResponse(list) = ask(MessageRequest::ListServices(String::new())).await else {
        panic!("no list")
    };
    let names: Vec<_> = list.service.into_iter().map(|service| service.name).collect();
    let services = [
        "JobService",
        "ArtifactService",
        "KeyService",
        "RegistryService",
        "WorkerService",
    ];
    for service in services {
        assert!(names.contains(&format!("guardsplat.v1.{service}")), "{names:?}");
    }
    // Types of details too, so that a generic client can show them.
    for symbol in [
        "guardsplat.v1.EmbedSpec",
        "google.rpc.BadRequest",
        "grpc.health.v1.Health",
    ] {
        let answer = ask(MessageRequest::FileContainingSymbol(symbol.into())).await;
        assert!(
            matches!(answer, MessageResponse::FileDescriptorResponse(_)),
            "{symbol}: {answer:?}"
        );
    }
}
