//! What clients and workers do from a key to a marked scene, with secrets that can be looked for afterwards.
use guardsplat_proto::v1::artifact_service_client::ArtifactServiceClient;
use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::job::{Result as Outcome, Spec};
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::progress::Stage;
use guardsplat_proto::v1::upload_artifact_request::Payload;
use guardsplat_proto::v1::worker_service_client::WorkerServiceClient;
use guardsplat_proto::v1::*;
use sha2::{Digest, Sha256};
use tonic::service::Interceptor;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::Channel;

/// What nobody is to read anywhere.
pub struct Flow {
    pub scene: String,
    pub key_file: String,
    pub lease_token: String,
    pub message: String,
}

fn metadata(bytes: &[u8]) -> UploadMetadata {
    UploadMetadata {
        display_name: "scene.ply".into(),
        size_bytes: bytes.len() as i64,
        sha256: hex::encode(Sha256::digest(bytes)),
    }
}

/// A key is made, a scene marked; `client` and `worker` show their tokens.
pub async fn carry_out(channel: &Channel, client: impl Interceptor + Clone, worker: impl Interceptor + Clone) -> Flow {
    let flow = Flow {
        scene: "the bytes of a scene".into(),
        key_file: "what a key file holds".into(),
        lease_token: String::new(),
        message: "ab5c0ffee5ec2e70".into(),
    };
    let mut jobs = JobServiceClient::with_interceptor(channel.clone(), client.clone());
    let mut artifacts = ArtifactServiceClient::with_interceptor(channel.clone(), client);
    let mut worker = WorkerServiceClient::with_interceptor(channel.clone(), worker);
    let parts = [
        Payload::Metadata(metadata(flow.scene.as_bytes())),
        Payload::Chunk(flow.scene.clone().into_bytes()),
    ];
    let parts = parts.map(|payload| UploadArtifactRequest { payload: Some(payload) });
    let scene = artifacts.upload_artifact(tokio_stream::iter(parts)).await.unwrap();
    let scene = scene.into_inner().name;

    let made = jobs
        .create_job(create(Spec::CreateKey(KeySpec {
            bits: 64,
            seed: None,
            ..KeySpec::default()
        })))
        .await;
    let made = made.unwrap().into_inner().name;
    let (_, token) = lease(&mut worker).await;
    let file = output(&mut worker, &made, &token, &flow.key_file, true).await;
    let key = KeyOutput {
        key_file: file,
        key: Some(Key {
            bits: 64,
            clip: "a clip".into(),
            clip_sha256: "0".repeat(64),
            ..Key::default()
        }),
        result: Some(KeyResult::default()),
    };
    complete(&mut worker, &made, &token, Output::KeyOutput(key)).await;
    let done = jobs.get_job(GetJobRequest { name: made }).await.unwrap().into_inner();
    let Some(Outcome::KeyResult(KeyResult { key, .. })) = done.result else {
        panic!("{:?}", done.result)
    };

    let spec = Spec::Embed(EmbedSpec {
        scene,
        key,
        message: flow.message.clone(),
        ..EmbedSpec::default()
    });
    let name = jobs.create_job(create(spec)).await.unwrap().into_inner().name;
    let (_, token) = lease(&mut worker).await;
    let request = DownloadKeyRequest {
        job: name.clone(),
        lease_token: token.clone(),
    };
    let mut parts = worker.download_key(request).await.unwrap().into_inner();
    assert!(parts.message().await.unwrap().is_some());
    let report = ReportJobRequest {
        name: name.clone(),
        lease_token: token.clone(),
        progress: Some(Progress {
            stage: Stage::Optimising.into(),
            ..Progress::default()
        }),
    };
    worker.report_job(report).await.unwrap();
    let marked = output(&mut worker, &name, &token, &flow.scene, false).await;
    let comparison = output(&mut worker, &name, &token, "a picture", false).await;
    let result = EmbedResult {
        scene: marked,
        comparison,
        message: flow.message.clone(),
        ..EmbedResult::default()
    };
    complete(&mut worker, &name, &token, Output::EmbedResult(result)).await;
    Flow {
        lease_token: token,
        ..flow
    }
}

type Worker<I> = WorkerServiceClient<InterceptedService<Channel, I>>;

fn create(spec: Spec) -> CreateJobRequest {
    CreateJobRequest {
        job: Some(Job {
            spec: Some(spec),
            ..Job::default()
        }),
        request_id: String::new(),
    }
}

async fn lease<I: Interceptor>(worker: &mut Worker<I>) -> (Job, String) {
    let request = LeaseJobRequest {
        worker: "stub".into(),
        ..LeaseJobRequest::default()
    };
    let lease = worker.lease_job(request).await.unwrap().into_inner();
    (lease.job.unwrap(), lease.lease_token)
}

async fn output<I: Interceptor>(worker: &mut Worker<I>, job: &str, token: &str, text: &str, secret: bool) -> String {
    let first = OutputMetadata {
        job: job.into(),
        lease_token: token.into(),
        upload: Some(metadata(text.as_bytes())),
        secret,
    };
    let parts = [
        upload_output_request::Payload::Metadata(first),
        upload_output_request::Payload::Chunk(text.into()),
    ];
    let parts = parts.map(|payload| UploadOutputRequest { payload: Some(payload) });
    let sent = worker.upload_output(tokio_stream::iter(parts)).await;
    sent.unwrap().into_inner().name
}

async fn complete<I: Interceptor>(worker: &mut Worker<I>, job: &str, token: &str, result: Output) {
    let request = CompleteJobRequest {
        name: job.into(),
        lease_token: token.into(),
        result: Some(result),
        ..CompleteJobRequest::default()
    };
    worker.complete_job(request).await.unwrap();
}
