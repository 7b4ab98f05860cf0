//! Hooks of the server as a process: the settings reach what sends, and a message goes out by itself.
use guardsplat_proto::v1::delivery::State;
use guardsplat_proto::v1::hook_service_client::HookServiceClient;
use guardsplat_proto::v1::job::Spec;
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::{
    CancelJobRequest, CreateHookRequest, CreateJobRequest, Hook, Job, KeySpec, ListDeliveriesRequest,
};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpListener;
use tokio::time::timeout;
use tonic::Code;

use super::support::{Bench, SOON};

fn wanted(url: String) -> CreateHookRequest {
    let hook = Hook { url, ..Hook::default() };
    CreateHookRequest { hook: Some(hook) }
}

#[tokio::test]
async fn a_message_goes_out_and_its_secret_is_in_no_log() {
    let receiver = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let url = format!("http://{}/hook?secret=5ec2e7", receiver.local_addr().unwrap());
    let mut bench = Bench::new();
    // Not allowed unless somebody says so.
    let server = bench.start().await;
    let mut hooks = HookServiceClient::new(server.channel().await);
    let refused = hooks.create_hook(wanted(url.clone())).await.unwrap_err();
    assert_eq!(refused.code(), Code::InvalidArgument);
    server.stop().await;

    bench.variable("GUARDSPLAT_HOOK_ALLOW_HTTP", "true");
    bench.variable("GUARDSPLAT_HOOK_ALLOW_PRIVATE", "true");
    let server = bench.start().await;
    let channel = server.channel().await;
    let mut hooks = HookServiceClient::new(channel.clone());
    let made = hooks.create_hook(wanted(url)).await.unwrap().into_inner();
    let job = Job {
        spec: Some(Spec::CreateKey(KeySpec {
            bits: 8,
            seed: None,
            ..KeySpec::default()
        })),
        ..Job::default()
    };
    let request = CreateJobRequest {
        job: Some(job),
        request_id: String::new(),
    };
    let mut jobs = JobServiceClient::new(channel);
    let name = jobs.create_job(request).await.unwrap().into_inner().name;
    jobs.cancel_job(CancelJobRequest { name: name.clone() }).await.unwrap();

    let (mut stream, _) = timeout(SOON, receiver.accept()).await.unwrap().unwrap();
    let mut received = Vec::new();
    while !received.ends_with(b"}}") {
        let read = timeout(SOON, stream.read_buf(&mut received)).await.unwrap().unwrap();
        assert_ne!(read, 0, "{}", String::from_utf8_lossy(&received));
    }
    let text = String::from_utf8(received).unwrap();
    assert!(
        text.contains("webhook-signature: v1,") && text.contains(&name),
        "{text}"
    );
    stream.write_all(b"HTTP/1.1 204 Done\r\n\r\n").await.unwrap();
    let state = async || {
        let told = hooks.clone().list_deliveries(ListDeliveriesRequest::default()).await;
        told.unwrap().into_inner().deliveries[0].state()
    };
    let acknowledged = async {
        while state().await != State::Delivered {
            tokio::time::sleep(std::time::Duration::from_millis(20)).await;
        }
    };
    timeout(SOON, acknowledged).await.unwrap();
    assert_eq!(server.stop().await.code(), Some(0));
    let log = bench.server_log();
    assert!(log.contains("acknowledged") && !log.contains("5ec2e7"), "{log}");
    assert!(!log.contains(&made.secret), "{log}");
}
