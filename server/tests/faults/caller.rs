//! What clients and workers say to the server.
use std::net::IpAddr;
use std::time::Duration;

use guardsplat_proto::v1::artifact_service_client::ArtifactServiceClient;
use guardsplat_proto::v1::complete_job_request::Result as Output;
use guardsplat_proto::v1::job::{Spec, State};
use guardsplat_proto::v1::job_service_client::JobServiceClient;
use guardsplat_proto::v1::worker_service_client::WorkerServiceClient;
use guardsplat_proto::v1::{
    Artifact, CompleteJobRequest, CreateJobRequest, DownloadArtifactRequest, EmbedSpec, GetJobRequest, Job, KeySpec,
    LeaseJobRequest, LeaseJobResponse, OutputMetadata, UploadArtifactRequest, UploadMetadata, UploadOutputRequest,
    VerifySpec, download_artifact_response, upload_artifact_request, upload_output_request,
};
use sha2::{Digest, Sha256};
use tokio::time::{Instant, sleep};
use tonic::transport::{Channel, Endpoint};
use tonic::{Code, Status};

use crate::support::SOON;

/// Calls on one connection.
#[derive(Clone)]
pub struct Caller {
    pub channel: Channel,
    pub jobs: JobServiceClient<Channel>,
    pub artifacts: ArtifactServiceClient<Channel>,
    pub worker: WorkerServiceClient<Channel>,
}

/// Whether the server may do it when it is asked again.
pub fn passes(status: &Status) -> bool {
    // A connection that breaks amid a call says so in several ways.
    matches!(
        status.code(),
        Code::Unavailable | Code::Unknown | Code::Cancelled | Code::DeadlineExceeded | Code::Internal
    )
}

/// Asks until the server can be asked.
pub async fn persist<T, F>(mut call: impl FnMut() -> F) -> Result<T, Status>
where
    F: Future<Output = Result<T, Status>>,
{
    let begun = Instant::now();
    loop {
        match call().await {
            Err(status) if passes(&status) && begun.elapsed() < 10 * SOON => sleep(Duration::from_millis(50)).await,
            answer => return answer,
        }
    }
}

impl Caller {
    pub fn new(url: &str) -> Self {
        Self::with_window(url, None)
    }

    /// One who is sent so many bytes of a stream ahead of what was read, if not as many as usual.
    pub fn with_window(url: &str, window: Option<u32>) -> Self {
        let endpoint = Channel::from_shared(url.to_owned()).unwrap();
        Self::by(endpoint.initial_stream_window_size(window))
    }

    /// The same, who calls from another address.
    pub fn at(url: &str, from: IpAddr, window: u32) -> Self {
        let endpoint = Channel::from_shared(url.to_owned()).unwrap();
        Self::by(endpoint.local_address(Some(from)).initial_stream_window_size(window))
    }

    fn by(endpoint: Endpoint) -> Self {
        let channel = endpoint.connect_timeout(Duration::from_secs(5)).connect_lazy();
        Self {
            jobs: JobServiceClient::new(channel.clone()),
            artifacts: ArtifactServiceClient::new(channel.clone()),
            worker: WorkerServiceClient::new(channel.clone()),
            channel,
        }
    }

    pub async fn submit(&self, job: Job, request_id: &str) -> Result<Job, Status> {
        let request = CreateJobRequest {
            job: Some(job),
            request_id: request_id.into(),
        };
        Ok(self.jobs.clone().create_job(request).await?.into_inner())
    }

    pub async fn job(&self, name: &str) -> Result<Job, Status> {
        let request = GetJobRequest { name: name.into() };
        Ok(self.jobs.clone().get_job(request).await?.into_inner())
    }

    /// The job once it is in this state.
    pub async fn reaches(&self, name: &str, state: State) -> Job {
        let begun = Instant::now();
        loop {
            let job = persist(|| self.job(name)).await.unwrap();
            if job.state() == state {
                return job;
            }
            assert!(begun.elapsed() < 15 * SOON, "still {job:?}");
            sleep(Duration::from_millis(50)).await;
        }
    }

    pub async fn upload(&self, name: &str, bytes: &[u8]) -> Result<Artifact, Status> {
        use upload_artifact_request::Payload;
        let mut payloads = vec![Payload::Metadata(metadata(name, bytes))];
        payloads.extend(bytes.chunks(256 << 10).map(|chunk| Payload::Chunk(chunk.to_vec())));
        let messages = payloads
            .into_iter()
            .map(|payload| UploadArtifactRequest { payload: Some(payload) });
        let sent = self
            .artifacts
            .clone()
            .upload_artifact(tokio_stream::iter(messages))
            .await;
        Ok(sent?.into_inner())
    }

    pub async fn download(&self, name: &str) -> Result<Vec<u8>, Status> {
        use download_artifact_response::Payload;
        let request = DownloadArtifactRequest {
            name: name.into(),
            ..DownloadArtifactRequest::default()
        };
        let mut stream = self.artifacts.clone().download_artifact(request).await?.into_inner();
        let mut bytes = Vec::new();
        while let Some(message) = stream.message().await? {
            if let Some(Payload::Chunk(chunk)) = message.payload {
                bytes.extend(chunk);
            }
        }
        Ok(bytes)
    }

    pub async fn lease(&self, worker: &str, wait: Duration) -> Result<LeaseJobResponse, Status> {
        let request = LeaseJobRequest {
            worker: worker.into(),
            wait: Some(prost_types::Duration::try_from(wait).unwrap()),
            ..LeaseJobRequest::default()
        };
        Ok(self.worker.clone().lease_job(request).await?.into_inner())
    }

    /// Leases a job, which must be there or come soon: when the lease of another runs out, at the latest.
    pub async fn take(&self) -> (Job, String) {
        let lease = persist(|| self.lease("taker", SOON));
        let lease = lease.await.unwrap();
        (lease.job.expect("there is no job"), lease.lease_token)
    }

    /// Stores an output; the bytes go out in pieces with a pause before each.
    pub async fn output(
        &self,
        of: (&str, &str),
        bytes: &[u8],
        secret: bool,
        pause: Duration,
    ) -> Result<String, Status> {
        use upload_output_request::Payload;
        let first = OutputMetadata {
            job: of.0.into(),
            lease_token: of.1.into(),
            upload: Some(metadata("output.bin", bytes)),
            secret,
        };
        let mut payloads = vec![Payload::Metadata(first)];
        payloads.extend(bytes.chunks(16 << 10).map(|chunk| Payload::Chunk(chunk.to_vec())));
        let messages = tokio_stream::StreamExt::then(tokio_stream::iter(payloads), move |payload| async move {
            if !pause.is_zero() {
                sleep(pause).await;
            }
            UploadOutputRequest { payload: Some(payload) }
        });
        Ok(self.worker.clone().upload_output(messages).await?.into_inner().name)
    }

    pub async fn complete(&self, of: (&str, &str), result: Output) -> Result<(), Status> {
        let request = CompleteJobRequest {
            name: of.0.into(),
            lease_token: of.1.into(),
            result: Some(result),
            ..CompleteJobRequest::default()
        };
        self.worker.clone().complete_job(request).await.map(|_| ())
    }

    /// A key, made by a job of its own. The queue must be empty.
    pub async fn key(&self) -> String {
        self.submit(
            job(Spec::CreateKey(KeySpec {
                bits: 16,
                seed: None,
                ..KeySpec::default()
            })),
            "",
        )
        .await
        .unwrap();
        let (job, token) = self.take().await;
        crate::stub::complete(self, &job, &token).await.unwrap();
        match self.job(&job.name).await.unwrap().result {
            Some(guardsplat_proto::v1::job::Result::KeyResult(result)) => result.key,
            other => panic!("{other:?}"),
        }
    }

    /// What jobs need: a key, and a picture or scene.
    pub async fn inputs(&self) -> Inputs {
        Inputs {
            key: self.key().await,
            artifact: self.upload("scene.ply", b"a scene").await.unwrap().name,
        }
    }
}

/// What jobs are made of.
pub struct Inputs {
    pub key: String,
    pub artifact: String,
}

impl Inputs {
    pub fn embed(&self) -> Job {
        job(Spec::Embed(EmbedSpec {
            scene: self.artifact.clone(),
            key: self.key.clone(),
            message: "beef".into(),
            ..EmbedSpec::default()
        }))
    }

    pub fn verify(&self) -> Job {
        job(Spec::Verify(VerifySpec {
            suspects: vec![self.artifact.clone()],
            key: self.key.clone(),
            ..VerifySpec::default()
        }))
    }
}

fn job(spec: Spec) -> Job {
    Job {
        spec: Some(spec),
        ..Job::default()
    }
}

fn metadata(name: &str, bytes: &[u8]) -> UploadMetadata {
    UploadMetadata {
        display_name: name.into(),
        size_bytes: bytes.len() as i64,
        sha256: hex::encode(Sha256::digest(bytes)),
    }
}
